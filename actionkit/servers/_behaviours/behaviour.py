"""The base class of the reference servers, and their options. No rclpy here."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Protocol, TypeAlias

from actionkit.servers._life import Life
from actionkit.servers._run import GoalStopped, Run

OptionValue = int | float | str
Option: TypeAlias = bool | int | float | str | Sequence[object]
"""The type of an option for `start`. The lists are scripts."""

COMMON_OPTIONS: dict[str, OptionValue] = {
    # 0: a thread per executing goal, any number of them. 1: rclpy's SingleThreadedExecutor.
    # More: its MultiThreadedExecutor with this many threads.
    "threads": 0,
    # Seconds for which the server keeps a result; 15 minutes, as rclpy's ActionServer does.
    "result_timeout": 900.0,
    # "all" events, all except "feedback" ("goals"), or only "ready" and ends of processes ("none").
    "journal": "all",
    # How many steps a goal has if the action's type is not the server's own. (Goals of Fibonacci
    # have `order`.)
    "steps": 5,
}
"""Options of every server, with their defaults. The default's type is the option's type."""


class Process(Protocol):
    """What a behaviour may ask its process to do."""

    life: Life
    foreign: bool

    def enable_self_cancel(self) -> None:
        """Make a second action client, in a node of its own; call it before any goal."""

    def cancel_from_elsewhere(self, goal_id: str) -> None:
        """Cancel a goal through that second client."""

    def destroy_server(self, index: int) -> None:
        """Destroy an action server; the process and its node stay."""


class Behaviour:
    """Base of the reference servers. Subclass it, set the fields, override the hooks.

    The hooks run on different threads at the same time; the state of a goal belongs to its `Run`.

    Attributes:
        options: Its own options, with their defaults.
        choices: The values that an option may have, if there are only a few.
        other_types: Other types with fields that it knows.
        any_type: Whether it makes sense for actions of other types: then it reads nothing of a goal
            but `run.order`, and its feedback and results are empty messages.
        servers: How many action servers there are on the name, each with its own node.
        decides_slowly: Whether `decide` may wait: then it runs beside the other requests, which are
            answered meanwhile.
    """

    options: ClassVar[dict[str, OptionValue]] = {}
    choices: ClassVar[dict[str, tuple[str, ...]]] = {}
    action_type: ClassVar[str] = "test_msgs/action/Fibonacci"
    other_types: ClassVar[tuple[str, ...]] = ()
    any_type: ClassVar[bool] = False
    servers: ClassVar[int] = 1
    decides_slowly: ClassVar[bool] = False

    def __init__(self, options: Mapping[str, Any], process: Process) -> None:
        self.option = options
        self.process = process
        self.life = process.life

    def order_of(self, goal: Any) -> int:
        """Return how many steps a goal asks for; 0 if the server's own type has no such field.

        In another type, a field of that name may mean anything.
        """
        if self.process.foreign:
            return int(self.option["steps"])
        return int(getattr(goal, "order", 0))

    def received(self, run: Run) -> None:
        """Called with a goal request, before all other hooks, in the order of the requests."""

    def takes_time_to_decide(self, run: Run) -> bool:
        """Return whether `decide` may wait about this goal."""
        return self.decides_slowly

    def takes_time_to_cancel(self) -> bool:
        """Return whether `may_cancel` may wait."""
        return False

    def decide(self, run: Run) -> bool:
        """Return whether to accept the goal."""
        return run.order >= 0

    def accepted(self, run: Run) -> None:
        """Called after the acceptance was sent; the goal does not execute yet."""

    def begin(self, run: Run) -> None:
        """Let the accepted goal execute; override this to delay it."""
        run.begin()

    def may_cancel(self, run: Run) -> bool:
        """Return whether to accept a request to cancel the goal."""
        return True

    def cancelled(self, run: Run) -> None:
        """Called when the goal has entered CANCELING; its waiting thread was woken."""

    def result_requested(self, run: Run) -> None:
        """Called when a client has asked for the goal's result, so it knows of the acceptance."""

    def execute_to_end(self, run: Run) -> object:
        """Do all of a goal's work, on its own thread; return its result message."""
        try:
            return self.execute(run)
        except GoalStopped:
            return self.stopped(run)

    def execute(self, run: Run) -> object:
        """Do the work; return what `run.succeed` or `run.abort` returns.

        Raises:
            GoalStopped: The goal must stop; the waits of `run` raise this.
        """
        raise NotImplementedError

    def stopped(self, run: Run) -> object:
        """End a goal that must stop, with `run.content` as its result."""
        return run.canceled()

    @classmethod
    def parse(cls, given: Mapping[str, str], *, foreign: bool = False) -> dict[str, OptionValue]:
        """Return all options with their values, from the given texts.

        `foreign` means that the action has another type than the server's own.

        Raises:
            ValueError: An option is unknown, not of its type, or not among the choices.
        """
        if "steps" in given and not foreign:
            raise ValueError(
                f"option steps={given['steps']} is for actions of another type than"
                f" {cls.action_type}, whose goals themselves say what is to be done"
            )
        values = {**COMMON_OPTIONS, **cls.options}
        for key, text in given.items():
            if key not in values:
                known = ", ".join(sorted(values))
                raise ValueError(f"no option {key!r}; there are: {known}")
            try:
                values[key] = type(values[key])(text)
            except ValueError:
                kind = type(values[key]).__name__
                raise ValueError(f"option {key}={text!r} is not of type {kind}") from None
            if text not in cls.choices.get(key, (text,)):
                choices = ", ".join(cls.choices[key])
                raise ValueError(f"option {key}={text!r} is not one of {choices}")
        return values


def format_option(value: Option) -> str:
    """Return an option's value as it is written on the command line.

    Raises:
        TypeError: JSON has no form for a part of it.
    """
    if isinstance(value, bool):
        return str(int(value))
    return str(value) if isinstance(value, (int, float, str)) else json.dumps(value)
