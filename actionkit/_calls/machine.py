"""What a call decides, as a pure state machine: attempts, verdicts, pauses, and the end.

No threads, no clock, no rclpy. Each method is something that happened; it returns what is to be
done about it, in order. What one goal decides for itself is in `_goal.machine`.
"""

from __future__ import annotations

import uuid
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum, auto
from typing import Any, Protocol, TypeAlias

from actionkit._calls.call_view import GoalsOfCall
from actionkit._calls.classify import apply_verdict
from actionkit._calls.retry import GiveUp, RejectedByClassifier, Retry, after_no_server
from actionkit._goal import effects as fx
from actionkit._goal.machine import Goal
from actionkit._goal.stages import Stage
from actionkit._model.values import GoalState, Verdict


class Phase(Enum):
    """What a call is at."""

    NEW = auto()
    TRYING = auto()
    """An attempt is under way."""
    JUDGING = auto()
    """`classify=` is asked how the end of an attempt counts."""
    PLANNING = auto()
    """The policy is asked whether there is another attempt."""
    PAUSING = auto()
    CONFIRMING = auto()
    """It has ended, but a server may still confirm that its earlier goals do not run any more."""
    ENDED = auto()


class AttemptView(Protocol):
    """What is asked about an attempt."""

    goal_id: uuid.UUID
    goal: Goal

    @property
    def is_out_of_sight(self) -> bool: ...
    @property
    def cancel_is_ours(self) -> bool: ...
    def on_server_ready(self) -> None: ...


@dataclass(slots=True)
class Try:
    """Make and start another attempt."""


@dataclass(slots=True)
class Judge:
    """Ask how the end of an attempt counts."""

    ending: fx.Ending


@dataclass(slots=True)
class CutJudging:
    """Wait for the verdict only for the time of a cancellation, or not at all."""

    why: str
    at_once: bool


@dataclass(slots=True)
class Count:
    """Tell the retry budget of a success, or of a failure that was transient."""

    success: bool


@dataclass(slots=True)
class Plan:
    """Ask the policy whether there is another attempt."""

    ending: fx.Ending


@dataclass(slots=True)
class Pause:
    """Wait before the next attempt."""

    seconds: float


@dataclass(slots=True)
class StopRetrying:
    """Ask the policy no more, and end the pause."""


@dataclass(slots=True)
class Withdraw:
    """End an attempt that has sent nothing."""

    attempt: Any


@dataclass(slots=True)
class AwaitEarlier:
    """Wait for the earlier goals, for the time of a cancellation since the call was given up."""


@dataclass(slots=True)
class StopAwaiting:
    """Do not wait for the earlier goals any more."""


@dataclass(slots=True)
class Finish:
    """Give the ending to the caller. Comes once."""

    ending: fx.Ending


Effect: TypeAlias = (
    Try
    | Judge
    | CutJudging
    | Count
    | Plan
    | Pause
    | StopRetrying
    | Withdraw
    | AwaitEarlier
    | StopAwaiting
    | Finish
)
_GIVEN_UP = (fx.End.CANCELLED_BY_CALLER, fx.End.CLOSED)


class CallMachine:
    """One call: its attempts in turn, and the goals that may still run."""

    def __init__(
        self, resend: str, server_limit: float | None, new_id: Callable[[], uuid.UUID] = uuid.uuid4
    ) -> None:
        """Begin with nothing sent.

        Args:
            resend: `RetryPolicy.resend`.
            server_limit: `Timeouts.server`, for texts.
            new_id: Makes the id of a goal.
        """
        self.phase = Phase.NEW
        self.goals = GoalsOfCall()
        self.goal_id = new_id()  # that of the goal which is told of
        self.attempts = 0
        self.attempt: AttemptView | None = None
        # Earlier attempts: their goal may run, or their result may come. Not the one under way.
        self.earlier: list[AttemptView] = []
        self.ending: fx.Ending | None = None
        self.cause: BaseException = RejectedByClassifier()  # the last failure, for strategies
        self.unwanted = False  # set by the caller's thread, before it is told by `cancel`
        self.closing = ""  # why, as a clause
        self._resend = resend
        self._server_limit = server_limit
        self._new_id = new_id
        self.previous: AttemptView | None = None  # the last that sent its goal
        self._last: fx.Ending | None = None  # how that ended, as it was judged

    # --- may another goal be sent? ---------------------------------------------------------

    def may_send(self) -> bool:
        """Whether another goal may be sent now: the only place that decides it (C4.2)."""
        return all(self._allows_another(earlier) for earlier in self.earlier)

    def _allows_another(self, earlier: AttemptView) -> bool:
        if self._resend == "always":
            return True
        if not earlier.goal.facts.is_over:
            return self._resend == "server_gone" and earlier.is_out_of_sight
        # A goal that ended by itself is not run a second time while its result may come (C4.3).
        ended_as = earlier.goal.awaits_result_of
        return ended_as is None or (ended_as is GoalState.CANCELED and earlier.cancel_is_ours)

    @property
    def confirming(self) -> bool:
        """Whether a server in sight may yet confirm that an earlier goal runs no more."""
        return any(earlier.goal.may_run for earlier in self.earlier)

    # --- the caller's wishes ---------------------------------------------------------------

    def begin(self, invalid: Exception | None) -> list[Effect]:
        """The call begins; with `invalid`, its goal is not valid."""
        if self.phase is not Phase.NEW:
            return []
        if invalid is not None:
            return self._end(fx.Ending(fx.End.INVALID, GoalState.REJECTED, error=invalid))
        return self._try()

    def stop(self, end: fx.End, why: str) -> list[Effect]:
        """Its caller cancels or closes it, and no attempt is under way, to which that is told."""
        if self.phase is Phase.JUDGING:
            # Its goal ended, and is not tried again; the verdict is waited for like a cancel.
            return [CutJudging(why, at_once=False)]
        if self._last is None:
            return self._end(fx.Ending(end, GoalState.SENDING, given_up=True))
        # Nothing is cancelled now: what is told is the fate of the last goal, and no more.
        return self._end(fx.Ending(end, self._last.status, news=self._last.news, given_up=True))

    def end_grace(self, why: str) -> list[Effect]:
        """There is no more time for confirmations."""
        if self.phase is Phase.CONFIRMING:
            return [StopAwaiting(), *self._finish()]
        return [CutJudging(why, at_once=True)] if self.phase is Phase.JUDGING else []

    def broke(self, error: BaseException) -> list[Effect]:
        """This side broke, and no attempt is under way, to which that is told."""
        if self.phase in (Phase.CONFIRMING, Phase.JUDGING):
            return self.end_grace(self.closing)
        return self._end(fx.Ending(fx.End.LOST, GoalState.LOST, error=error))

    # --- what happens to attempts ----------------------------------------------------------

    def made(self, attempt: AttemptView) -> None:
        """The attempt that was asked for was made, and is about to start."""
        self.attempt = attempt
        self.goals.add(attempt.goal.facts)

    def ended(
        self, attempt: AttemptView, ending: fx.Ending, *, late: bool, ready: bool
    ) -> list[Effect]:
        """The attempt under way ended.

        Args:
            attempt: Which it is.
            ending: How it ended.
            late: Whether the call's deadline has passed.
            ready: Whether goals can be sent.
        """
        if attempt is not self.attempt or self.ending is not None:
            return []
        never_sent = ending.progress is fx.GoalProgress.NEVER_SENT
        if not never_sent or attempt.goal.stage is not Stage.OVER:
            self.previous = attempt
            # One that has ended by itself counts, too, until its result has come (C4.3).
            self.earlier = [
                each
                for each in (*self.earlier, attempt)
                if not each.goal.facts.is_over or each.goal.awaits_result_of
            ]
        self.attempt = None
        if ending.end is not fx.End.NO_SERVER:
            return self._judge(ending)
        # It found no server. If it had one before, it goes on with the ending from that one (C2.7).
        in_flight = bool(self.goals.may_run)
        if self.previous is not None and (in_flight or not late):
            self.goal_id = self.previous.goal_id
        ending = after_no_server(ending, self._last, self._server_limit, late, ready, in_flight)
        return self._end(ending) if late or self._last is None else self._plan(ending)

    def late_result(self, attempt: AttemptView, state: GoalState, result: Any) -> list[Effect]:
        """An earlier goal has proved to have finished: that is the call's end (C4.3, C4.4)."""
        canceled, current = state is GoalState.CANCELED, self.attempt
        if attempt not in self.earlier or self.phase is Phase.ENDED:
            return []
        if (canceled and attempt.cancel_is_ours) or (current and current.goal.in_flight):
            return []
        effects: list[Effect] = [StopRetrying()]
        if current is not None:
            self.attempt = None
            effects.append(Withdraw(current))
        if self.phase is Phase.CONFIRMING:
            self.ending = None
            effects.append(StopAwaiting())
        self.goal_id = attempt.goal_id
        rejected = state is GoalState.REJECTED
        progress = fx.GoalProgress.REJECTED if rejected else fx.GoalProgress.ACCEPTED
        end = fx.End.CANCELED_BY_OTHER if canceled else fx.End[state.name]
        return effects + self._judge(fx.Ending(end, state, result=result, progress=progress))

    def earlier_over(self) -> list[Effect]:
        """An earlier goal is known not to run any more, or its server went out of sight."""
        if self.phase is Phase.CONFIRMING and not self.confirming:
            return [StopAwaiting(), *self._finish()]
        return []

    # --- what follows from an end ----------------------------------------------------------

    def judged(
        self, ending: fx.Ending, error: BaseException | None, verdict: Verdict | fx.Fault
    ) -> list[Effect]:
        """It is known how the end of an attempt counts (C3.3)."""
        if self.ending is not None:
            return []  # cancelled or closed meanwhile
        effects: list[Effect] = [Count(success=True)] if verdict is Verdict.SUCCESS else []
        self._last = ending = apply_verdict(ending, verdict)
        # What somebody else cancelled is not tried again, even if `classify=` says so (C4.4).
        if verdict is not Verdict.TRANSIENT or ending.end is fx.End.CANCELED_BY_OTHER:
            return effects + self._end(ending)
        effects.append(Count(success=False))
        if self.unwanted or self.closing:
            return effects + self._end(replace(ending, not_retried="its caller no longer wants it"))
        self.cause = error or RejectedByClassifier()
        return effects + self._plan(ending)

    def planned(self, ending: fx.Ending, plan: Retry | GiveUp | fx.Fault) -> list[Effect]:
        """The policy has said whether there is another attempt."""
        if isinstance(plan, fx.Fault):
            return self._end(replace(ending, strategy_fault=plan))
        if isinstance(plan, GiveUp):
            waited = f"{ending.not_retried}, and " if ending.not_retried else ""
            return self._end(replace(ending, not_retried=waited + plan.reason))
        self.phase = Phase.PAUSING
        return [Pause(plan.seconds)]

    def resume(self) -> list[Effect]:
        """The pause is over."""
        return self._try()

    def _try(self) -> list[Effect]:
        if self.attempts:
            self.goal_id = self._new_id()
        self.attempts += 1
        self.phase = Phase.TRYING
        return [Try()]

    def _judge(self, ending: fx.Ending) -> list[Effect]:
        self.phase = Phase.JUDGING
        return [Judge(ending)]

    def _plan(self, ending: fx.Ending) -> list[Effect]:
        self.phase = Phase.PLANNING
        return [Plan(ending)]

    # --- the end ---------------------------------------------------------------------------

    def _end(self, ending: fx.Ending) -> list[Effect]:
        if self.ending is not None:
            return []
        if ending.end is fx.End.CLOSED:
            ending = replace(ending, lost_because=self.closing)
        self.ending = ending
        if ending.end in _GIVEN_UP and self.confirming:
            self.phase = Phase.CONFIRMING
            return [StopRetrying(), AwaitEarlier()]
        return [StopRetrying(), *self._finish()]

    def _finish(self) -> list[Effect]:
        """End with what is known by now of all goals (C2.8)."""
        ending = self.ending
        assert ending is not None
        waited = self.phase is Phase.CONFIRMING and self.confirming
        self.phase = Phase.ENDED
        ending = replace(ending, goals=self.goals.reports)
        # `CANCELLED_BY_CALLER` means that nothing runs.
        if ending.end is fx.End.CANCELLED_BY_CALLER and (may_run := ending.may_run):
            unconfirmed, late = fx.End.DEADLINE, GoalState.TIMED_OUT
            because = "" if waited else "its server is gone, or silent"
            ending = replace(
                ending,
                end=unconfirmed,
                status=late,
                phase="cancel",
                lost_because=because,
                result=None,  # only a late success is worth having
            )
            if self.goal_id not in may_run:
                self.goal_id = may_run[-1]
        self.ending = ending
        self.previous, self.earlier = None, []  # they hold the call while they are watched
        return [Finish(ending)]
