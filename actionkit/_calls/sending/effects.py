"""Defines what a call's state machine asks its driver to do. For a goal, see `_goal.effects`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from actionkit._goal import effects as fx


@dataclass(slots=True)
class AwaitServer:
    """Report when a server is ready, or serves another type; take the goal out of the queue."""

    until: float | None  # when the wait ends, if before the deadline
    another: bool = False  # whether to report only a new server, and not one that is there


@dataclass(slots=True)
class Queue:
    """Queue the goal, and report when its turn comes."""


@dataclass(slots=True)
class Send:
    """Make an attempt: send the goal now."""


@dataclass(slots=True)
class Judge:
    """Find out how the end of an attempt counts."""

    ending: fx.Ending


@dataclass(slots=True)
class CutJudging:
    """Limit the wait for the verdict to the time for a cancellation, or end it now."""

    why: str
    at_once: bool


@dataclass(slots=True)
class Count:
    """Tell the retry budget about a success or a transient failure."""

    success: bool


@dataclass(slots=True)
class Plan:
    """Let the policy decide whether there is another attempt."""

    ending: fx.Ending


@dataclass(slots=True)
class Pause:
    """Wait before the next attempt."""

    seconds: float


@dataclass(slots=True)
class StopRetrying:
    """Stop asking the policy; end the pause, or the wait for a server or for the goal's turn."""


@dataclass(slots=True)
class AwaitEarlier:
    """Wait for earlier goals, up to the time for a cancellation after the caller gave up."""


@dataclass(slots=True)
class StopAwaiting:
    """Stop waiting for earlier goals."""


@dataclass(slots=True)
class Finish:
    """Give the ending to the caller. Happens once."""

    ending: fx.Ending


Effect: TypeAlias = (
    fx.Record
    | AwaitServer
    | Queue
    | Send
    | Judge
    | CutJudging
    | Count
    | Plan
    | Pause
    | StopRetrying
    | AwaitEarlier
    | StopAwaiting
    | Finish
)
