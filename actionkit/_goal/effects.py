"""What the state machine of a goal asks its driver to do, and how a goal can end.

Nobody changes these once they are made. They are not frozen all the same: to make a frozen one
takes twice as long, and a call makes two dozen.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum, auto
from typing import Any, TypeAlias

from actionkit._model.values import CancelReport, GoalState


class Timer(IntEnum):
    """The timers of one goal; arming one that is armed moves it."""

    SERVER = auto()
    ACCEPT = auto()
    DEADLINE = auto()
    STALL = auto()
    CANCEL = auto()
    """The end of the wait for a cancellation to be confirmed."""
    NUDGE = auto()
    """Time to ask again what may have been lost on the way."""
    RESULT = auto()
    """The end of the wait for the result of a goal that has ended, in a call without deadline."""


class Reached(Enum):
    """How far the earlier goal got, as far as this side knows."""

    NEVER_SENT = auto()
    UNANSWERED = auto()
    """Sent, and neither accepted nor rejected."""
    REJECTED = auto()
    ACCEPTED = auto()


class Known(Enum):
    """What is known of the earlier goal's present."""

    NOTHING = auto()
    """It may be running, or come to run."""
    UNKNOWN_TO_SERVER = auto()
    """A live server of the same incarnation does not know it, and may take it yet (R6)."""
    SERVER_GONE = auto()
    """The server that had it is out of sight."""
    STOPPED = auto()
    """It runs no more, and never will."""


class End(Enum):
    """The ways in which an attempt can end, one for each error class, and success."""

    SUCCEEDED = auto()
    NO_SERVER = auto()
    TYPE_MISMATCH = auto()
    INVALID = auto()
    NO_ACCEPTANCE = auto()
    REJECTED = auto()
    ABORTED = auto()
    CANCELED_BY_OTHER = auto()
    CANCELLED_BY_CALLER = auto()
    LOST = auto()
    RESULT_LOST = auto()
    STALLED = auto()
    DEADLINE = auto()
    CLOSED = auto()
    JUDGED = auto()
    """The goal succeeded, and `classify=` says that it did not."""
    UNJUDGED = auto()
    """`classify=` gave no answer that can count, so the call is no success (C3.3)."""


@dataclass(slots=True)
class Fault:
    """What a function of the user's did in place of giving a proper answer.

    Attributes:
        problem: A clause for the error's text: "`classify=judge` raised ValueError: no".
        cause: What the function raised, or the error of the goal that it called a success.
        impossible: Whether it called a goal a success that cannot be one.
    """

    problem: str
    cause: BaseException | None = None
    impossible: bool = False


@dataclass(slots=True)
class Ending:
    """How an attempt ended.

    Attributes:
        end: The way it ended.
        status: The last known state of the goal.
        result: The result message, where the server sent one.
        cancel: What became of a goal that was given up on, else `None`.
        phase: What was being waited for when the deadline passed, else `""`.
        reached: How far the goal got.
        known: What is known of its present.
        info: Facts for the error's text: exceptions, type names, reasons.
        note: Why it was not tried again, where it might have been.
        why: Why the result cannot be had any more, where it was lost.
        judge: How `classify=` failed to judge it, if it did.
        strategy: How a strategy of the `RetryPolicy` failed to say whether to try again, if it did.
    """

    end: End
    status: GoalState
    result: Any = None
    cancel: CancelReport | None = None
    phase: str = ""
    reached: Reached = Reached.NEVER_SENT
    known: Known = Known.STOPPED
    info: Any = None
    note: str = ""
    judge: Fault | None = None
    strategy: Fault | None = None
    why: str = ""


@dataclass(slots=True)
class AwaitServer:
    """Tell when a server is ready, or serves another type."""


@dataclass(slots=True)
class SendGoal:
    """Put the goal request in the queue to the server, and tell when it was sent."""


@dataclass(slots=True)
class Withdraw:
    """Stop waiting for a server; take the goal request out of the queue."""


@dataclass(slots=True)
class AskResult:
    """Ask the server for the goal's result; harmless to repeat (R3).

    Attributes:
        anew: Whether more is known than when it was asked before: that the server did not know
            the goal then does not count any more.
    """

    anew: bool = False


@dataclass(slots=True)
class AskCancel:
    """Ask the server to cancel the goal, and again until it has answered that it knows it."""


@dataclass(slots=True)
class WatchStatus:
    """Tell what the server's status topic says of this goal, from now on."""


@dataclass(slots=True)
class Arm:
    """Fire `timer` at the monotonic time `at`."""

    timer: Timer
    at: float


@dataclass(slots=True)
class Disarm:
    """Do not fire `timer`."""

    timer: Timer


@dataclass(slots=True)
class Record:
    """Write a transition into the goal's timeline."""

    state: GoalState
    detail: str = ""


@dataclass(slots=True)
class Settle:
    """Give the attempt's ending to the caller. Comes exactly once."""

    ending: Ending


@dataclass(slots=True)
class LateResult:
    """Tell how the goal ended, or that it was rejected, after the attempt was settled."""

    state: GoalState
    result: Any


@dataclass(slots=True)
class Release:
    """Nothing is left to watch for: forget the goal."""


Effect: TypeAlias = (
    AwaitServer
    | SendGoal
    | Withdraw
    | AskResult
    | AskCancel
    | WatchStatus
    | Arm
    | Disarm
    | Record
    | Settle
    | LateResult
    | Release
)
