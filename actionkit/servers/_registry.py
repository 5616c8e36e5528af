"""Behaviours and their names. No rclpy here, so that names can be listed without it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, TypeAlias, TypeVar

if TYPE_CHECKING:
    from ._run import Run

OptionValue = int | float | str
#: An option as `start` takes it. The lists are scripts.
Option: TypeAlias = bool | int | float | str | Sequence[object]

#: Names the server among others, over its restarts; set by whoever starts it.
INSTANCE_VARIABLE = "ACTIONKIT_SERVER_INSTANCE"

_behaviours: dict[str, type[Behaviour]] = {}

#: Options of every server, with their defaults. The default's type is the option's type.
COMMON_OPTIONS: dict[str, OptionValue] = {
    # 0: a thread per executing goal, any number of them. 1: rclpy's SingleThreadedExecutor.
    # More: its MultiThreadedExecutor with so many threads.
    "threads": 0,
    # Seconds for which the server keeps a result.
    "result_timeout": 900.0,
    # "all" events, all but "feedback" ("goals"), or "ready" alone ("none"): for long runs.
    "journal": "all",
}


class Process(Protocol):
    """What a behaviour may ask of the process that serves it."""

    def enable_self_cancel(self) -> None:
        """Make a second action client, in a node of its own; call it before any goal."""

    def cancel_from_elsewhere(self, goal_id: str) -> None:
        """Ask, through that second client, for a goal's cancel."""

    def destroy_server(self, index: int) -> None:
        """Destroy an action server; the process and its node stay."""

    def crash(self, run: Run, point: str) -> None:
        """Say so in the journal, then die by SIGKILL."""

    def end(self) -> None:
        """Ask for a clean end of the process; it comes a little later."""

    def restart(self, how: str) -> None:
        """Come back with nothing but the count of goals, after a clean end or as if killed.

        Args:
            how: "clean" returns, and the end comes a little later; "kill" does not return.
        """


class Behaviour:
    """What one reference server does. Subclass it, set the fields, override the hooks.

    The hooks run on different threads at the same time; per-goal state belongs to the `Run`.
    """

    #: One line for ``--list``; the first line of the docstring, set on registration.
    description: ClassVar[str] = ""
    #: The options of its own, with their defaults.
    options: ClassVar[dict[str, OptionValue]] = {}
    #: The values that an option may have, where it is a matter of choice.
    choices: ClassVar[dict[str, tuple[str, ...]]] = {}
    #: Module and class of the action.
    action_type: ClassVar[str] = "test_msgs.action:Fibonacci"
    #: How many action servers there are on the name, each with its own node.
    servers: ClassVar[int] = 1
    #: True where `decide` may wait: it then runs beside the other requests, not before them.
    decides_slowly: ClassVar[bool] = False

    def __init__(self, options: Mapping[str, Any], process: Process) -> None:
        self.option = options
        self.process = process

    def received(self, run: Run) -> None:
        """The goal was asked for; of all hooks, the first, and in the order of the requests."""

    def takes_time_to_decide(self, run: Run) -> bool:
        """Whether `decide` may wait about this goal."""
        return self.decides_slowly

    def decide(self, run: Run) -> bool:
        """Whether to accept the goal."""
        return run.order >= 0

    def accepted(self, run: Run) -> None:
        """The acceptance was sent; the goal does not execute yet."""

    def begin(self, run: Run) -> None:
        """Let the accepted goal execute; override it to put that off."""
        run.begin()

    def may_cancel(self, run: Run) -> bool:
        """Whether to accept a request to cancel the goal."""
        return True

    def cancelled(self, run: Run) -> None:
        """The goal has entered the state CANCELING; who waits for that in it was woken."""

    def result_requested(self, run: Run) -> None:
        """A client has asked for the goal's result, so it knows of the acceptance."""

    def execute(self, run: Run) -> object:
        """Do it, on a thread of its own; returns what ``run.succeed`` and its kind return."""
        raise NotImplementedError

    @classmethod
    def parse(cls, given: Mapping[str, str]) -> dict[str, OptionValue]:
        """All options with their values.

        Raises:
            ValueError: An option is unknown, not of its type, or not among the choices.
        """
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


_B = TypeVar("_B", bound=type[Behaviour])


def server(cls: _B) -> _B:
    """Register a behaviour under its class's name, as ``SlowAccept`` → ``slow_accept``."""
    name = "".join(f"_{c.lower()}" if c.isupper() else c for c in cls.__name__).lstrip("_")
    cls.description = (cls.__doc__ or "").strip().splitlines()[0]
    _behaviours[name] = cls
    return cls


def names() -> dict[str, str]:
    """The reference servers: name to one-line description, sorted."""
    _load()
    return {name: _behaviours[name].description for name in sorted(_behaviours)}


def behaviour_named(name: str) -> type[Behaviour]:
    """The behaviour of that name.

    Raises:
        ValueError: There is none.
    """
    _load()
    try:
        return _behaviours[name]
    except KeyError:
        raise ValueError(
            f"no reference server {name!r}; there are: {', '.join(sorted(_behaviours))}"
        ) from None


def format_option(value: Option) -> str:
    """As it is written on the command line.

    Raises:
        TypeError: It holds something that JSON does not know.
    """
    if isinstance(value, bool):
        return str(int(value))
    return str(value) if isinstance(value, (int, float, str)) else json.dumps(value)


def _load() -> None:
    # Not at the top: these modules import this one.
    from . import (  # noqa: F401
        _behaviours_basic,
        _behaviours_faulty,
        _behaviours_queueing,
        _behaviours_restarting,
        _behaviours_rich,
        _behaviours_scripted,
    )
