"""Defines what an observer is, and what it is told about a call."""

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
    """The call that an event belongs to. All attempts of a call have the same `CallInfo`.

    Attributes:
        call_id: The id of the call's first goal; it stays the same for all attempts.
        action_name: The full name of the action.
        action_type: The action's type, such as `test_msgs/action/Fibonacci`.
        node_name: The full name of the client's `node=`, or `""` without one.
        monotonic: When the call was made, in seconds on the monotonic clock.
        wall: The same time in seconds since the epoch.
        goal: The goal message, for reading only; `None` if it was not valid.
        context: The context variables of the caller, such as its OpenTelemetry span. To read
            them, run code in a copy: `context.copy().run(...)`.
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
    """Gets every transition of a client's goals: `Client(..., observers=[...])`.

    An observer may have two more methods:

    - `on_feedback(event, feedback, call)` gets each `FEEDBACK` event and the action's feedback
      message. It is called instead of `on_event`, unless the message cannot be decoded.
    - `on_outcome(outcome, call)` gets the `Outcome` of each call, once, when the call has ended. If
      the caller gave up on a goal, more events of that goal may follow.

    For each client, one thread at a time calls an observer, and events come in order. Results never
    wait for that thread. Messages belong to the caller: read them, and do not change them. If an
    observer raises, it is not called again, and a warning with the traceback is logged.
    """

    def on_event(self, event: GoalEvent, call: CallInfo) -> object:
        """Handle a transition."""


def check_observers(observers: Iterable[Observer]) -> tuple[Observer, ...]:
    """Return the observers, checked.

    Raises:
        TypeError: It is not an iterable of observers.
        ValueError: One of them is listed twice.
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
