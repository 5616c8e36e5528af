"""What an observer is, and what it is told of the call beside the event."""

from __future__ import annotations

import contextvars
import inspect
import uuid
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Protocol

from actionkit._model.values import GoalEvent


@dataclass(frozen=True)
class CallInfo:
    """Which call an event belongs to. All attempts of a call have the same.

    Attributes:
        call_id: The id of the call's first goal; it stays the same for all attempts.
        action_name: The full name of the action.
        action_type: Such as `test_msgs/action/Fibonacci`.
        node_name: The full name of the client's `node=`, `""` where there is none.
        monotonic: When the call was made, in seconds on the monotonic clock.
        wall: The same in seconds since the epoch.
        goal: The goal message, for reading only; `None` where it was not valid.
        context: The context variables of the caller, such as its OpenTelemetry span. To look
            into it, run a copy of it.
    """

    call_id: uuid.UUID
    action_name: str
    action_type: str
    node_name: str
    monotonic: float
    wall: float
    goal: Any = field(default=None, repr=False, compare=False)
    context: contextvars.Context | None = field(default=None, repr=False, compare=False)

    def elapsed_ms(self, event: GoalEvent) -> float:
        """Return the milliseconds from the call to an event."""
        return round((event.monotonic - self.monotonic) * 1000, 3)


class Observer(Protocol):
    """Is told what happens to the goals of a client: `Client(..., observers=[...])`.

    Two more methods are called where an observer has them:

    - `on_feedback(event, feedback, call)` gets each `FEEDBACK` event, in place of `on_event`,
      with the action's feedback message. Where that cannot be decoded, `on_event` is called.
    - `on_outcome(outcome, call)` gets the `Outcome` of each call, once, when it ended. Of a goal
      that its caller gave up on there may be events afterwards.

    An observer is called in order, by one thread at a time for each client, never by one that
    anybody's result depends on. Messages are the caller's own: read them, and change nothing.
    One that raises is told nothing more; a warning with the traceback is logged.
    """

    def on_event(self, event: GoalEvent, call: CallInfo) -> object:
        """Take note of a transition."""


def check_observers(observers: Iterable[Observer]) -> tuple[Observer, ...]:
    """Return the observers, checked.

    Raises:
        TypeError: No iterable, or something in it that is no observer.
        ValueError: One of them stands there twice.
    """
    if isinstance(observers, (str, bytes)) or not isinstance(observers, Iterable):
        raise TypeError(f"observers={observers!r} must be a list of observers: observers=[...]")
    checked: list[Observer] = []
    for observer in observers:
        if inspect.isclass(observer):
            raise TypeError(f"observers: {observer!r} is a class; make an instance of it")
        for name in ("on_event", "on_feedback", "on_outcome"):
            hook = getattr(observer, name, None)
            if hook is None and name != "on_event":
                continue
            if not callable(hook):
                raise TypeError(f"observers: {observer!r} is no observer: it has no {name}()")
            if inspect.iscoroutinefunction(hook):
                raise TypeError(
                    f"observers: {name}() of {observer!r} is a coroutine function, and no event"
                    " loop is there to run it: make it a plain one"
                )
        if any(observer is other for other in checked):
            raise ValueError(f"observers: {observer!r} stands there twice")
        checked.append(observer)
    return tuple(checked)
