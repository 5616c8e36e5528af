"""What a reference server is made of: the base of all of them, and their options. No rclpy here."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Protocol, TypeAlias

from actionkit.servers._life import Life
from actionkit.servers._run import GoalStopped, Run

OptionValue = int | float | str
Option: TypeAlias = bool | int | float | str | Sequence[object]
"""An option as `start` takes it. The lists are scripts."""

COMMON_OPTIONS: dict[str, OptionValue] = {
    # 0: a thread per executing goal, any number of them. 1: rclpy's SingleThreadedExecutor.
    # More: its MultiThreadedExecutor with so many threads.
    "threads": 0,
    # Seconds for which the server keeps a result; 15 minutes, as rclpy's ActionServer does.
    "result_timeout": 900.0,
    # "all" events, all but "feedback" ("goals"), or "ready" and what ends a process ("none").
    "journal": "all",
    # How many steps a goal has where the action's type is not the server's own: Fibonacci's goals
    # say it by `order`.
    "steps": 5,
}
"""Options of every server, with their defaults. The default's type is the option's type."""


class Process(Protocol):
    """What a behaviour may ask of the process that serves it."""

    life: Life
    foreign: bool

    def enable_self_cancel(self) -> None:
        """Make a second action client, in a node of its own; call it before any goal."""

    def cancel_from_elsewhere(self, goal_id: str) -> None:
        """Ask, through that second client, for a goal's cancel."""

    def destroy_server(self, index: int) -> None:
        """Destroy an action server; the process and its node stay."""


class Behaviour:
    """What one reference server does. Subclass it, set the fields, override the hooks.

    The hooks run on different threads at the same time; per-goal state belongs to the `Run`.

    Attributes:
        options: The options of its own, with their defaults.
        choices: The values that an option may have, where there are only a few.
        action_type: The type of the action.
        other_types: Other types with fields that it knows.
        any_type: Whether it makes sense for actions of other types: it then reads nothing of a goal
            but `run.order`, and its feedback and results are empty messages.
        servers: How many action servers there are on the name, each with its own node.
        decides_slowly: Whether `decide` may wait: it then runs beside the other requests, which
            are answered meanwhile.
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
        """Return how many steps a goal asks for, 0 where the server's own type has no such field.

        In another type a field of that name may be anything.
        """
        if self.process.foreign:
            return int(self.option["steps"])
        return int(getattr(goal, "order", 0))

    def received(self, run: Run) -> None:
        """Hear of a goal request; of all hooks, the first, and in the order of the requests."""

    def takes_time_to_decide(self, run: Run) -> bool:
        """Return whether `decide` may wait about this goal."""
        return self.decides_slowly

    def decide(self, run: Run) -> bool:
        """Return whether to accept the goal."""
        return run.order >= 0

    def accepted(self, run: Run) -> None:
        """Hear that the acceptance was sent; the goal does not execute yet."""

    def begin(self, run: Run) -> None:
        """Let the accepted goal execute; override it to put that off."""
        run.begin()

    def may_cancel(self, run: Run) -> bool:
        """Return whether to accept a request to cancel the goal."""
        return True

    def cancelled(self, run: Run) -> None:
        """Hear that the goal has entered CANCELING; its waiting thread was woken."""

    def result_requested(self, run: Run) -> None:
        """Hear that a client asked for the goal's result, so it knows of the acceptance."""

    def execute_to_end(self, run: Run) -> object:
        """Do all of a goal's work, on a thread of its own; return its result message."""
        try:
            return self.execute(run)
        except GoalStopped:
            return self.stopped(run)

    def execute(self, run: Run) -> object:
        """Do the work; return what `run.succeed` or `run.abort` returns.

        Raises:
            GoalStopped: The goal is to stop, as the waits of `run` say.
        """
        raise NotImplementedError

    def stopped(self, run: Run) -> object:
        """End a goal that is to stop, with `run.content` as its result."""
        return run.canceled()

    @classmethod
    def parse(cls, given: Mapping[str, str], *, foreign: bool = False) -> dict[str, OptionValue]:
        """Return all options with their values.

        Args:
            given: Those that were given, as texts.
            foreign: Whether the action is of another type than the server's own.

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
        TypeError: It holds something that JSON does not know.
    """
    if isinstance(value, bool):
        return str(int(value))
    return str(value) if isinstance(value, (int, float, str)) else json.dumps(value)
