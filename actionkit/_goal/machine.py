"""The life of one goal as a pure state machine: no threads, no clock, no rclpy.

Each method is something that happened, with the time at which it did; it returns what is to
be done about it. The caller's view of a goal (`settled`) and the goal's life on the server
(`stage`) are two things: a goal that its caller gave up on is watched, and cancelled as soon
as that is possible, until it is known to run no more (contract C2.4).
"""

from __future__ import annotations

import math
from typing import Any

from actionkit._goal.effects import (
    Arm,
    AskCancel,
    AskResult,
    AwaitServer,
    Disarm,
    Effect,
    End,
    Ending,
    Known,
    LateResult,
    Reached,
    Record,
    Release,
    SendGoal,
    Settle,
    Timer,
    WatchStatus,
    Withdraw,
)
from actionkit._goal.stages import (
    DOUBT,
    FIRST_NUDGE,
    GAVE_UP_END,
    MAX_NUDGE,
    MAX_RESULT_NUDGE,
    NOBODY_WAITS,
    PHASE,
    RANK,
    RARELY,
    WAITED_FOR,
    WITH_END,
    GaveUp,
    Stage,
)
from actionkit._model.cancel_answer import CancelAnswer
from actionkit._model.settings import LONGEST_GRACE, Timeouts
from actionkit._model.values import CancelReport, GoalState

_QUIET = tuple(Disarm(timer) for timer in Timer if timer is not Timer.NUDGE)


class Goal:
    """One goal: one attempt of a call."""

    def __init__(self, timeouts: Timeouts, deadline: float | None, *, resent: bool = False) -> None:
        """Make a goal that nothing has happened to.

        Args:
            timeouts: The caps on its phases.
            deadline: Monotonic time at which the whole call's time is up, or `None`.
            resent: Whether the same server was sent the same goal id before. Then its "no" may
                just mean that it has the goal already (R5).
        """
        self._resent = resent
        self._denied = False
        self._was_accepted = False
        self._unknown_to_server = False
        self.stage = Stage.NEW
        self.state = GoalState.SENDING
        self.settled = False
        self.gave_up: GaveUp | None = None
        self._timeouts = timeouts
        self._deadline = deadline
        self._phase = ""
        self._report = CancelReport.UNKNOWN
        self._gave_up_at = 0.0
        self._cancel_accepted = False
        self._refusals = 0  # since we gave it up last, or since the server last cancelled it
        self._refused_at = 0.0  # when it was the first of them
        self._forgiven: GaveUp | None = None  # a giving up that the server refused to follow
        self._was_sent = resent
        self.abandoned = False
        self._closing = False
        self._broke = False
        self._nudge_after = FIRST_NUDGE
        self._told: GoalState | None = None  # a terminal state that came without the result
        self._missed_at: float | None = None  # when its server first did not know it any more

    @property
    def in_flight(self) -> bool:
        """Whether the server may be running the goal."""
        return self.stage in (Stage.SENT, Stage.ACCEPTED, Stage.LOST) or self._unproven

    @property
    def may_run(self) -> bool:
        """Whether a server in sight may be running it, as far as that has not denied it."""
        denied = self.stage is Stage.SENT and self._unknown_to_server
        return self.in_flight and self.stage is not Stage.LOST and not denied

    @property
    def _unproven(self) -> bool:
        """Whether the goal may be on a server that has not shown that it took it."""
        if self.stage in (Stage.SENT, Stage.LOST):
            return True
        return self._resent and self.stage in (Stage.AWAITING_SERVER, Stage.QUEUED)

    @property
    def _unwanted(self) -> bool:
        return self.settled or self.gave_up is not None

    # --- before the goal is sent -----------------------------------------------------------

    def start(self, now: float) -> list[Effect]:
        """The caller wants the goal done."""
        if self.stage is not Stage.NEW:
            return []
        self.stage = Stage.AWAITING_SERVER
        effects: list[Effect] = [Record(GoalState.SENDING)]
        if self._deadline is not None:
            if self._deadline <= now:
                return effects + self._give_up(GaveUp.DEADLINE, now)
            effects.append(Arm(Timer.DEADLINE, self._deadline))
        return effects + self._await_server(now)

    def _await_server(self, now: float) -> list[Effect]:
        effects: list[Effect] = []
        if self._timeouts.server is not None:
            effects.append(Arm(Timer.SERVER, now + self._timeouts.server))
        return [*effects, AwaitServer()]

    def server_ready(self, now: float) -> list[Effect]:
        """A server can be talked to (again)."""
        if self.stage is Stage.AWAITING_SERVER:
            self.stage = Stage.QUEUED
            return [Disarm(Timer.SERVER), SendGoal()]
        if self.stage is Stage.LOST:
            return self._ask_about_lost(now)
        # A new server on the name, or the same one restarted: one that does not know the goal
        # says so (R1).
        return [AskResult()] if self.stage is Stage.ACCEPTED else []

    def server_back(self, now: float) -> list[Effect]:
        """The very server that the goal was sent to can be talked to (again)."""
        if self.stage is not Stage.LOST:
            return self.server_ready(now)
        if not self._was_accepted:
            # It may take the goal yet (R6): that it does not know it so far means nothing.
            self.stage = Stage.SENT
        return self._ask_about_lost(now)

    def _ask_about_lost(self, now: float) -> list[Effect]:
        self._nudge_after = FIRST_NUDGE
        return [AskCancel(), AskResult(), self._arm_nudge(now)]

    def type_mismatch(self, served: tuple[str, ...], now: float) -> list[Effect]:
        """The name is served with other types only."""
        if self.stage is not Stage.AWAITING_SERVER:
            return []
        return self._never_sent(End.TYPE_MISMATCH, now, served)

    def sent(self, now: float) -> list[Effect]:
        """The goal request was handed to the middleware."""
        if self.stage is not Stage.QUEUED:
            return []
        self.stage = Stage.SENT
        self._was_sent = True
        effects: list[Effect] = [self._enter(GoalState.SENT)]
        if self._timeouts.accept is not None:
            effects.append(Arm(Timer.ACCEPT, now + self._timeouts.accept))
        return [*effects, self._arm_nudge(now)]

    def send_failed(self, error: Exception, now: float) -> list[Effect]:
        """The middleware would not take the goal request."""
        if self.stage is not Stage.QUEUED:
            return []
        return self._never_sent(End.INVALID, now, error)

    # --- what the server says --------------------------------------------------------------

    def accepted(self, now: float) -> list[Effect]:
        """The server has the goal: it said so, or sent something that proves it."""
        if self._resent and self.stage in (Stage.AWAITING_SERVER, Stage.QUEUED):
            # The first request was answered after all: nothing has to be sent again.
            self.stage = Stage.SENT
            self._was_sent = True
            return [Withdraw(), Disarm(Timer.SERVER), *self.accepted(now)]
        if self.stage in (Stage.ACCEPTED, Stage.NEW, Stage.AWAITING_SERVER, Stage.QUEUED):
            return []
        if self.stage is Stage.OVER:
            # A second server on the name took what the first refused or finished (R14).
            return [AskCancel()]
        effects: list[Effect] = [Disarm(Timer.ACCEPT)]
        self._was_accepted = True
        self._unknown_to_server = False
        if self.stage is Stage.SENT:
            effects.append(self._enter(GoalState.ACCEPTED))
        self.stage = Stage.ACCEPTED
        # Asked for at once: a result may expire within milliseconds of the end (R25).
        effects.append(AskResult(anew=True))
        self._nudge_after = FIRST_NUDGE
        effects.append(self._arm_nudge(now))
        if self._unwanted:
            effects.append(AskCancel())
        return effects + self._arm_stall(now)

    def _arm_stall(self, now: float) -> list[Effect]:
        silence = self._timeouts.feedback
        if silence is None or self._unwanted or self.stage is not Stage.ACCEPTED:
            return []
        return [Arm(Timer.STALL, now + silence)]

    def rejected(self, now: float) -> list[Effect]:
        """The server refused to accept the goal."""
        if self.stage is not Stage.SENT:
            return []
        if self._resent and not self._denied:
            self._denied = True
            # What it said of the goal before says nothing about a duplicate.
            return [AskResult(anew=True), WatchStatus()]
        self.stage = Stage.OVER
        self._report = CancelReport.NOT_NEEDED
        effects: list[Effect] = [self._enter(GoalState.REJECTED)]
        if self.settled:
            effects.append(LateResult(GoalState.REJECTED, None))
        if self.gave_up in (None, GaveUp.UNANSWERED):
            return effects + self._settle(End.REJECTED) + self._release()
        if self.gave_up is GaveUp.CANCELLED:
            return effects + self._settle(End.CANCELLED_BY_CALLER) + self._release()
        return effects + self._settle_given_up() + self._release()

    def feedback(self, now: float) -> list[Effect]:
        """Feedback of this goal came. It proves acceptance, which it may overtake (R15)."""
        effects = self.accepted(now) if self._unproven else []
        if self.stage is not Stage.ACCEPTED:
            return effects
        if self.state is GoalState.ACCEPTED:
            effects.append(self._enter(GoalState.EXECUTING))
        return effects + self._arm_stall(now)

    def status(self, state: GoalState, now: float) -> list[Effect]:
        """The server's status topic shows the goal in `state`."""
        effects = self.accepted(now) if self._unproven else []
        if self.stage is not Stage.ACCEPTED:
            return effects
        if state.is_terminal:
            if self._told is None:
                # The result usually follows at once; where it does not, it is asked for.
                self._told = state
                self._refusals = 0
                self._nudge_after = FIRST_NUDGE / 2
                effects.append(self._arm_nudge(now))
                limit = self._timeouts.result
                if self._deadline is None and limit is not None and not self.settled:
                    effects.append(Arm(Timer.RESULT, now + limit))
            return effects
        if RANK[state] > RANK.get(self.state, 0):
            effects.append(self._enter(state))
        return effects

    def result(
        self, status: GoalState | None, result: Any, now: float, *, ours: bool = True
    ) -> list[Effect]:
        """The server answered the request for the result.

        Args:
            status: A terminal state, or `None` where the server does not know the goal.
            result: The result message; empty where there is no status.
            now: Monotonic seconds.
            ours: Whether a cancel of ours may be why it was cancelled (C4.4).
        """
        if not self.in_flight:
            return []
        if status is None:
            if self.stage is Stage.ACCEPTED:
                return self._missed(now)
            if self.stage is Stage.LOST:
                return self._over()
            # It may be taken yet (R6); but a server that has denied it has no more to say.
            return self.rejected(now) if self._denied else self._unknown_so_far()
        new = self._unproven and self.stage is not Stage.LOST
        effects = self.accepted(now) if new else []
        self.stage = Stage.OVER
        if self.gave_up is not None:
            self._report = CancelReport.CONFIRMED
        effects.append(self._enter(status))
        end = {
            GoalState.SUCCEEDED: End.SUCCEEDED,
            GoalState.ABORTED: End.ABORTED,
        }.get(status, End.CANCELED_BY_OTHER)
        late = None
        if self.gave_up is GaveUp.CANCELLED and status is GoalState.CANCELED:
            end = End.CANCELLED_BY_CALLER
        elif self.gave_up is GaveUp.DEADLINE or (
            self.gave_up is not None and status is GoalState.CANCELED and ours
        ):
            end = GAVE_UP_END[self.gave_up]
            late = result if status is GoalState.SUCCEEDED else None
        if self.settled:
            effects.append(LateResult(status, result))
        kept = late if end is End.DEADLINE else result
        return effects + self._settle(end, result=kept) + self._release()

    def cancel_answered(self, answer: CancelAnswer, now: float) -> list[Effect]:
        """The server answered a cancel request for this goal."""
        if not self.in_flight:
            return []
        if answer is CancelAnswer.UNKNOWN_GOAL:
            if self.stage is Stage.SENT:
                return self._unknown_so_far()
            if self.stage is Stage.LOST:
                return self._over()
            return [AskResult()]
        effects = self.accepted(now) if self._unproven else []
        if answer is CancelAnswer.ACCEPTED:
            self._cancel_accepted = True
            self._refusals = 0
            if self.state is not GoalState.CANCELING:
                effects.append(self._enter(GoalState.CANCELING))
            effects += self._refusal_overtaken(now)
        elif answer is CancelAnswer.TERMINATED:
            # Also the answer for a goal that is being cancelled already: it confirms nothing.
            self._refusals = 0
            effects.append(AskResult())
        elif self._may_be_refused:
            effects += self._was_refused(now)
        return effects

    def _unknown_so_far(self) -> list[Effect]:
        """A live server does not know a goal that it was sent; it may yet (R6)."""
        self._unknown_to_server = True
        if self.gave_up is GaveUp.UNANSWERED and not self.settled:
            return self._settle_given_up()  # nothing more is to be learnt by waiting
        return []

    def _refusal_overtaken(self, now: float) -> list[Effect]:
        """A request that was repeated, or another server, made the goal stop after all."""
        if self._forgiven is None or self.settled or self.gave_up is not None:
            return []
        self.gave_up, self._forgiven = self._forgiven, None
        self._gave_up_at = now
        return [Disarm(Timer.STALL), Arm(Timer.CANCEL, now + self._timeouts.cancel)]

    @property
    def _may_be_refused(self) -> bool:
        """Whether a refusal matters: nobody wants the goal, and it neither ends nor has ended."""
        return self._unwanted and not self._cancel_accepted and self._told is None

    def _was_refused(self, now: float) -> list[Effect]:
        """The server will not cancel the goal, or it has just ended, or is being accepted (R12).

        rclpy's servers answer all three in the same words. So it is asked again after a moment.
        """
        if self._refusals == 0:
            self._refusals = 1
            self._refused_at = now
            self._nudge_after = DOUBT
            return [WatchStatus(), self._arm_nudge(now)]
        if now < self._refused_at + DOUBT:
            return []  # to what was asked before
        self._refusals += 1
        return self._runs_on(now)

    def _runs_on(self, now: float) -> list[Effect]:
        """A refusal is believed. What it means depends on who is left to wait for the goal."""
        if self.settled or self.gave_up not in (GaveUp.CANCELLED, GaveUp.UNANSWERED):
            return []  # a success in the time that is left is not thrown away (C2.3)
        if self._deadline is not None and now >= self._deadline:
            self.gave_up = GaveUp.DEADLINE
            self._phase = self._phase or "execute"
            return []
        if self._closing:
            self.gave_up = GaveUp.CLOSED  # nobody is left to wait for it
            return []
        # The goal runs on whatever the caller wants, so it stays his to wait for.
        self._forgiven, self.gave_up = self.gave_up, None
        return [
            Disarm(Timer.CANCEL),
            Record(self.state, "the server refused to cancel; the goal runs on"),
            *self._arm_stall(now),
        ]

    # --- what the server does not say ------------------------------------------------------

    def server_lost(self, reason: str, now: float) -> list[Effect]:
        """The server that had the goal is gone, or another has taken its place."""
        withdrawn: list[Effect] = []
        if self._resent and self.stage in (Stage.AWAITING_SERVER, Stage.QUEUED):
            # The id was meant for that server alone (R5).
            withdrawn = [Withdraw(), Disarm(Timer.SERVER)]
            self.stage = Stage.SENT
        if self.stage is Stage.QUEUED:
            self.stage = Stage.AWAITING_SERVER
            return [Withdraw(), *self._await_server(now)]
        if self.stage not in (Stage.SENT, Stage.ACCEPTED):
            return []
        if self._told is not None:
            return self._result_lost(now, "its server went away before it had sent it")
        self.stage = Stage.LOST
        self._refusals = 0  # it may have ended with its server
        effects: list[Effect] = [*withdrawn, Disarm(Timer.NUDGE)]
        if self.settled:
            return effects
        effects.append(self._enter(GoalState.LOST, reason))
        if self.gave_up in (None, GaveUp.CANCELLED, GaveUp.UNANSWERED, GaveUp.STALLED):
            return effects + self._settle(End.LOST, info=reason)
        return effects + self._settle_given_up()

    def _result_lost(self, now: float, why: str) -> list[Effect]:
        """A goal that was accepted is unknown to the server, or ended without a result."""
        if self.stage is Stage.LOST:
            return self._over()
        self.stage = Stage.OVER
        self._report = CancelReport.NOT_NEEDED
        effects: list[Effect] = [self._enter(GoalState.LOST, "the result cannot be had")]
        if self.gave_up in (GaveUp.DEADLINE, GaveUp.CLOSED):
            return effects + self._settle_given_up() + self._release()
        return effects + self._settle(End.RESULT_LOST, info=self._told, why=why) + self._release()

    def _missed(self, now: float) -> list[Effect]:
        """The server does not know a goal that it has accepted: believed when it says so again.

        While one thread of an rclpy server accepts a goal, another answers as if there were none.
        """
        if self._missed_at is None:
            self._missed_at = now
            self._nudge_after = DOUBT
            return [self._arm_nudge(now)]
        if now < self._missed_at + DOUBT:
            return []  # to what was asked before
        return self._result_lost(now, "its server no longer knows the goal")

    def timer(
        self, timer: Timer, now: float, *, others_confirmed_at: float = -math.inf
    ) -> list[Effect]:
        """A timer fired.

        Args:
            timer: Which.
            now: Monotonic seconds.
            others_confirmed_at: When a server last answered to the cancellation of any goal.
        """
        if timer is Timer.NUDGE:
            return self._nudge(now)
        if self.settled:
            return []
        if timer is Timer.SERVER and self.stage is Stage.AWAITING_SERVER:
            return self._never_sent(End.NO_SERVER, now)
        if timer is Timer.DEADLINE and self.gave_up is None:
            return self._give_up(GaveUp.DEADLINE, now)
        if timer is Timer.ACCEPT and self.stage is Stage.SENT and self.gave_up is None:
            return self._give_up(GaveUp.UNANSWERED, now)
        if timer is Timer.STALL and self.stage is Stage.ACCEPTED and self.gave_up is None:
            return self._give_up(GaveUp.STALLED, now)
        if timer is Timer.RESULT and self._told is not None:
            return self._result_lost(now, f"it did not come within {self._timeouts.result:g} s")
        if timer is Timer.CANCEL and self.gave_up is not None:
            return self._end_grace(now, others_confirmed_at)
        return []

    def _end_grace(self, now: float, others_confirmed_at: float) -> list[Effect]:
        """The time to confirm a cancellation is up, unless the server is still at others."""
        later = min(
            others_confirmed_at + self._timeouts.cancel,
            self._gave_up_at + self._timeouts.cancel + LONGEST_GRACE,
            math.inf if self._deadline is None else self._deadline + self._timeouts.cancel,
        )
        asked = self._unknown_to_server  # it had its turn, and would gain nothing by waiting
        if later > now and self.gave_up is not GaveUp.DEADLINE and not asked:
            return [Arm(Timer.CANCEL, later)]
        effects = self._runs_on(now) if self._refusals else []
        if self.gave_up is None:
            return effects
        if self.gave_up is GaveUp.CANCELLED:
            if self._told is GoalState.CANCELED:
                return effects + self._settle(End.CANCELLED_BY_CALLER)
            self._phase = "cancel"
        return effects + self._settle_given_up()

    def _nudge(self, now: float) -> list[Effect]:
        """Ask again for what may have been lost in a queue on the way (R3, R4)."""
        if not self.in_flight:
            return []
        if self._told is not None and self.settled and self._nudge_after >= NOBODY_WAITS:
            return self._over()
        effects: list[Effect] = [WatchStatus()]
        if self._refusals == 1 and self._unwanted:
            effects.append(AskCancel())
        missed = self._missed_at is not None
        if missed or self._told or self.stage is not Stage.ACCEPTED or self._nudge_after >= RARELY:
            # A goal that merely takes long is seen in the status topic, and not asked about.
            effects.append(AskResult())
        longest = MAX_NUDGE if self._told is None else MAX_RESULT_NUDGE
        self._nudge_after = min(self._nudge_after * 2, longest)
        return [*effects, self._arm_nudge(now)]

    def _arm_nudge(self, now: float) -> Effect:
        return Arm(Timer.NUDGE, now + self._nudge_after)

    # --- what the caller wants -------------------------------------------------------------

    def cancel(self, now: float) -> list[Effect]:
        """The caller cancels."""
        if self.settled or self.gave_up is not None:
            return []
        return self._give_up(GaveUp.CANCELLED, now)

    def close(self, now: float, *, abandon: bool) -> list[Effect]:
        """The client is closing. With `abandon` the goal is left to run, as the user said."""
        self._closing = True
        if self.settled or self.gave_up is not None:
            return []
        if abandon and self.in_flight:
            self.stage = Stage.OVER
            self.abandoned = True
            return self._settle(End.CLOSED, cancel=CancelReport.UNKNOWN) + self._release()
        return self._give_up(GaveUp.CLOSED, now)

    def fail(self, reason: str, error: BaseException, now: float) -> list[Effect]:
        """This side broke: nothing more can be learnt of the goal."""
        if self.settled:
            return []
        self.stage = Stage.OVER
        self._broke = True
        effects: list[Effect] = [self._enter(GoalState.LOST, reason)]
        return effects + self._settle(End.LOST, info=error) + self._release()

    def _give_up(self, why: GaveUp, now: float) -> list[Effect]:
        self._phase = PHASE[self.stage]
        self.gave_up, self._gave_up_at = why, now
        effects: list[Effect] = []
        if self._resent and self.stage in (Stage.AWAITING_SERVER, Stage.QUEUED):
            self.stage = Stage.SENT  # once is enough: from here on it is to be stopped
            effects = [Withdraw(), Disarm(Timer.SERVER)]
        if not self.in_flight:
            end = End.CANCELLED_BY_CALLER if why is GaveUp.CANCELLED else GAVE_UP_END[why]
            effects = self._never_sent(end, now)
            if why is GaveUp.DEADLINE:
                effects.insert(0, Record(GoalState.TIMED_OUT, f"waiting for {self._phase}"))
            return effects
        if why not in (GaveUp.CANCELLED, GaveUp.CLOSED):
            effects.append(Record(GoalState.TIMED_OUT, f"waiting for {WAITED_FOR[why]}"))
        self._refusals = 0
        self._unknown_to_server = False  # what counts is what the server says from now on
        self._nudge_after = FIRST_NUDGE / 2
        return [
            *effects,
            Disarm(Timer.STALL),
            AskCancel(),
            Arm(Timer.CANCEL, now + self._timeouts.cancel),
            self._arm_nudge(now),
        ]

    # --- endings ---------------------------------------------------------------------------

    def _enter(self, state: GoalState, detail: str = "") -> Effect:
        self.state = state
        return Record(state, detail)

    def _never_sent(self, end: End, now: float, info: Any = None) -> list[Effect]:
        if self._resent:
            # Not this time; but the first request may have arrived, and is watched (C2.4).
            self.stage = Stage.SENT
            nudge = self._arm_nudge(now)
            return [Withdraw(), AskCancel(), *self._settle(end, info=info), nudge]
        self.stage = Stage.OVER
        self._report = CancelReport.NOT_NEEDED
        return [Withdraw(), *self._settle(end, info=info), *self._release()]

    def _settle_given_up(self) -> list[Effect]:
        assert self.gave_up is not None
        return self._settle(GAVE_UP_END[self.gave_up])

    def _settle(
        self,
        end: End,
        *,
        result: Any = None,
        cancel: CancelReport | None = None,
        info: Any = None,
        why: str = "",
    ) -> list[Effect]:
        if self.settled:
            return []
        self.settled = True
        if self.gave_up is not None:
            cancel = CancelReport.CONFIRMED if self._told is not None else self._report
            if self._refusals and cancel is CancelReport.UNKNOWN and end is not End.LOST:
                cancel = CancelReport.REFUSED
        elif self._forgiven is not None and end in WITH_END:
            cancel = CancelReport.REFUSED  # which is why it came to this end
        timed_out = end in (End.DEADLINE, End.NO_ACCEPTANCE, End.STALLED)
        unended = timed_out and not self.state.is_terminal
        return [
            *_QUIET,
            Settle(
                Ending(
                    end=end,
                    status=GoalState.TIMED_OUT if unended else self.state,
                    result=result,
                    cancel=cancel,
                    phase=self._phase if end is End.DEADLINE else "",
                    reached=self._reached,
                    known=self._known,
                    info=info,
                    why=why,
                )
            ),
        ]

    @property
    def _reached(self) -> Reached:
        if self._was_accepted:
            return Reached.ACCEPTED
        if self.state is GoalState.REJECTED:
            return Reached.REJECTED
        return Reached.UNANSWERED if self._was_sent else Reached.NEVER_SENT

    @property
    def _known(self) -> Known:
        over = self.stage is Stage.OVER and not self.abandoned and not self._broke
        if over or self._told is not None:
            return Known.STOPPED
        if self.stage is Stage.LOST:
            return Known.SERVER_GONE
        return Known.UNKNOWN_TO_SERVER if self._unknown_to_server else Known.NOTHING

    def supersede(self) -> list[Effect]:
        """Another attempt takes over the goal, with its id (contract C4.2)."""
        self.stage = Stage.OVER
        return [Disarm(timer) for timer in Timer]

    def _over(self) -> list[Effect]:
        self.stage = Stage.OVER
        return self._release()

    def _release(self) -> list[Effect]:
        return [Disarm(Timer.NUDGE), Release()]
