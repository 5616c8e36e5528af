"""What the state machine of a goal asks its driver to do, and how a goal can end.

Nobody changes these objects once they are made. They are not frozen all the same: a frozen one
takes twice as long to make, and a call makes two dozen.
"""

from __future__ import annotations

import uuid
from dataclasses import dataclass
from enum import Enum, IntEnum, auto
from typing import Any, TypeAlias

from actionkit._model.values import CancelReport, GoalFate, GoalReport, GoalState, Verdict


class Timer(IntEnum):
    """The timers of one goal; arming one that is armed moves it."""

    ACCEPT = auto()
    DEADLINE = auto()
    STALL = auto()
    CANCEL = auto()
    """The end of the wait for a cancellation to be confirmed."""
    REASK = auto()
    """Time to ask again for what may have been lost on the way."""
    RESULT = auto()
    """The end of the wait for the result of a goal that has ended, in a call without deadline."""


class LastNews(Enum):
    """What is known about a goal now."""

    NOTHING = auto()
    """It may be running, or may start to run."""
    UNKNOWN_TO_SERVER = auto()
    """The server that it was sent to does not know it, but may still accept it (R6)."""
    SERVER_GONE = auto()
    """The server that had it is out of sight."""
    STOPPED = auto()
    """It does not run, and never will again."""


class End(Enum):
    """The ways in which an attempt can end: success, and one for nearly each error class."""

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
    REJECTED_BY_CLASSIFIER = auto()
    """The goal succeeded, and `classify=` says that this is a failure."""
    CLASSIFIER_FAILED = auto()
    """`classify=` gave no valid answer, so the call is not a success (C3.3)."""


@dataclass(slots=True)
class Fault:
    """What a function of the user's did instead of giving a proper answer.

    Attributes:
        problem: A clause for the error's text: "`classify=judge` raised ValueError: no".
        cause: What the function raised, or the error of the goal that it called a success.
        impossible: Whether it called a goal a success that cannot be one.
        asked: Whether the function was called; else it is not to blame.
    """

    problem: str
    cause: BaseException | None = None
    impossible: bool = False
    asked: bool = True


@dataclass(slots=True)
class Ending:
    """How an attempt, or the whole call, ended: facts only. `explain` makes an error of them.

    Attributes:
        end: The way it ended.
        status: The last known state of the goal.
        result: The result message, where the server sent one.
        phase: What was being waited for when the deadline passed, else `""`.
        rejected: Whether every server that the goal was sent to has rejected it.
        news: What is known about it now.
        given_up: Whether the caller gave up on the goal before it ended.
        ended_as: The terminal state in which a server showed the goal, with or without a result.
            `None` where another server may run it.
        elsewhere: Whether one server has said that it does not run it, and another may.
        ended_first: Whether it did so before the caller gave up on the goal.
        abandoned: Whether it was left to run on purpose.
        refused: Whether the server refused to cancel the goal, and the attempt ended because of it.
        goals: What is known of the goals of the same call (C2.8).
        served: The types with which the name is served, where none is the client's.
        error: The exception that ended it: what is wrong with the goal, or what broke this side.
        lost_because: Why its server counts as lost, why its result cannot be had, why nobody waited
            for its cancellation, or what was shut down, so that the call ended as by closing.
        verdict: What `classify=` says of a goal that succeeded.
        not_retried: Why it was not tried again, where it might have been.
        classifier_fault: How `classify=` failed to judge it.
        strategy_fault: How a strategy of the `RetryPolicy` failed to say whether to try again.
    """

    end: End
    status: GoalState
    result: Any = None
    phase: str = ""
    rejected: bool = False
    news: LastNews = LastNews.STOPPED
    given_up: bool = False
    ended_as: GoalState | None = None
    elsewhere: bool = False
    ended_first: bool = False
    abandoned: bool = False
    refused: bool = False
    goals: tuple[GoalReport, ...] = ()
    served: tuple[str, ...] = ()
    error: BaseException | None = None
    lost_because: str = ""
    verdict: Verdict | None = None
    not_retried: str = ""
    classifier_fault: Fault | None = None
    strategy_fault: Fault | None = None

    @property
    def may_run(self) -> tuple[uuid.UUID, ...]:
        """The ids of those goals that may be running, oldest first."""
        return tuple(goal.goal_id for goal in self.goals if goal.fate.may_run)

    @property
    def cancel(self) -> CancelReport | None:
        """What happened to the goals of the call that may run, or that its caller gave up on."""
        if self.may_run:  # the worst counts (C2.8)
            running = (goal for goal in self.goals if goal.fate is GoalFate.RUNNING)
            refused = self.refused or any(goal.cancel_refused for goal in running)
            return CancelReport.REFUSED if refused else CancelReport.UNKNOWN
        return self.own_cancel

    @property
    def own_cancel(self) -> CancelReport | None:
        """What happened to the goal that this is about, if its caller gave up on it."""
        if not self.given_up:
            return CancelReport.REFUSED if self.refused else None
        if self.ended_as is not None:
            return CancelReport.CONFIRMED
        if self.news is LastNews.STOPPED:
            return CancelReport.NOT_NEEDED
        return CancelReport.REFUSED if self.refused else CancelReport.UNKNOWN


@dataclass(slots=True)
class AskResult:
    """Ask the server for the goal's result; harmless to repeat (R3).

    Attributes:
        anew: Whether more is known than when this was asked before. Then, if a server answers the
            earlier request that it does not know the goal, this no longer counts.
    """

    anew: bool = False


@dataclass(slots=True)
class AskCancel:
    """Ask the server to cancel the goal; repeat it until the server answers that it knows it."""


@dataclass(slots=True)
class StopCancel:
    """Do not ask for the goal's cancellation until it is asked for again."""


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
    """Write into the goal's timeline that it is in a state, or that its cancel was refused."""

    state: GoalState
    detail: str = ""
    cancel_refused: bool = False


@dataclass(slots=True)
class RunsElsewhere:
    """Warn that another server goes on with the goal, which is over for its caller."""


@dataclass(slots=True)
class Settle:
    """Give the attempt's ending to the caller. Comes exactly once.

    Disarms all timers but REASK, as they exist for the caller's sake; a goal that its caller gave
    up on is asked about after that, too.
    """

    ending: Ending


@dataclass(slots=True)
class LateResult:
    """Report how the goal ended, or that it was rejected, after the attempt was settled."""

    state: GoalState
    result: Any


@dataclass(slots=True)
class Release:
    """Forget the goal, with its timers: nothing more can come that matters."""


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
