"""A goal that its caller no longer wants: why, what the server says to that, and how it ends."""

from __future__ import annotations

import math

from actionkit._goal import effects as fx
from actionkit._goal.record import GoalRecord
from actionkit._goal.stages import (
    DOUBT,
    END_AFTER,
    FIRST_REASK,
    PHASE,
    WAITED_FOR,
    CancelReason,
    CancelReply,
    Closing,
    Stage,
)
from actionkit._model.settings import LONGEST_GRACE
from actionkit._model.values import GoalState

_REFUSED = "the server refused to cancel; the goal runs on"
_CALLER_MAY_WAIT = (CancelReason.CANCELLED, CancelReason.UNANSWERED)
"""The reasons after which the caller can go on waiting for a goal that is not cancelled."""


class CancellableGoal(GoalRecord):
    """The middle layer of the machine: giving up, and refusals.

    A refusal is not believed at once: rclpy's servers refuse in the same words where the goal has
    just ended, or is just being accepted (R12). It is believed when it comes again after a moment,
    or when the time for the cancellation is up.
    """

    # --- what the caller wants -------------------------------------------------------------

    def cancel(self, now: float) -> list[fx.Effect]:
        """The caller cancels."""
        return [] if self._unwanted else self._give_up(CancelReason.CANCELLED, now)

    def close(self, now: float, *, abandon: bool) -> list[fx.Effect]:
        """The client is closing. With `abandon` the goal is left to run, as the user said."""
        self.closing = self.closing or Closing.CANCELLING
        if self._unwanted:
            return []
        if abandon:
            self.lose_touch()
            self.stage = Stage.OVER
            self.closing = Closing.ABANDONED
            return self._settle(fx.End.CLOSED) + self._release()
        return self._give_up(CancelReason.CLOSED, now)

    def forget(self) -> list[fx.Effect]:
        """Nobody looks after the goal any more, though it may run."""
        self.lose_touch()
        self.stage = Stage.OVER
        return self._release()

    def fail(self, reason: str, error: BaseException, now: float) -> list[fx.Effect]:
        """This side broke: it cannot follow the goal any more."""
        self.lose_touch()
        if self.settled:
            return []
        self.stage = Stage.OVER
        self.closing = Closing.BROKEN
        effects: list[fx.Effect] = [self._enter(GoalState.LOST, reason)]
        return effects + self._settle(fx.End.LOST, error=error) + self._release()

    def _give_up(self, why: CancelReason, now: float) -> list[fx.Effect]:
        self._phase = PHASE[self.stage]
        self.cancel_reason, self.cancelled_at = why, now
        self.facts.given_up = True
        effects: list[fx.Effect] = []
        if why in WAITED_FOR:
            effects.append(fx.Record(GoalState.TIMED_OUT, f"waiting for {WAITED_FOR[why]}"))
        self._unknown_to_server = False  # what counts is what the server says from now on
        told = self._refusal_told and why is CancelReason.CLOSED  # of a cancel just before it
        self._forget_refusals()
        self._refusal_told = told
        self._reask_after = FIRST_REASK / 2  # somebody waits for this
        self._ended_first = self._terminal_seen is not None
        # What has ended is not cancelled: only its result is missing.
        ask: fx.Effect = fx.AskResult() if self._ended_first else fx.AskCancel()
        return [
            *effects,
            fx.Disarm(fx.Timer.STALL),
            ask,
            fx.Arm(fx.Timer.CANCEL, now + self._timeouts.cancel),
            self._arm_reask(now),
        ]

    # --- refusals --------------------------------------------------------------------------

    def _forget_refusals(self) -> None:
        """A refusal says nothing of what is the case now."""
        if self._cancel_reply is not CancelReply.ACCEPTED:
            self._cancel_reply = CancelReply.NONE
            self._refusal_told = self.facts.refused = False

    @property
    def _refusal_counts(self) -> bool:
        """Whether a refusal matters: the goal is, or was, to be cancelled, and has not ended."""
        ends = self._cancel_reply is CancelReply.ACCEPTED or self._terminal_seen is not None
        return (self._unwanted or self._refused_reason is not None) and not ends

    def _cancel_refused(self, now: float, asked_at: float) -> list[fx.Effect]:
        """The server says that it will not cancel the goal."""
        if not self._refusal_counts:
            return []
        if self._cancel_reply is CancelReply.NONE:
            self._cancel_reply = CancelReply.REFUSED_ONCE
            self._refused_at = now
            self._reask_after = DOUBT
            return [fx.WatchStatus(), self._arm_reask(now)]
        if asked_at < self._refused_at + DOUBT:
            return []  # on a slow network such answers may come for seconds
        self._cancel_reply = CancelReply.REFUSED
        return self._believe_refusal(now)

    def _believe_refusal(self, now: float) -> list[fx.Effect]:
        """The goal runs on. What that means depends on whether anybody still waits for it."""
        told = [] if self._refusal_told else [fx.Record(self.state, _REFUSED, cancel_refused=True)]
        self._refusal_told = self.facts.refused = True
        if self.settled or self.cancel_reason not in _CALLER_MAY_WAIT:
            return [*told]  # a success in the time that is left is not thrown away (C2.3)
        if self._deadline is not None and now >= self._deadline:
            self.cancel_reason = CancelReason.DEADLINE
            self._phase = self._phase or "execute"
            return [*told]
        if self.closing is not None:
            self.cancel_reason = CancelReason.CLOSED  # nobody is left to wait for it
            return [*told]
        # The goal runs on although the caller cancelled it, so the caller's future stays pending.
        self._refused_reason, self.cancel_reason = self.cancel_reason, None
        return [fx.Disarm(fx.Timer.CANCEL), *told, *self._arm_stall(now)]

    def _cancel_accepted(self, now: float) -> list[fx.Effect]:
        """The server cancels the goal; perhaps after it, or another server, had refused to."""
        self._cancel_reply = CancelReply.ACCEPTED
        self.facts.refused = False
        if self._refused_reason is None or self._unwanted:
            return []
        self.cancel_reason, self._refused_reason = self._refused_reason, None
        self.cancelled_at = now
        return [fx.Disarm(fx.Timer.STALL), fx.Arm(fx.Timer.CANCEL, now + self._timeouts.cancel)]

    # --- how it ends -----------------------------------------------------------------------

    def _cancel_timed_out(self, now: float, others_confirmed_at: float) -> list[fx.Effect]:
        """The time to confirm a cancellation is up, unless the server is still at others."""
        later = min(
            others_confirmed_at + self._timeouts.cancel,
            self.cancelled_at + self._timeouts.cancel + LONGEST_GRACE,
            math.inf if self._deadline is None else self._deadline + self._timeouts.cancel,
        )
        answered = self._unknown_to_server  # it had its turn, and would gain nothing by waiting
        if later > now and self.cancel_reason is not CancelReason.DEADLINE and not answered:
            return [fx.Arm(fx.Timer.CANCEL, later)]
        if self._held is not None:
            return self._settle_held()
        effects: list[fx.Effect] = []
        if self._cancel_reply in (CancelReply.REFUSED_ONCE, CancelReply.REFUSED):
            effects = self._believe_refusal(now)
            if self.cancel_reason is None:
                return effects
        if self.cancel_reason is CancelReason.CANCELLED:
            if self._terminal_seen is GoalState.CANCELED:
                return self._settle(fx.End.CANCELLED_BY_CALLER)
            self._phase = "cancel"
        return effects + self._settle_given_up()

    def _settle_given_up(self) -> list[fx.Effect]:
        assert self.cancel_reason is not None
        return self._settle(END_AFTER[self.cancel_reason])

    def _result_lost(self, why: str, now: float) -> list[fx.Effect]:
        """The server does not know a goal any more that it had, or never sends its result."""
        facts = self.facts
        facts.over = not facts.undecided
        facts.ended, facts.ends = True, max(facts.yeses, 1)
        effects: list[fx.Effect] = [self._enter(GoalState.LOST, "the result cannot be had")]
        end = fx.End.RESULT_LOST
        if self.cancel_reason in (CancelReason.DEADLINE, CancelReason.CLOSED):
            end, why = END_AFTER[self.cancel_reason], ""
        return effects + self._end_here(end, now, lost_because=why)
