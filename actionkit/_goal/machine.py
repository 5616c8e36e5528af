"""Decides what to do about one goal, as a pure state machine: no threads, no clock, no rclpy.

Each method is an event, with its time; it returns what to do about it, in order. The caller's view
of a goal (`settled`) and the goal's life on the server (`stage`) are separate. If the caller gives
up on a goal, it is watched, and cancelled as soon as possible, until it is known not to run any
more (C2.4).
"""

from __future__ import annotations

import math
from typing import Any

from actionkit._goal import effects as fx
from actionkit._goal.cancelling import CancellableGoal
from actionkit._goal.facts import GoalFacts
from actionkit._goal.stages import (
    CONFIRMED_AFTER,
    END_AFTER,
    FINAL,
    FIRST_REASK,
    LAST_RESULT_PAUSE,
    LAST_UNKNOWN_PAUSE,
    LATE_ACCEPTANCE,
    LONG_PAUSE,
    LONGEST_PAUSE,
    LONGEST_RESULT_PAUSE,
    RANK,
    CancelReason,
    CancelReply,
    Stage,
)
from actionkit._model.cancel_answer import CancelAnswer
from actionkit._model.settings import Timeouts
from actionkit._model.values import GoalState

_ONE_IS_GONE = "one of its action servers is gone, and the others do not have it"
_ENDS = {GoalState.SUCCEEDED: fx.End.SUCCEEDED, GoalState.ABORTED: fx.End.ABORTED}


class Goal(CancellableGoal):
    """One goal that was sent, which is one attempt of a call: one method for each event."""

    def sent(self, now: float, servers: int = 1) -> list[fx.Effect]:
        """The middleware has just got the goal's request; so many servers may receive it."""
        self.facts.servers = max(1, servers)
        watch: list[fx.Effect] = [fx.WatchStatus()] if self.watched_early else []
        return [self._enter(GoalState.SENT), *watch, *self._arm_accept(now), self._arm_reask(now)]

    def attached(
        self, now: float, servers: int, *, left_alone: bool, just_sent: bool = False
    ) -> list[fx.Effect]:
        """Somebody else has sent it, and one of so many servers may have it: begin to follow it.

        With `left_alone`, only the caller's explicit cancel cancels it. With `just_sent`, a server
        that does not know it may still accept it.
        """
        self._doubted_for = LATE_ACCEPTANCE if just_sent else CONFIRMED_AFTER
        self.facts.attached = True
        self._left_alone = left_alone
        self.state = GoalState.SENT
        self.facts.servers = max(1, servers)
        asks = fx.WatchStatus(), fx.AskResult()
        return [*asks, *self._arm_accept(now), self._arm_reask(now)]

    def attached_again(
        self, timeouts: Timeouts, now: float, _: int, *, left_alone: bool
    ) -> list[fx.Effect]:
        """Another call follows it from now on; the one that it was of has given up on it (C1.16).

        What is known about the goal stays, and only what the new call wants counts. But it is
        still cancelled if there is nothing to follow: then the new call ends at once.
        """
        self.settled = self._left_alone = self.facts.user_knows = self.facts.left = False
        self.cancel_reason = self._final_reason = self._refused_reason = self._waiting_end = None
        self._timeouts, self._latest = timeouts, math.inf
        if self.stage is Stage.ANOTHER_MAY_RUN:
            why = "one server has ended it, and another one is asked to cancel it"
            return self._settle(fx.End.RESULT_LOST, lost_because=why)
        if self.facts.lost:
            return self._settle(fx.End.LOST, lost_because="its action server is gone")
        # What no server has answered yet may be accepted later, when nobody looks: it is cancelled.
        self._left_alone = left_alone and self.facts.accepted
        self._forget_refusals()
        self._unknown_to_server = self._ended_first = False
        self._cancelled_before = True
        if self.stage is not Stage.SENT:
            self._forgotten_at = None
        self._reask_after = FIRST_REASK
        effects: list[fx.Effect] = [fx.StopCancel(), fx.WatchStatus(), fx.AskResult(anew=True)]
        if self.stage is Stage.SENT:
            effects += self._arm_accept(now)
        else:
            self.stage = Stage.ACCEPTED  # also if its server was lost, and is back
            seen, self.state = self.state, GoalState.ACCEPTED
            effects.append(fx.Record(self.state))
            if RANK.get(seen, 0) > RANK[self.state]:
                effects.append(self._enter(seen))
        if self._terminal_seen is not None:
            effects += self._arm_result(now)
        return [*effects, self._arm_reask(now), *self._arm_stall(now)]

    def server_ready(self, now: float) -> list[fx.Effect]:
        """A server can be used (again)."""
        if self.stage is Stage.LOST:
            return self._ask_about_lost(now)
        # It is a new server on the name, or the same one after a restart. If it does not know the
        # goal, it will say so (R1).
        if self.stage not in (Stage.ACCEPTED, Stage.ANOTHER_MAY_RUN):
            return []
        if self.facts.servers == 1 or not self.unwanted:
            return [fx.AskResult()]
        return [*self._ask_all_to_cancel(now), fx.AskResult()]

    def server_back(self, now: float) -> list[fx.Effect]:
        """The server that the goal was sent to can be used (again)."""
        if self.stage is not Stage.LOST:
            return self.server_ready(now)
        if self.facts.ended or self.facts.rejected:
            self.stage = Stage.ANOTHER_MAY_RUN
        elif not self.facts.accepted:
            # It may still accept the goal (R6): if it does not know the goal yet, that is normal.
            self.stage = Stage.SENT
        self.facts.lost = False
        return self._ask_about_lost(now)

    def _ask_about_lost(self, now: float) -> list[fx.Effect]:
        self._reask_after = FIRST_REASK
        # What a server answers to an earlier request may be outdated.
        return [fx.AskCancel(), fx.AskResult(anew=True), self._arm_reask(now)]

    # --- what the servers answer -----------------------------------------------------------

    def accepted(self, now: float) -> list[fx.Effect]:
        """A server answered that it accepts the goal."""
        if not self.in_flight:
            return []
        facts = self.facts
        facts.yeses += 1
        facts.servers = max(facts.servers, facts.yeses)  # one of them was not visible yet
        if self._unproven:
            return self._shown(now)
        if facts.servers == 1:
            return []
        self._shown_at = now
        if self.stage is Stage.ACCEPTED:
            # One server has ended it and seemed to be the only one, but this one has not.
            facts.over, self._terminal_seen = False, None
        cancel: list[fx.Effect] = [fx.AskCancel()] if self.unwanted else []
        return [fx.AskResult(anew=True), *cancel]

    def taken_back(self, facts: GoalFacts, servers: int, now: float) -> list[fx.Effect]:
        """Another server has accepted a goal that was over here: it is cancelled there (R14).

        It was released. `facts` are what is known of it, and so many `servers` may have it.
        """
        self.facts, self.settled = facts, True
        facts.accepted, facts.yeses = True, facts.yeses + 1
        facts.servers = max(facts.servers, servers, facts.yeses + facts.noes)
        if facts.ended and not facts.runs_seen:
            self.stage = Stage.OVER  # the acceptance of the server that has ended it came late
            return self._release()
        facts.over = facts.lost = facts.servers_gone = facts.left = facts.user_knows = (
            facts.refused
        ) = False
        self.stage, self.cancelled_at, self._shown_at = Stage.ANOTHER_MAY_RUN, now, now
        return [fx.AskCancel(), fx.AskResult(anew=True), self._arm_reask(now)]

    def _shown(self, now: float) -> list[fx.Effect]:
        """The server has the goal: it said so, or sent something that proves it."""
        self._shown_at = now
        effects: list[fx.Effect] = [fx.Disarm(fx.Timer.ACCEPT)]
        self.facts.accepted, self.facts.lost = True, False
        self._unknown_to_server = False
        if self.stage is Stage.SENT:
            effects.append(self._enter(GoalState.ACCEPTED))
        elsewhere = self.facts.ended or self.facts.rejected  # by another server, before it was lost
        self.stage = Stage.ANOTHER_MAY_RUN if elsewhere else Stage.ACCEPTED
        # Ask at once: a result may expire within milliseconds after the end (R25).
        effects.append(fx.AskResult(anew=True))
        self._reask_after = FIRST_REASK
        effects.append(self._arm_reask(now))
        if self.unwanted:
            effects.append(fx.AskCancel())
        return effects + self._arm_stall(now)

    def _proven(self, now: float) -> list[fx.Effect]:
        """The server sent something that it sends only for accepted goals."""
        return self._shown(now) if self._unproven else []

    def rejected(self, now: float) -> list[fx.Effect]:
        """The server rejected the goal; it may be out of sight by now."""
        facts = self.facts
        lost = self.stage is Stage.LOST and not facts.accepted
        if self.stage is not Stage.SENT and not lost:
            facts.noes += facts.servers > 1  # then this is not the server that has the goal
            return self._look_elsewhere(now) if self.stage is Stage.ANOTHER_MAY_RUN else []
        facts.noes += 1
        if not facts.is_over:
            if lost:
                return []  # another of its servers may have accepted it
            if facts.noes + facts.away >= facts.servers:
                # But not surely: the one that is gone may have sent an answer just before.
                return self.server_lost(_ONE_IS_GONE, now)
        facts.rejected = True
        effects = [self._enter(GoalState.REJECTED)]
        if self.settled and facts.is_over:
            effects.append(fx.LateResult(GoalState.REJECTED, None))
        end = fx.End.REJECTED
        if self.cancel_reason is CancelReason.CANCELLED:
            end = fx.End.CANCELLED_BY_CALLER
        elif self.cancel_reason not in (None, CancelReason.UNANSWERED):
            end = END_AFTER[self.cancel_reason]
        return effects + self._end_here(end, now)

    def feedback(self, now: float) -> list[fx.Effect]:
        """Feedback of this goal came. It proves acceptance, and may arrive earlier (R15)."""
        effects = self._proven(now)
        if self.stage is not Stage.ACCEPTED:
            return effects
        if self.state is GoalState.ACCEPTED:
            effects.append(self._enter(GoalState.EXECUTING))
        return effects + self._arm_stall(now)

    def status(self, state: GoalState, now: float, *, ours: bool) -> list[fx.Effect]:
        """The server's status topic shows the goal in `state`.

        `ours` means that one of our cancel requests may have cancelled it (C4.4).
        """
        # We give up on a lost goal, but send it a cancel request only when its server is back.
        asked = ours if self.stage is Stage.LOST else self._asked_to_cancel
        effects = self._proven(now)
        if self.stage is not Stage.ACCEPTED:
            return effects
        if not state.is_terminal:
            if state is GoalState.CANCELING and not asked:
                self.facts.others_cancel = True
                effects.append(fx.Disarm(fx.Timer.STALL))
            if RANK[state] > RANK.get(self.state, 0):
                effects.append(self._enter(state))
            return effects
        if self._terminal_seen is None and self.facts.servers == 1:
            # The result usually follows at once; otherwise it is requested.
            self._terminal_seen = state
            self.facts.ended = self.facts.over = True
            self._forget_refusals()
            self._reask_after = FIRST_REASK / 2
            # A goal that has ended sends no feedback, so its silence means nothing.
            effects += [fx.Disarm(fx.Timer.STALL), self._arm_reask(now), *self._arm_result(now)]
        return effects

    def result(
        self,
        status: GoalState | None,
        result: Any,
        now: float,
        *,
        asked_at: float,
        ours: bool = True,
        own: bool = True,
        everybody: bool = True,
        ends: int = 1,
        answers: float = math.inf,
    ) -> list[fx.Effect]:
        """A server answered the request for the result.

        Args:
            status: A terminal state; `None` if the server does not know the goal.
            result: The result message; empty if there is no status.
            now: Monotonic seconds.
            asked_at: When the result was requested.
            ours: Whether one of our cancel requests may have cancelled it (C4.4).
            own: Whether a server that the goal was sent to is in sight (C5.7).
            everybody: Whether each server in sight has answered this request.
            ends: How many answered it with a terminal state, including this one.
            answers: How many servers have answered it: one that has accepted the goal may not be in
                sight yet.
        """
        if not self.in_flight:
            return []
        facts = self.facts
        # A server that is just accepting the goal answers as if it did not know it (R12).
        everybody = everybody and (
            facts.servers == 1 or asked_at >= self._shown_at + CONFIRMED_AFTER
        )
        unseen = everybody and answers < facts.servers - facts.away
        if everybody:
            self._one_unseen, everybody = unseen, not unseen
        self._denied_lately |= unseen and self.stage is Stage.ANOTHER_MAY_RUN
        if status is not None:
            return self._ended_on_one(
                status, result, now, ours=ours, everybody=everybody, ends=ends
            )
        if unseen:
            # All others do not have it. They are asked again: this one may yet come into sight.
            self._forgotten_at = self._forgotten_at or now
            waited = now >= self._forgotten_at + LONGEST_PAUSE
            return self._one_is_gone(now) if waited else []
        return self._unknown(now, asked_at, own=own, everybody=everybody)

    def _ended_on_one(
        self,
        status: GoalState,
        result: Any,
        now: float,
        *,
        ours: bool,
        everybody: bool,
        ends: int,
    ) -> list[fx.Effect]:
        """A server has ended the goal; the arguments are those of `result`."""
        facts = self.facts
        effects = [] if self.stage is Stage.LOST else self._proven(now)
        elsewhere = self.stage is Stage.ANOTHER_MAY_RUN or (
            self.stage is Stage.LOST and facts.ended
        )
        facts.accepted = facts.ended = True
        facts.ends = max(facts.ends, ends)
        facts.over = self._stopped_everywhere(everybody=everybody)
        better = status is GoalState.SUCCEEDED is not self._terminal_seen
        late = [fx.LateResult(status, result)] if self.settled else []
        if elsewhere and not (self._waiting_end and better):
            return [*late, *self._look_elsewhere(now, everybody=everybody)]
        self._waiting_end = None
        self._terminal_seen = status
        effects.append(self._enter(status))
        canceled = status is GoalState.CANCELED
        if canceled and ours and facts.servers > 1 and self._refused_reason is not None:
            effects += self._cancel_accepted(now)  # by another server; its answer may come later
        end = self._end_with(status, ours=ours)
        if end is fx.End.DEADLINE and status is not GoalState.SUCCEEDED:
            result = None  # only a late success is useful
        because = ""
        confirmed = canceled and self._cancel_reply is CancelReply.ACCEPTED
        if end is fx.End.CANCELED_BY_OTHER and confirmed and self._cancelled_before:
            because = "an earlier call of this client had cancelled it"
        return [*effects, *late, *self._end_here(end, now, result=result, lost_because=because)]

    def _end_with(self, status: GoalState, *, ours: bool) -> fx.End:
        """How the attempt ends if a server has ended the goal in this state.

        | the caller gave up by | SUCCEEDED, ABORTED | CANCELED by us | CANCELED by others |
        |---|---|---|---|
        | nothing | as the goal | by others | by others |
        | its own cancel | as the goal | by the caller | by the caller |
        | the deadline | deadline | deadline | deadline |
        | another reason | as the goal | that reason | by others |
        """
        why, canceled = self.cancel_reason, status is GoalState.CANCELED
        if canceled and why is CancelReason.CANCELLED:
            return fx.End.CANCELLED_BY_CALLER
        if why is CancelReason.DEADLINE or (why is not None and canceled and ours):
            return END_AFTER[why]
        return _ENDS.get(status, fx.End.CANCELED_BY_OTHER)

    def _unknown(
        self, now: float, asked_at: float, *, own: bool, everybody: bool
    ) -> list[fx.Effect]:
        """A server does not know the goal, or none of the servers in sight do.

        The first line that fits counts:

        | what is known | what follows |
        |---|---|
        | several servers may have it, and not all in sight have denied it | nothing |
        | it is over for its caller, and another server was asked | it may be over |
        | one of several has left | it may run there, so it counts as lost |
        | a server has had it, or it was attached to | it is over if the server says so again |
        | it was lost, and its server is not back | wait for that server |
        | it was lost, and its server is back | it is over, soon or after a minute |
        | no server has shown that it has it | one may still accept it |
        """
        facts = self.facts
        if facts.servers > 1 and not (everybody and own):
            lost = everybody and facts.lost
            return self._unknown_to_another() if lost else []  # otherwise another one may run it
        if self.stage is Stage.ANOTHER_MAY_RUN:
            return self._look_elsewhere(now, everybody=True)
        if facts.servers > 1 and facts.away:
            # One of the servers that may run it has left, and those in sight do not run it.
            if self.stage is Stage.LOST:
                return []
            self._denied_lately = True
            return self._one_is_gone(now) if facts.undecided else self._gone(now)
        if self.stage is Stage.ACCEPTED or (facts.attached and self.stage is Stage.SENT):
            return self._forgotten(now, asked_at) if own else []
        if self.stage is Stage.LOST and facts.undecided:
            self._denied_lately = not facts.lost
            return []
        if self.stage is Stage.LOST:
            return self._unknown_to_another() if facts.lost else self._over()
        return self._unknown_so_far()

    # --- several servers on one name -------------------------------------------------------

    def servers_changed(self, servers: int, away: int) -> list[fx.Effect]:
        """Another server may have got the goal, too, or one left the graph or came back."""
        facts, more = self.facts, away > self.facts.away
        self._denied_lately = False  # one that has come, or come back, has not denied it
        # Those that are there do not have it, see `_gone`.
        stays = facts.servers_gone and away >= facts.away
        facts.servers, facts.away = max(1, servers, facts.yeses + facts.noes), away
        facts.servers_gone = stays or away >= facts.servers
        if more and facts.servers > 1 and self.stage in (Stage.ACCEPTED, Stage.ANOTHER_MAY_RUN):
            return [fx.AskResult(anew=True)]
        return []

    def _stopped_everywhere(self, *, everybody: bool) -> bool:
        """Whether a goal that has ended on one server, or was rejected, runs on no other.

        `everybody` means that each server in sight has answered that it does not run it, or not any
        more, after the last one had shown that it has it.
        """
        facts = self.facts
        if facts.undecided:
            return False
        # How many servers have what somebody else has sent is not known.
        nowhere_seen = not facts.runs_seen and not facts.attached
        return facts.servers == 1 or nowhere_seen or (everybody and not facts.away)

    def _look_elsewhere(self, now: float, *, everybody: bool = False) -> list[fx.Effect]:
        """Another server has answered about a goal that is over for its caller."""
        facts = self.facts
        self._denied_lately |= everybody
        if self._stopped_everywhere(everybody=everybody):
            return self._over()
        if not facts.may_run:
            self.stage = Stage.OVER
            return [*self._settle_waiting_end(), *self._release()]
        if everybody and facts.away and not facts.undecided:
            return self._gone(now)
        return []

    def _gone(self, now: float) -> list[fx.Effect]:
        """One of several servers has left, and may run the goal; those in sight do not."""
        self.facts.servers_gone = True
        return self.server_lost(_ONE_IS_GONE, now)

    def _one_is_gone(self, now: float) -> list[fx.Effect]:
        """One of several servers has left, and another has not said whether it accepts the goal.

        It may have come too late for the request; then it never says so. Or one that was never in
        sight has accepted it. A call without any limit would wait for ever.
        """
        limit = LONGEST_PAUSE if self._timeouts.accept is None else self._timeouts.accept
        if self.stage is not Stage.ACCEPTED or now < self._shown_at + limit:
            return []
        return self.server_lost(_ONE_IS_GONE, now)  # not `gone`: it may still accept it

    def _forgotten(self, now: float, asked_at: float) -> list[fx.Effect]:
        """The server does not know a goal that it should have: believed if it answers so again.

        While one thread of an rclpy server accepts a goal, another one answers as if it did not
        exist.
        """
        if self._forgotten_at is None:
            self._forgotten_at = now
            self._reask_after = CONFIRMED_AFTER
            return [self._arm_reask(now)]
        doubted_for = self._doubted_for if self.stage is Stage.SENT else CONFIRMED_AFTER
        if asked_at < self._forgotten_at + doubted_for:
            return []  # on a slow network, such answers may arrive for seconds
        if self.stage is Stage.SENT:
            return self._nobody_knows(now)
        return self._result_lost("its server no longer knows the goal", now)

    def _nobody_knows(self, now: float) -> list[fx.Effect]:
        """No server has the goal that the call was attached to."""
        self.facts.ended = self.facts.over = True
        end = END_AFTER[self.cancel_reason] if self.cancel_reason in FINAL else fx.End.UNKNOWN
        return [self._enter(GoalState.LOST, "no server knows it"), *self._end_here(end, now)]

    def cancel_answered(
        self, answer: CancelAnswer, now: float, *, asked_at: float, own: bool = True
    ) -> list[fx.Effect]:
        """The server answered a cancel request for this goal, sent at `asked_at`.

        `own` means that a server that the goal was sent to is in sight.
        """
        if not self.in_flight:
            return []
        if answer is CancelAnswer.UNKNOWN_GOAL:
            if self.facts.servers > 1:
                return [fx.AskResult()]  # each server answers this one
            if asked_at < self._shown_at:
                return []  # the result was requested since then
            if self.stage is Stage.LOST:
                return self._unknown_to_another() if self.facts.lost else self._over()
            known = self.stage is Stage.ACCEPTED or self.facts.attached
            if not known:
                return self._unknown_so_far()
            # micro-ROS' server answers no request for the result of a goal that has ended, and
            # shows no end. If an end was shown, the result may be under way.
            forgets = own and self._terminal_seen is None
            return [fx.AskResult(), *(self._forgotten(now, asked_at) if forgets else [])]
        effects = self._proven(now)
        if self.stage is Stage.ANOTHER_MAY_RUN:
            self.facts.refused = answer is CancelAnswer.REFUSED
            return [*effects, fx.AskResult()]
        if answer is CancelAnswer.REFUSED:
            return effects + self._cancel_refused(now, asked_at)
        if answer is CancelAnswer.TERMINATED:
            # This is also the answer for a goal that is being cancelled: it confirms nothing.
            self._forget_refusals()
            if asked_at < self._shown_at:
                return effects  # the result was requested since then
            return [*effects, fx.AskResult()]
        if self.state is not GoalState.CANCELING:
            effects.append(self._enter(GoalState.CANCELING))
        if self.facts.servers > 1 and asked_at < max(self._shown_at, self._asked_all_at):
            effects.append(fx.AskCancel())  # another server may have it, and was not asked
        return effects + self._cancel_accepted(now)

    def _unknown_to_another(self) -> list[fx.Effect]:
        """This server never got the goal. The one that got it may come back, and still run it."""
        return [fx.Disarm(fx.Timer.REASK), fx.StopCancel()]

    def _unknown_so_far(self) -> list[fx.Effect]:
        """A live server does not know a goal that it was sent; it may accept it later (R6)."""
        self._unknown_to_server = self._denied_lately = True
        if self.cancel_reason is CancelReason.UNANSWERED and not self.settled:
            return self._settle_given_up()  # waiting longer would tell nothing new
        return []

    # --- what the servers do not answer ----------------------------------------------------

    def server_lost(self, reason: str, now: float) -> list[fx.Effect]:
        """The server that had the goal is gone, or another one has replaced it."""
        if self.stage is Stage.ANOTHER_MAY_RUN:
            self.stage, self.facts.lost = Stage.LOST, True
            return [fx.Disarm(fx.Timer.REASK), *self._settle_waiting_end()]
        if self.stage not in (Stage.SENT, Stage.ACCEPTED):
            self.facts.lost |= self.stage is Stage.LOST  # it came back and left again
            return []
        if self._terminal_seen is not None:
            return self._result_lost(reason, now)
        self.stage = Stage.LOST
        self.facts.lost = True
        self._forget_refusals()  # the goal may have ended with its server
        effects: list[fx.Effect] = [fx.Disarm(fx.Timer.REASK)]
        if self.settled:
            return effects
        effects.append(self._enter(GoalState.LOST, reason))
        if self.cancel_reason in FINAL:
            return effects + self._settle_given_up()
        effects += self._settle(fx.End.LOST, lost_because=reason)
        return effects + (self.forget() if self._is_left_alone else [])

    def timer(
        self, timer: fx.Timer, now: float, *, others_confirmed_at: float = -math.inf
    ) -> list[fx.Effect]:
        """A timer fired; `others_confirmed_at` is when a server last answered a cancel request."""
        if timer is fx.Timer.REASK:
            return self._reask(now)
        if self.settled:
            return []
        if timer is fx.Timer.RESULT and self._terminal_seen is not None:
            return self._result_lost(f"it did not come within {self._timeouts.result:g} s", now)
        if timer is fx.Timer.CANCEL and self.cancel_reason is not None:
            return self._cancel_timed_out(now, others_confirmed_at)
        if timer is fx.Timer.ACCEPT and self.stage is Stage.SENT:
            return self.give_up(CancelReason.UNANSWERED, now)
        if timer is fx.Timer.STALL and self.stage is Stage.ACCEPTED:
            return self.give_up(CancelReason.STALLED, now)
        return []

    def _reask(self, now: float) -> list[fx.Effect]:
        """Repeat requests that may have been lost in a queue, or their answers (R3, R4)."""
        if not self.in_flight:
            return []
        if self.stage is Stage.ANOTHER_MAY_RUN:
            return self._reask_elsewhere(now)
        ended = self.awaits_result_of is not None
        if ended and self.settled and self._reask_after >= LAST_RESULT_PAUSE:
            return self._over()
        # A server that has not answered since the last request may be busy, and still accept it.
        denied, self._denied_lately = self._denied_lately, False
        if denied and self.stage is Stage.LOST and self._reask_after >= LONGEST_PAUSE:
            return self._over()  # its server is back, and the others have read the request by now
        dropped = denied and self.settled and self.stage is Stage.SENT
        if dropped and self._reask_after >= LAST_UNKNOWN_PAUSE:
            return self.forget()
        effects: list[fx.Effect] = [fx.WatchStatus()]
        if self._cancel_reply is CancelReply.REFUSED_ONCE and self._refusal_counts:
            effects.append(fx.AskCancel())
        doubted = ended or self._forgotten_at is not None
        if doubted or self.stage is not Stage.ACCEPTED or self._reask_after >= LONG_PAUSE:
            # A goal that only takes long shows up in the status topic, so it is not requested.
            effects.append(fx.AskResult())
        longest = LONGEST_RESULT_PAUSE if ended else LONGEST_PAUSE
        if dropped:
            longest = LAST_UNKNOWN_PAUSE
        self._reask_after = min(self._reask_after * 2, longest)
        return [*effects, self._arm_reask(now)]

    def _reask_elsewhere(self, now: float) -> list[fx.Effect]:
        """Ask again about a goal that is over for its caller, but may run on another server."""
        denied, self._denied_lately = self._denied_lately, False
        if denied and self._reask_after >= LONGEST_PAUSE:
            # A server that has answered for a minute has read the request.
            gone = self.facts.away or self._one_unseen
            return [fx.StopCancel(), *self._gone(now)] if gone else self._over()
        warn: list[fx.Effect] = []
        if self._reask_after == LONG_PAUSE and self.facts.runs_seen:
            warn = [fx.RunsElsewhere()]
        self._reask_after = min(self._reask_after * 2, LONGEST_PAUSE)
        return [fx.AskCancel(), fx.AskResult(), *warn, self._arm_reask(now)]
