"""Decides about a goal that its caller no longer wants: cancels, refusals, and how it ends."""

from __future__ import annotations

from actionkit._goal import effects as fx
from actionkit._goal.record import GoalRecord
from actionkit._goal.stages import (
    CONFIRMED_AFTER,
    END_AFTER,
    FINAL,
    FIRST_REASK,
    WAITED_FOR,
    CancelReason,
    CancelReply,
    Stage,
)
from actionkit._model.settings import LONGEST_GRACE
from actionkit._model.values import GoalState

_REFUSED = "the server refused to cancel; the goal runs on"
_CALLER_MAY_WAIT = (CancelReason.CANCELLED, CancelReason.UNANSWERED)
"""The reasons after which the caller can continue to wait if the goal is not cancelled."""


class CancellableGoal(GoalRecord):
    """The middle layer of the state machine: giving up, and refusals.

    A refusal is not believed at once. rclpy's servers send the same answer if the goal has just
    ended or is just being accepted (R12). It is believed if it comes again after a moment, or at
    the end of the time for the cancellation.
    """

    # --- what the caller wants -------------------------------------------------------------

    def give_up(self, why: CancelReason, now: float, *, abandon: bool = False) -> list[fx.Effect]:
        """The caller no longer wants the goal; with `abandon`, it runs on, as the user chose."""
        if why in FINAL:
            self._final_reason = self._final_reason or why
        if why is CancelReason.DEADLINE:
            self._latest = now + self._timeouts.cancel
        if self.settled:
            return [] if abandon else self._ask_again(now)
        if self.cancel_reason is not None:
            return []
        if abandon or (self._is_left_alone and why is not CancelReason.CANCELLED):
            return self._leave(why)
        return self._cancel(why, now)

    def _ask_again(self, now: float) -> list[fx.Effect]:
        """Its caller has left: ask once more, because a refusal need not be the last word."""
        facts = self.facts
        # One of several servers may be in sight, though the goal counts as lost.
        out_of_sight = facts.lost and (facts.servers == 1 or facts.away >= facts.servers)
        if not self.in_flight or out_of_sight or self.awaits_result_of is not None:
            return []
        self._forget_refusals()
        return self._ask_all_to_cancel(now)

    def _ask_all_to_cancel(self, now: float) -> list[fx.Effect]:
        """Ask, also again: one of several servers may have refused, or got the goal since."""
        if self.facts.servers > 1:
            self._asked_all_at = now  # what they answer to earlier requests tells nothing about it
        return [fx.AskCancel()]

    def _leave(self, why: CancelReason) -> list[fx.Effect]:
        """Let it run."""
        self._phase = "accept" if self.stage is Stage.SENT else "execute"
        self.lose_touch()
        self.stage = Stage.OVER
        self.abandoned = True
        effects: list[fx.Effect] = []
        if why in WAITED_FOR:
            effects.append(fx.Record(GoalState.TIMED_OUT, f"waiting for {WAITED_FOR[why]}"))
        return [*effects, *self._settle(END_AFTER[why]), *self._release()]

    def forget(self) -> list[fx.Effect]:
        """Stop tracking the goal, though it may run."""
        self.lose_touch()
        self.stage = Stage.OVER
        return self._release()

    def fail(self, reason: str, error: BaseException, now: float) -> list[fx.Effect]:
        """Our own side failed: it cannot follow the goal any more."""
        self.lose_touch()
        if self.settled:
            return []
        self.stage = Stage.OVER
        effects: list[fx.Effect] = [self._enter(GoalState.LOST, reason)]
        return effects + self._settle(fx.End.LOST, error=error) + self._release()

    def _cancel(self, why: CancelReason, now: float) -> list[fx.Effect]:
        self._phase = "accept" if self.stage is Stage.SENT else "execute"
        self.cancel_reason, self.cancelled_at = why, now
        self.facts.given_up = True
        effects: list[fx.Effect] = []
        if why in WAITED_FOR:
            effects.append(fx.Record(GoalState.TIMED_OUT, f"waiting for {WAITED_FOR[why]}"))
        self._unknown_to_server = False  # only the server's answers from now on count
        told = self._refusal_told and why is CancelReason.CLOSED  # for a cancel just before
        self._forget_refusals()
        self._refusal_told = told
        self._reask_after = FIRST_REASK / 2  # somebody waits for this
        self._ended_first = self._terminal_seen is not None
        # A goal that has ended is not cancelled: only its result is missing.
        ask = [fx.AskResult()] if self._ended_first else self._ask_all_to_cancel(now)
        return [
            *effects,
            fx.Disarm(fx.Timer.STALL),
            *ask,
            fx.Arm(fx.Timer.CANCEL, now + self._timeouts.cancel),
            self._arm_reask(now),
        ]

    # --- refusals --------------------------------------------------------------------------

    def _forget_refusals(self) -> None:
        """Earlier refusals do not apply any more."""
        if self._cancel_reply is not CancelReply.ACCEPTED:
            self._cancel_reply = CancelReply.NONE
            self._refusal_told = self.facts.refused = False

    @property
    def _refusal_counts(self) -> bool:
        """Whether a refusal matters: the goal is to be cancelled, and it runs."""
        ends = self._cancel_reply is CancelReply.ACCEPTED or self._terminal_seen is not None
        return self.unwanted and not ends

    def _cancel_refused(self, now: float, asked_at: float) -> list[fx.Effect]:
        """The server answered that it will not cancel the goal."""
        if not self._refusal_counts:
            return []
        if self._cancel_reply is CancelReply.NONE:
            self._cancel_reply = CancelReply.REFUSED_ONCE
            self._refused_at = now
            self._reask_after = CONFIRMED_AFTER  # then `_reask` asks once more (R12)
            return [fx.WatchStatus(), self._arm_reask(now)]
        if asked_at < self._refused_at + CONFIRMED_AFTER:
            return []  # on a slow network, such answers may arrive for seconds
        self._cancel_reply = CancelReply.REFUSED
        return self._believe_refusal(now)

    def _believe_refusal(self, now: float) -> list[fx.Effect]:
        """The goal runs on. What follows depends on its caller:

        | the caller | what follows |
        |---|---|
        | has left, or waits until a deadline or a silence is over | nothing changes |
        | has cancelled it, or got no answer in time | it waits for the goal's end again |
        | the same, and then its deadline passed or it closed | it waits for the cancellation |
        """
        told = [] if self._refusal_told else [fx.Record(self.state, _REFUSED, cancel_refused=True)]
        self._refusal_told = self.facts.refused = True
        if self.settled or self.cancel_reason not in _CALLER_MAY_WAIT:
            return [*told]  # it may still succeed in the time that is left (C2.3)
        if self._final_reason is not None:
            self.cancel_reason = self._final_reason
            return [*told]
        # The goal runs on although the caller cancelled it, so the caller's future stays pending.
        self._refused_reason, self.cancel_reason = self.cancel_reason, None
        return [fx.Disarm(fx.Timer.CANCEL), *told, *self._arm_stall(now)]

    def _cancel_accepted(self, now: float) -> list[fx.Effect]:
        """The server cancels the goal, perhaps after a refusal of its own or of another server."""
        self._cancel_reply = CancelReply.ACCEPTED
        self.facts.refused = False
        if self._refused_reason is None or self._given_up:
            return []
        self.cancel_reason, self._refused_reason = self._refused_reason, None
        self.cancelled_at = now
        return [fx.Disarm(fx.Timer.STALL), fx.Arm(fx.Timer.CANCEL, now + self._timeouts.cancel)]

    # --- how it ends -----------------------------------------------------------------------

    def _cancel_timed_out(self, now: float, others_confirmed_at: float) -> list[fx.Effect]:
        """The time for a cancellation is over, unless the server still confirms other goals."""
        later = min(
            others_confirmed_at + self._timeouts.cancel,
            self.cancelled_at + self._timeouts.cancel + LONGEST_GRACE,
            self._latest,
        )
        answered = self._unknown_to_server  # the server has answered: waiting longer is useless
        if later > now and not answered:
            return [fx.Arm(fx.Timer.CANCEL, later)]
        if self._waiting_end is not None:
            return self._settle_waiting_end()
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
        """The server has forgotten a goal that it had, or never sends its result."""
        facts = self.facts
        facts.over = not facts.undecided
        facts.ended, facts.ends = True, max(facts.yeses, 1)
        effects: list[fx.Effect] = [self._enter(GoalState.LOST, "the result cannot be had")]
        end = fx.End.RESULT_LOST
        if self.cancel_reason in FINAL:
            end, why = END_AFTER[self.cancel_reason], ""
        return effects + self._end_here(end, now, lost_because=why)
