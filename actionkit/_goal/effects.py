"""Defines what a goal's state machine asks its driver to do, and how a goal can end.

Nobody changes these objects after making them. They are not frozen, because making a frozen one
takes twice as long, and a call makes about 24.
"""

from __future__ import annotations

import uuid
from dataclasses import dataclass
from enum import Enum, IntEnum, auto
from typing import Any, TypeAlias

from actionkit._model.values import CancelReport, GoalFate, GoalReport, GoalState, Verdict


class Timer(IntEnum):
    """The timers of one goal; the deadline is the call's own. Arming an armed timer moves it."""

    ACCEPT = auto()
    STALL = auto()
    CANCEL = auto()
    """The end of the wait for the confirmation of a cancellation."""
    REASK = auto()
    """The time to repeat a request that may have been lost, or its answer."""
    RESULT = auto()
    """The end of the wait for the result of a goal that has ended, in a call without a deadline."""


class LastNews(Enum):
    """What is known about a goal now."""

    NOTHING = auto()
    """It may be running, or may start running."""
    UNKNOWN_TO_SERVER = auto()
    """The server that it was sent to does not know it, but may still accept it (R6)."""
    SERVER_GONE = auto()
    """It was lost: its server is gone, or seems so."""
    STOPPED = auto()
    """It does not run and never will."""


class End(Enum):
    """The ways in which an attempt can end: success, or one for nearly each class of error."""

    SUCCEEDED = auto()
    NO_SERVER = auto()
    TYPE_MISMATCH = auto()
    INVALID = auto()
    UNKNOWN = auto()
    """No server knows the goal that the call was attached to."""
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
    REPLACED = auto()
    """Its caller has sent another goal in its place, and its server has stopped it for that."""
    NOT_REPLACING = auto()
    """The goal that it was to replace may still run, so nothing was sent."""
    REJECTED_BY_CLASSIFIER = auto()
    """The goal succeeded, but `classify=` counts that as a failure."""
    CLASSIFIER_FAILED = auto()
    """`classify=` gave no valid answer, so the call is not a success (C3.3)."""


@dataclass(slots=True)
class Fault:
    """What a function of the user's did instead of giving a valid answer."""

    problem: str  # a clause for the error's text: "`classify=judge` raised ValueError: no"
    cause: BaseException | None = None  # raised by the function, or the error of the goal
    impossible: bool = False  # it called a goal a success that cannot be one
    asked: bool = True  # if the function was not called, it is not to blame


@dataclass(slots=True)
class Ending:
    """How an attempt, or the whole call, ended: facts only. `explain` makes an error of them."""

    end: End
    status: GoalState  # the last known state of the goal
    result: Any = None  # the message, if the server sent one
    phase: str = ""  # what the call was waiting for at its deadline
    rejected: bool = False  # by every server that the goal was sent to
    news: LastNews = LastNews.STOPPED
    given_up: bool = False  # the caller gave up on the goal before it ended
    ended_as: GoalState | None = None
    """The terminal state that a server reported, with or without a result; `None` if another server
    may run the goal."""
    elsewhere: bool = False  # one server does not run it, but another one may
    ended_first: bool = False  # it ended before the caller gave up on it
    abandoned: bool = False  # it was left running on purpose
    refused: bool = False  # the server refused to cancel it, and the attempt ended for that
    goals: tuple[GoalReport, ...] = ()  # of the same call (C2.8)
    earlier: tuple[GoalReport, ...] = ()  # of the call to replace: those that may run
    from_ledger: bool = False  # an earlier call with its key has succeeded
    served: tuple[str, ...] = ()  # the types of the name, if none is the client's
    error: BaseException | None = None  # what is wrong with the goal, or what broke our side
    lost_because: str = ""
    """Why its server counts as lost, why its result is not available, why nobody waited for its
    cancellation, or what was shut down, so that the call ended as by closing."""
    verdict: Verdict | None = None  # of `classify=` on a goal that succeeded
    not_retried: str = ""  # why the call did not try again, though it might have
    classifier_fault: Fault | None = None  # of `classify=`
    strategy_fault: Fault | None = None  # of a strategy of the `RetryPolicy`

    @property
    def may_run(self) -> tuple[uuid.UUID, ...]:
        """The ids of the goals that may be running, oldest first."""
        return tuple(goal.goal_id for goal in self.goals if goal.fate.may_run)

    @property
    def cancel(self) -> CancelReport | None:
        """What happened to the goals that may run, or that the caller gave up on."""
        if self.may_run:  # the worst counts (C2.8)
            running = (goal for goal in self.goals if goal.fate is GoalFate.RUNNING)
            refused = self.refused or any(goal.cancel_refused for goal in running)
            return CancelReport.REFUSED if refused else CancelReport.UNKNOWN
        return self.own_cancel

    @property
    def own_cancel(self) -> CancelReport | None:
        """What happened to this goal, if its caller gave up on it."""
        if not self.given_up:
            return CancelReport.REFUSED if self.refused else None
        if self.ended_as is not None:
            return CancelReport.CONFIRMED
        if self.news is LastNews.STOPPED:
            return CancelReport.NOT_NEEDED
        return CancelReport.REFUSED if self.refused else CancelReport.UNKNOWN


@dataclass(slots=True)
class AskResult:
    """Ask the server for the goal's result; may be repeated (R3)."""

    anew: bool = False
    """Whether more is known than at the last request. If so, the answer "unknown goal" to that
    request does not count any more."""


@dataclass(slots=True)
class AskCancel:
    """Ask the server to cancel the goal, until a server that knows it has answered."""


@dataclass(slots=True)
class StopCancel:
    """Stop asking for the cancellation until `AskCancel` comes again."""


@dataclass(slots=True)
class WatchStatus:
    """Report what the server's status topic shows about this goal, from now on."""


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
    """Write the goal's state, or the refusal of its cancel, into the timeline."""

    state: GoalState
    detail: str = ""
    cancel_refused: bool = False


@dataclass(slots=True)
class RunsElsewhere:
    """Warn that another server still runs the goal, which is over for its caller."""


@dataclass(slots=True)
class Settle:
    """Give the attempt's ending to the caller. Happens exactly once.

    It disarms all timers except REASK, because they serve the caller. If the caller gave up on the
    goal, requests about it go on.
    """

    ending: Ending


@dataclass(slots=True)
class LateResult:
    """Report how the goal ended, or that it was rejected, after the attempt was settled."""

    state: GoalState
    result: Any


@dataclass(slots=True)
class Release:
    """Forget the goal and its timers: no more news about it matters."""


Effect: TypeAlias = (
    AskResult
    | AskCancel
    | StopCancel
    | WatchStatus
    | Arm
    | Disarm
    | Record
    | RunsElsewhere
    | Settle
    | LateResult
    | Release
)
