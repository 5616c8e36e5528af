"""Decides what a call does, as a pure state machine: attempts, verdicts, pauses, and the end.

It has no threads, no clock and no rclpy. Each method is an event; it returns what to do about it,
in order. `_goal.machine` has the decisions about one goal.
"""

from __future__ import annotations

import uuid
from collections.abc import Callable
from dataclasses import replace
from enum import Enum, auto
from typing import Any, Protocol

from actionkit._calls.futures.call_view import GoalsOfCall
from actionkit._calls.retries.classify import apply_verdict
from actionkit._calls.retries.retry import GiveUp, RejectedByClassifier, Retry, after_no_server
from actionkit._calls.sending import effects as cx
from actionkit._goal import effects as fx
from actionkit._goal.facts import GoalFacts
from actionkit._goal.machine import Goal
from actionkit._goal.stages import CancelReason
from actionkit._model.values import GoalReport, GoalState, Verdict


class Phase(Enum):
    """What a call is doing."""

    NEW = auto()
    WAITING = auto()
    """For a server, or for news that no earlier goal of the call may run."""
    QUEUED = auto()
    """A server is ready; the goal waits for its turn to be sent."""
    TRYING = auto()
    """A goal was sent."""
    JUDGING = auto()
    """`classify=` is deciding how the end of an attempt counts."""
    PLANNING = auto()
    """The policy is deciding whether there is another attempt."""
    PAUSING = auto()
    CONFIRMING = auto()
    """It has ended, but a server may still confirm that earlier goals do not run any more."""
    ENDED = auto()


class AttemptView(Protocol):
    """What a call needs to know about an attempt, and asks it to do."""

    goal_id: uuid.UUID
    goal: Goal

    @property
    def cancel_is_ours(self) -> bool: ...
    def on_server_ready(self) -> None: ...
    def give_up(self, why: CancelReason, *, abandon: bool = False) -> None: ...
    def end_grace(self) -> None: ...
    def fail(self, reason: str, error: BaseException) -> None: ...


LONGEST_LEASE = 30.0
"""Seconds until a process that has died has left the graph. After a crash, Fast DDS shows it for
20 s."""
_GIVEN_UP = (fx.End.CANCELLED_BY_CALLER, fx.End.CLOSED)
_HAD_FAILED = (fx.End.ABORTED, fx.End.CANCELED_BY_OTHER)
_STOPPED = (fx.End.REJECTED, fx.End.ABORTED, fx.End.CANCELED_BY_OTHER)
"""How the server ends a goal that it replaces by another one."""


class CallMachine:
    """One call: its attempts, one after the other, and its goals that may still run."""

    def __init__(
        self,
        goal_id: uuid.UUID,
        resend: str,
        server_limit: float | None,
        deadline: float | None,
        new_id: Callable[[], uuid.UUID] = uuid.uuid4,
        *,
        attaches: bool = False,
        keyed: bool = False,
    ) -> None:
        """Begin without attempts.

        `resend` and `server_limit` are `RetryPolicy.resend` and `Timeouts.server`. `deadline` is
        the monotonic time of the end of the call, or `None`. `new_id` makes the ids of the goals
        after the first. With `attaches`, somebody else has sent the goal; if the call is
        `keyed`, an earlier call with its key.
        """
        self._keyed = keyed
        self.attaches = attaches
        self.phase = Phase.NEW
        self.goals = GoalsOfCall()
        self.goal_id = goal_id  # of the goal that the user is told about
        self.latest_id = goal_id  # of the latest attempt
        self.attempts = 0
        self.attempt: AttemptView | None = None
        # Earlier attempts with a goal that may run, or a result that may come. Not the current one.
        self.earlier: list[AttemptView] = []
        if attaches:
            self.goals.add(GoalFacts(goal_id, left=True))  # it may run, until it is followed
        self._cancel_waits = False  # for a server, to cancel what the call is attached to
        self.is_late = False
        """Whether the deadline passed while it waited for a server, to cancel such a goal."""
        self._ends_as = fx.Ending(fx.End.CANCELLED_BY_CALLER, GoalState.TIMED_OUT, given_up=True)
        """Its end if no such server comes."""
        self.ending: fx.Ending | None = None
        self.cause: BaseException = RejectedByClassifier()  # the last failure, for strategies
        self.unwanted = False  # set by the caller's thread, before it calls `cancel`
        self.closes_because = ""  # why, as a clause
        self._resend = resend
        self._server_limit = server_limit
        self._deadline = deadline
        self._wait_until: float | None = None  # for a server
        self._gone_by = 0.0  # for the server of an earlier goal to leave
        self._waits_for_earlier = False  # a server is ready, and an earlier goal may run
        self._new_id = new_id
        self._sent_before = 0
        self.seen_running = False  # the goal that it was attached to, by this call
        self._replacement: CallMachine | None = None  # the call that replaces this one
        self.previous: AttemptView | None = None  # the latest one with an end that is known
        self._last: fx.Ending | None = None  # its end, after the verdict

    def use_ids(self, id_of: Callable[[int], uuid.UUID], sent_before: int = 0) -> None:
        """Make the ids of later goals by the number of the attempt, from 1.

        Earlier calls with its key have sent so many goals before its first one.
        """
        self._sent_before = sent_before
        self._new_id = lambda: id_of(self._sent_before + self.attempts + 1)

    @property
    def abandoned(self) -> bool:
        """Whether its goal was left running on purpose."""
        return self.ending is not None and self.ending.abandoned

    # --- may another goal be sent? ---------------------------------------------------------

    def may_send(self) -> bool:
        """Whether another goal of this call may be sent now: this has the last word (C4.2)."""
        return all(self._allows_another(earlier) for earlier in self.earlier)

    def _allows_another(self, earlier: AttemptView) -> bool:
        if self._resend == "always":
            return True
        if earlier.goal.facts.blocks_another(unless_gone=self._resend == "server_gone"):
            return False
        # A goal that ended by itself is not sent again while its result may come (C4.3).
        ended_as = earlier.goal.awaits_result_of
        return ended_as is None or (ended_as is GoalState.CANCELED and earlier.cancel_is_ours)

    @property
    def number(self) -> int:
        """The number of the latest goal, from 1, with those of earlier calls with the key."""
        return self._sent_before + self.attempts

    @property
    def is_waiting(self) -> bool:
        """Whether a goal is to be sent, and waits for a server or for its turn."""
        return self.phase in (Phase.WAITING, Phase.QUEUED)

    @property
    def confirming(self) -> bool:
        """Whether a server in sight may still confirm that an earlier goal has stopped."""
        return any(earlier.goal.may_run for earlier in self.earlier)

    # --- the caller's wishes ---------------------------------------------------------------

    def begin(self, invalid: Exception | None, now: float) -> list[cx.Effect]:
        """The call begins; `invalid` is what is wrong with its goal, if anything."""
        if self.phase is not Phase.NEW:
            return []
        if invalid is not None:
            return self._end(fx.Ending(fx.End.INVALID, GoalState.REJECTED, error=invalid))
        return self._try(now)

    def give_up(self, why: CancelReason) -> list[cx.Effect]:
        """Its caller cancels or closes it while it has no goal in flight that could handle that."""
        if self._cancel_waits:
            return []
        if self.attaches and why is CancelReason.CANCELLED and self.is_before_goal:
            # The goal may run: it is cancelled as soon as a server is there.
            self._cancel_waits = True
            return [cx.AwaitEarlier()]
        if self.phase is Phase.JUDGING:
            # Its goal ended, and is not tried again. Wait for the verdict as for a cancellation.
            because = "the client was closed" if self.closes_because else "the call was cancelled"
            return [cx.CutJudging(because, at_once=False)]
        end = fx.End.CLOSED if why is CancelReason.CLOSED else fx.End.CANCELLED_BY_CALLER
        if self._last is None or self.is_waiting:
            return self._end(fx.Ending(end, GoalState.SENDING, given_up=True))
        # Nothing is cancelled now: the outcome describes the fate of the last goal.
        return self._end(fx.Ending(end, self._last.status, news=self._last.news, given_up=True))

    def was_done(self, result: Any, detail: str) -> list[cx.Effect]:
        """An earlier call with its key has succeeded, with this result."""
        ending = fx.Ending(fx.End.SUCCEEDED, GoalState.SUCCEEDED, result=result, from_ledger=True)
        return [fx.Record(GoalState.SUCCEEDED, detail), *self._end(ending)]

    def not_replacing(self, left: tuple[GoalReport, ...]) -> list[cx.Effect]:
        """The goals of the call that it was to replace may still run."""
        return self._end(
            fx.Ending(fx.End.NOT_REPLACING, GoalState.SENDING, earlier=left, given_up=True)
        )

    def replace_by(self, call: CallMachine) -> list[cx.Effect]:
        """Another call replaces it: its server stops the goal, and no other one is sent."""
        self._replacement = call
        return [] if self.attempt is not None else self.give_up(CancelReason.CANCELLED)

    @property
    def _is_replaced(self) -> bool:
        """Whether another goal has taken its place, or may do so yet."""
        call = self._replacement
        return call is not None and (call.phase is not Phase.ENDED or call.goals.accepted)

    @property
    def is_before_goal(self) -> bool:
        """Whether its first goal, or another one, is to be sent or followed soon."""
        return self.phase in (Phase.NEW, Phase.WAITING, Phase.QUEUED)

    def end_grace(self, why: str) -> list[cx.Effect]:
        """No time is left for confirmations."""
        if self._cancel_waits and self.is_before_goal:
            return [cx.StopAwaiting(), *self._end(self._ends_as)]
        if self.phase is Phase.CONFIRMING:
            return [cx.StopAwaiting(), *self._finish()]
        return [cx.CutJudging(why, at_once=True)] if self.phase is Phase.JUDGING else []

    def broke(self, error: BaseException) -> list[cx.Effect]:
        """Our own side failed while the call has no goal in flight that could handle that."""
        if self.phase in (Phase.CONFIRMING, Phase.JUDGING):
            return self.end_grace(self.closes_because)
        return self._end(fx.Ending(fx.End.LOST, GoalState.LOST, error=error))

    # --- until a goal is sent --------------------------------------------------------------

    def _try(self, now: float) -> list[cx.Effect]:
        if self.attempts:
            self.goal_id = self.latest_id = self._new_id()
            self.attaches = False
        self.attempts += 1
        sending = [] if self.attaches else [fx.Record(GoalState.SENDING)]
        return [*sending, *self._await_server(now)]

    def _await_server(self, now: float) -> list[cx.Effect]:
        self.phase = Phase.WAITING
        self._wait_until = None if self._server_limit is None else now + self._server_limit
        # Not `Timeouts.server`, which is for the time without any server.
        self._gone_by = self._deadline or max(now + LONGEST_LEASE, self._wait_until or now)
        self._waits_for_earlier = False
        return [cx.AwaitServer(self._wait_until)]

    def server_ready(self) -> list[cx.Effect]:
        """A server can be used, or an earlier goal is known not to run any more."""
        if self.phase is not Phase.WAITING:
            return []
        if self._ends_as.end is fx.End.NO_SERVER:  # not any more
            self._ends_as = replace(self._ends_as, end=fx.End.DEADLINE, phase="accept")
        self.phase = Phase.QUEUED
        return [cx.Queue()]

    def server_lost(self, now: float) -> list[cx.Effect]:
        """No server is ready any more; the goal may be in the queue."""
        waits_for_earlier = self.phase is Phase.WAITING and self._waits_for_earlier
        return self._await_server(now) if waits_for_earlier or self.phase is Phase.QUEUED else []

    def type_mismatch(self, served: tuple[str, ...]) -> list[cx.Effect]:
        """The name is served with other types only."""
        if self.phase is not Phase.WAITING:
            return []
        return self._end(fx.Ending(fx.End.TYPE_MISMATCH, GoalState.SENDING, served=served))

    def turn(self, now: float) -> list[cx.Effect]:
        """It is the goal's turn to be sent."""
        if self.phase is not Phase.QUEUED:
            return []
        if self.unwanted and not self.attaches:  # `cancel` is about to run on this thread
            return self.give_up(CancelReason.CANCELLED)
        if effects := self._end_for_others():
            return effects
        too_late = self._is_late(now) and not self._cancel_waits
        if too_late or not self.may_send():
            self.phase = Phase.WAITING
            in_doubt = not all(each.goal.facts.is_over for each in self.earlier)
            self._waits_for_earlier = in_doubt and self._resend == "server_gone"
            until = self._gone_by if self._waits_for_earlier else self._wait_until
            return [cx.AwaitServer(until, another=True)]
        self.phase = Phase.TRYING
        return [cx.Send()]

    def waited(self, now: float, *, ready: bool, cancels: bool = False) -> list[cx.Effect]:
        """The time to wait for a server is over, or the deadline has passed.

        `ready` means that a server is ready now. With `cancels`, a goal that somebody else has sent
        is to be cancelled.
        """
        late = self._is_late(now)
        if self._cancel_waits:
            self.is_late |= late
            return []
        if self.phase is Phase.NEW:
            return self._too_late("replace", "waiting for the goal that it replaces to stop")
        cancels &= late and self.attaches
        if self.phase is Phase.QUEUED:
            return self._too_late("accept", "waiting to be sent", cancels=cancels)
        if self.phase is Phase.PAUSING and self._last is not None:
            return self._end(replace(self._last, not_retried="the pause reached the deadline"))
        if self.phase is not Phase.WAITING:
            return []
        if effects := self._end_for_others():
            return effects
        effects = [fx.Record(GoalState.TIMED_OUT, "waiting for a server"), cx.StopRetrying()]
        # If it had a server before, it continues with the ending from that server (C2.7).
        in_flight = bool(self.goals.may_run)
        if self.previous is not None and (in_flight or not late):
            self.goal_id = self.previous.goal_id
        ending = fx.Ending(fx.End.NO_SERVER, GoalState.TIMED_OUT, given_up=True)
        ready |= self._waits_for_earlier
        ending = after_no_server(ending, self._last, self._server_limit, late, ready, in_flight)
        if cancels:
            return [effects[0], *self._await_to_cancel(ending)]
        return effects + (self._end if late or self._last is None else self._plan)(ending)

    def _too_late(self, phase: str, detail: str, *, cancels: bool = False) -> list[cx.Effect]:
        """The deadline has passed, and nothing was sent."""
        ending = fx.Ending(fx.End.DEADLINE, GoalState.TIMED_OUT, phase=phase, given_up=True)
        end = self._await_to_cancel if cancels else self._end
        return [fx.Record(GoalState.TIMED_OUT, detail), *end(ending)]

    def _await_to_cancel(self, ending: fx.Ending) -> list[cx.Effect]:
        """Cancel the goal that it was to follow, if a server comes soon; else end like this."""
        self._cancel_waits = self.is_late = True
        self._ends_as = ending
        return [cx.AwaitEarlier()]

    def _is_late(self, now: float) -> bool:
        return self._deadline is not None and now >= self._deadline

    def send_failed(self, error: Exception) -> list[cx.Effect]:
        """The middleware did not accept the goal."""
        return self._end(fx.Ending(fx.End.INVALID, GoalState.SENDING, error=error))

    def sent(self, attempt: AttemptView) -> None:
        """The middleware has the goal, or it is followed."""
        self.attempt = attempt
        self._cancel_waits = False
        self.goals.add(attempt.goal.facts)

    # --- what happens to goals -------------------------------------------------------------

    def ended(self, attempt: AttemptView, ending: fx.Ending) -> list[cx.Effect]:
        """The current attempt ended; its goal may still run."""
        if attempt is not self.attempt or self.ending is not None:
            return []
        self.previous = attempt
        # A goal that has ended by itself stays in the list until its result has come (C4.3).
        self.earlier = [
            each
            for each in (*self.earlier, attempt)
            if not each.goal.facts.is_over or each.goal.awaits_result_of
        ]
        self.attempt = None
        return self._judge(ending)

    def late_result(self, attempt: AttemptView, state: GoalState, result: Any) -> list[cx.Effect]:
        """An earlier goal turns out to have finished: that is the call's end (C4.3, C4.4)."""
        canceled = state is GoalState.CANCELED
        if attempt not in self.earlier or self.attempt is not None:
            return []
        if canceled and attempt.cancel_is_ours:
            return []
        effects: list[cx.Effect] = [cx.StopRetrying()]
        if self.phase is Phase.CONFIRMING:
            self.ending = None
            effects.append(cx.StopAwaiting())
        self.previous, self.goal_id = attempt, attempt.goal_id
        rejected = state is GoalState.REJECTED
        end = fx.End.CANCELED_BY_OTHER if canceled else fx.End[state.name]
        return effects + self._judge(fx.Ending(end, state, result=result, rejected=rejected))

    def earlier_over(self) -> list[cx.Effect]:
        """An earlier goal is known not to run any more, or its server went out of sight."""
        if self.phase is Phase.CONFIRMING and not self.confirming:
            return [cx.StopAwaiting(), *self._finish()]
        return []

    # --- what follows from an end ----------------------------------------------------------

    def judged(
        self, ending: fx.Ending, error: BaseException | None, verdict: Verdict | fx.Fault
    ) -> list[cx.Effect]:
        """The verdict on the end of an attempt is known (C3.3)."""
        if self.ending is not None:
            return []  # cancelled or closed in the meantime
        effects: list[cx.Effect] = [cx.Count(success=True)] if verdict is Verdict.SUCCESS else []
        if verdict in (Verdict.TRANSIENT, Verdict.PERMANENT) and self._had_failed(ending):
            return self._send_anew()
        self._last = ending = apply_verdict(ending, verdict)
        # A goal that somebody else cancelled is never tried again, even with this verdict (C4.4).
        if verdict is not Verdict.TRANSIENT or ending.end is fx.End.CANCELED_BY_OTHER:
            return effects + self._end(ending)
        effects.append(cx.Count(success=False))
        if end := self._end_for_others():
            return effects + end
        why = "its caller no longer wants it" if self.unwanted else self.closes_because
        if self._replacement is not None:
            why = "its caller has sent another goal in its place"
        if why:
            return effects + self._end(replace(ending, not_retried=why))
        self.cause = error or RejectedByClassifier()
        return effects + self._plan(ending)

    def _had_failed(self, ending: fx.Ending) -> bool:
        """Whether the goal of an earlier call with the key had failed before this call."""
        earlier = self._keyed and self.attaches and not self.seen_running
        ends = self.unwanted or self.closes_because or self._replacement is not None
        return earlier and ending.end in _HAD_FAILED and not ends

    def _send_anew(self) -> list[cx.Effect]:
        """Send another goal, as the first one of this call."""
        self._sent_before += 1
        self.attempts, self.attaches, self.previous = 0, False, None
        self.goal_id = self.latest_id = self._new_id()
        self.phase = Phase.PAUSING
        return [cx.Pause(0.0)]

    def planned(self, ending: fx.Ending, plan: Retry | GiveUp | fx.Fault) -> list[cx.Effect]:
        """The policy has decided whether there is another attempt."""
        if isinstance(plan, fx.Fault):
            return self._end(replace(ending, strategy_fault=plan))
        if isinstance(plan, GiveUp):
            waited = f"{ending.not_retried}, and " if ending.not_retried else ""
            return self._end(replace(ending, not_retried=waited + plan.reason))
        self.phase = Phase.PAUSING
        return [fx.Record(GoalState.RETRYING, f"in {plan.seconds:.2f} s"), cx.Pause(plan.seconds)]

    def resume(self, now: float) -> list[cx.Effect]:
        """The pause is over."""
        if self._last is None and self._is_late(now):
            return self._too_late("accept", "waiting to be sent")
        return self._end_for_others() or self._try(now)

    def _end_for_others(self) -> list[cx.Effect]:
        """End if somebody else was seen to cancel a goal, also after the verdict (C4.4)."""
        if self._last is None or self.previous is None or not self.goals.others_cancel:
            return []
        self.goal_id = self.previous.goal_id  # a new one may have been made since then
        return self._end(replace(self._last, not_retried="somebody else has cancelled it"))

    def _judge(self, ending: fx.Ending) -> list[cx.Effect]:
        if ending.end in _STOPPED and self._is_replaced:
            return self._end(replace(ending, end=fx.End.CANCELLED_BY_CALLER, given_up=True))
        self.phase = Phase.JUDGING
        return [cx.Judge(ending)]

    def _plan(self, ending: fx.Ending) -> list[cx.Effect]:
        self.phase = Phase.PLANNING
        return [cx.Plan(ending)]

    # --- the end ---------------------------------------------------------------------------

    def _end(self, ending: fx.Ending) -> list[cx.Effect]:
        if self.ending is not None:
            return []
        if ending.end is fx.End.CLOSED:
            ending = replace(ending, lost_because=self.closes_because)
        self.ending = ending
        if ending.end in _GIVEN_UP and self.confirming:
            self.phase = Phase.CONFIRMING
            return [cx.StopRetrying(), cx.AwaitEarlier()]
        return [cx.StopRetrying(), *self._finish()]

    def _finish(self) -> list[cx.Effect]:
        """End with what is known now about all goals (C2.8)."""
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
                result=None,  # only a late success is useful
            )
            if self.goal_id not in may_run:
                self.goal_id = may_run[-1]
        effects: list[cx.Effect] = []
        if ending.end is fx.End.CANCELLED_BY_CALLER and self._is_replaced:
            assert self._replacement is not None
            ending = replace(ending, end=fx.End.REPLACED, status=GoalState.REPLACED)
            effects.append(fx.Record(GoalState.REPLACED, f"by goal {self._replacement.goal_id}"))
        self.ending = ending
        # They keep the call, or later calls, alive while they are watched.
        self.previous, self.earlier, self._replacement = None, [], None
        return [*effects, cx.Finish(ending)]
