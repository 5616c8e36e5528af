"""Keeps what is known about one goal, and decides how its attempt ends."""

from __future__ import annotations

import math
import uuid
from typing import Any

from actionkit._goal import effects as fx
from actionkit._goal.facts import GoalFacts
from actionkit._goal.stages import (
    CONFIRMED_AFTER,
    FIRST_REASK,
    LATE_ACCEPTANCE,
    WITH_END,
    CancelReason,
    CancelReply,
    Stage,
)
from actionkit._model.settings import Timeouts
from actionkit._model.values import GoalState

_TIMED_OUT = {fx.End.DEADLINE, fx.End.NO_ACCEPTANCE, fx.End.STALLED}
_REFUSALS = {CancelReply.REFUSED_ONCE, CancelReply.REFUSED}


class GoalRecord:
    """The lowest layer of the state machine: the facts, and the endings that follow from them."""

    def __init__(self, goal_id: uuid.UUID, timeouts: Timeouts) -> None:
        """Make a goal that was just sent."""
        self.stage = Stage.SENT
        self.state = GoalState.SENDING
        self.settled = False
        self.cancel_reason: CancelReason | None = None
        self._final_reason: CancelReason | None = None  # the first one that is in `FINAL`
        self._cancelled_before = False  # an earlier call of the client had given up on it
        self.abandoned = False  # it was let run, as the user chose
        self._left_alone = False  # only an explicit cancel cancels it
        self.watched_early = False  # its status is read at once, because it may be sent again
        self._timeouts = timeouts
        self.facts = GoalFacts(goal_id)
        self._unknown_to_server = False
        self._denied_lately = False  # "unknown goal" was answered since the last request
        self._doubted_for = CONFIRMED_AFTER  # until no server knows a goal that none has shown
        self._forgotten_at: float | None = None  # when it first forgot a goal that it had
        self._terminal_seen: GoalState | None = None
        self._ended_first = False  # before the caller gave up
        self._reask_after = FIRST_REASK
        self.cancelled_at = 0.0
        self._latest = math.inf  # the end of the wait for its cancellation, after a deadline
        self._cancel_reply = CancelReply.NONE
        self._refusal_told = False
        self._refused_at = 0.0  # when it refused the first time
        self._refused_reason: CancelReason | None = None  # why we cancelled, until the refusal
        self._phase = ""  # what the call waited for, as in `DeadlineExceededError.phase`
        self._shown_at = (
            -math.inf
        )  # when a server last showed that it has the goal; not the acceptance
        self._asked_all_at = -math.inf  # when all servers were last asked again to cancel it
        self._one_unseen = False  # one that may have it is not in sight, and was not seen to leave
        # How it ends for its caller, after other servers have stopped it, too.
        self._waiting_end: tuple[fx.End, Any, str] | None = None

    @property
    def in_flight(self) -> bool:
        """Whether the server may be running the goal."""
        return self._unproven or self.stage in (Stage.ACCEPTED, Stage.ANOTHER_MAY_RUN)

    @property
    def may_run(self) -> bool:
        """Whether a server in sight may be running it, and has not denied that."""
        if self.stage is Stage.ANOTHER_MAY_RUN:
            return True
        denied = self.stage is Stage.SENT and self._unknown_to_server
        ended = self._terminal_seen is not None  # then only its result is missing
        return self.in_flight and not (self.facts.lost or denied or ended)

    @property
    def awaits_result_of(self) -> GoalState | None:
        """The state in which it ended, if its result has not come yet; else `None`."""
        return self._terminal_seen if self.stage is Stage.ACCEPTED else None

    def lose_touch(self) -> None:
        """Stop tracking the goal and do nothing more about it; it may still be running."""
        self.facts.left = self.facts.left or self.in_flight

    @property
    def _unproven(self) -> bool:
        """Whether a server may have the goal, but has not shown that it (still) has it."""
        return self.stage in (Stage.SENT, Stage.LOST)

    @property
    def unwanted(self) -> bool:
        """Whether its caller does not want it: it is cancelled when a server shows that it has it.

        That is also so after a refusal, when the caller waits for the end of the goal again.
        """
        return self._given_up or self._refused_reason is not None

    @property
    def _given_up(self) -> bool:
        """Whether its caller has left, or waits for its cancellation only."""
        return self.settled or self.cancel_reason is not None

    @property
    def _is_left_alone(self) -> bool:
        """Whether it is only followed: nothing that happens to it makes us cancel it."""
        wanted = self.cancel_reason is None and self._refused_reason is None
        return self._left_alone and wanted

    @property
    def _asked_to_cancel(self) -> bool:
        """Whether this side has asked, or has begun to ask, for its cancellation."""
        return self.unwanted or self._cancel_reply is not CancelReply.NONE

    # --- timers ----------------------------------------------------------------------------

    def _arm_reask(self, now: float) -> fx.Effect:
        return fx.Arm(fx.Timer.REASK, now + self._reask_after)

    def _arm_accept(self, now: float) -> list[fx.Effect]:
        limit = self._timeouts.accept
        if limit is None:
            return []
        if self._doubted_for > CONFIRMED_AFTER:
            limit += LATE_ACCEPTANCE  # else it would end before it is known whether it runs
        return [fx.Arm(fx.Timer.ACCEPT, now + limit)]

    def _arm_result(self, now: float) -> list[fx.Effect]:
        limit = self._timeouts.result
        if limit is None or self.settled:
            return []
        return [fx.Arm(fx.Timer.RESULT, now + limit)]

    def _arm_stall(self, now: float) -> list[fx.Effect]:
        silence = self._timeouts.feedback
        # A goal that has ended, or is being cancelled, may send no feedback: silence means nothing.
        quiet = self._terminal_seen is not None or self.facts.others_cancel
        quiet |= self._cancel_reply is CancelReply.ACCEPTED  # for an earlier call of this client
        if silence is None or quiet or self._given_up or self.stage is not Stage.ACCEPTED:
            return []
        return [fx.Arm(fx.Timer.STALL, now + silence)]

    # --- endings ---------------------------------------------------------------------------

    def _enter(self, state: GoalState, detail: str = "") -> fx.Effect:
        self.state = state
        return fx.Record(state, detail)

    def _end_here(
        self, end: fx.End, now: float, *, result: Any = None, lost_because: str = ""
    ) -> list[fx.Effect]:
        """One server's answer ends it for the caller; another server may still run it (R14)."""
        if not self.facts.may_run or self._is_left_alone:
            if self.facts.may_run:
                self.lose_touch()
            self.stage = Stage.OVER
            return [*self._settle(end, result=result, lost_because=lost_because), *self._release()]
        self.stage, self.facts.lost = Stage.ANOTHER_MAY_RUN, False
        effects: list[fx.Effect] = []
        if self.cancel_reason is None:
            effects = self._settle(end, result=result, lost_because=lost_because)
        elif not self.settled:
            self._waiting_end = end, result, lost_because
        self._reask_after = FIRST_REASK
        effects = [fx.Disarm(fx.Timer.STALL), *effects, fx.AskCancel(), fx.AskResult(anew=True)]
        return [*effects, self._arm_reask(now)]

    def _settle_waiting_end(self) -> list[fx.Effect]:
        """Give the caller the ending that was held back, even if other servers may run the goal."""
        if self._waiting_end is None:
            return []
        end, result, lost_because = self._waiting_end
        if end is fx.End.REJECTED and not self.facts.is_over:
            end = fx.End.NO_ACCEPTANCE
        return self._settle(end, result=result, lost_because=lost_because)

    def _settle(
        self,
        end: fx.End,
        *,
        result: Any = None,
        error: BaseException | None = None,
        lost_because: str = "",
    ) -> list[fx.Effect]:
        """Give the ending to the caller, unless the attempt has already ended."""
        if self.settled:
            return []
        self.settled = True
        if self.cancel_reason is None:
            refused = end in WITH_END and self._refused_reason is not None
        else:
            refused = end is not fx.End.LOST and self._cancel_reply in _REFUSALS
        news, facts = self._news, self.facts
        stopped = news is fx.LastNews.STOPPED
        unended = end in _TIMED_OUT and not self.state.is_terminal
        ending = fx.Ending(
            end,
            GoalState.TIMED_OUT if unended else self.state,
            result=result,
            phase=self._phase if end is fx.End.DEADLINE else "",
            rejected=not facts.accepted and facts.noes >= facts.servers,
            news=news,
            given_up=self.cancel_reason is not None or self.abandoned,
            ended_as=self._terminal_seen if stopped else None,
            elsewhere=not stopped and (facts.ended or facts.rejected),
            ended_first=self._ended_first,
            abandoned=self.abandoned,
            refused=refused,
            error=error,
            lost_because=lost_because,
        )
        return [fx.Settle(ending)]

    @property
    def _news(self) -> fx.LastNews:
        over = self.stage is Stage.OVER and not self.facts.left
        if (over or self.stage is Stage.ANOTHER_MAY_RUN) and not self.facts.is_over:
            return fx.LastNews.NOTHING  # another server on the name may still run it
        if self.stage is Stage.LOST:
            return fx.LastNews.SERVER_GONE  # also if another server has ended it
        if over or self._terminal_seen is not None:
            return fx.LastNews.STOPPED
        return fx.LastNews.UNKNOWN_TO_SERVER if self._unknown_to_server else fx.LastNews.NOTHING

    def _over(self) -> list[fx.Effect]:
        self.stage = Stage.OVER
        self.facts.ended = self.facts.over = True
        return [*self._settle_waiting_end(), *self._release()]

    def _release(self) -> list[fx.Effect]:
        return [fx.Release()]
