"""One call: its attempts in turn, and the future that its user holds.

All of it but `begin` and `request_cancel` happens on the communication thread.
"""

from __future__ import annotations

import time
import uuid
from dataclasses import replace
from functools import partial
from typing import Any, Protocol

from actionkit._calls.attempt import Attempt
from actionkit._calls.call_record import ActionView, CallRecord
from actionkit._calls.call_view import GoalsOfCall
from actionkit._calls.classify import apply_verdict
from actionkit._calls.classify_runner import ClassifyRunner
from actionkit._calls.explain import CLIENT_CLOSED
from actionkit._calls.future import GoalFuture
from actionkit._calls.request import Request
from actionkit._calls.retry import GiveUp, RejectedByClassifier, Retry, after_no_server
from actionkit._calls.retry_runner import RetryRunner
from actionkit._goal import effects as fx
from actionkit._goal.stages import Stage
from actionkit._model.settings import Timeouts
from actionkit._model.values import GoalState, Verdict
from actionkit._observers.dispatcher import NO_OBSERVERS, ObserverDispatcher
from actionkit._threads.clock import TimerHandle
from actionkit._threads.function_runner import Clock


class Carrier(ActionView, Clock, Protocol):
    """The client's side of a call: what carries its goals."""

    def attempt(
        self,
        goal_id: uuid.UUID,
        goal: Any,
        timeouts: Timeouts,
        deadline: float | None,
        owner: Call,
        *,
        resent: bool,
    ) -> Attempt: ...
    def server_is_ready(self) -> bool: ...
    def begin(self, call: Call) -> None: ...
    def finished(self, call: Call) -> None: ...


class Call:
    """Carries a request through to the settling of its future."""

    def __init__(
        self, carrier: Carrier, request: Request, dispatcher: ObserverDispatcher = NO_OBSERVERS
    ) -> None:
        """Take note of a request; its time runs from now."""
        self.goals = GoalsOfCall()
        self.goal_id = uuid.uuid4()
        self.state = GoalState.SENDING
        self.cancel_grace = request.timeouts.cancel
        self._carrier = carrier
        self._request = request
        self._record = record = CallRecord(carrier, request, dispatcher, self.goal_id)
        self.timeline, tape, began = record.timeline, record.tape, record.began
        self._deadline = None if request.timeout is None else began + request.timeout
        threads = request.function_pool
        self._retrying = RetryRunner(carrier, threads, request.retry, request.budget, began)
        self._judging = ClassifyRunner(carrier, threads, request.classify)
        self.future: GoalFuture[Any, Any] = GoalFuture(self, tape, request.pool, carrier)
        self._attempt: Attempt | None = None
        self._previous: Attempt | None = None
        self._earlier: list[Attempt] = []  # all whose goal may run, but for the one under way
        self._attempts = 0
        self._pause: TimerHandle | None = None
        self._last: fx.Ending | None = None  # of the last attempt, judged, which is tried again
        self._cause: BaseException = RejectedByClassifier()  # the same, for strategies
        self._ending: fx.Ending | None = None
        self._given_up_at: float | None = None
        self._grace: TimerHandle | None = None  # until which the earlier goals may be confirmed
        self._settled = False
        self._closing = ""  # why, as a clause: calls end, and nothing is tried again
        self.unwanted = False
        """Whether the caller cancelled, even if this thread has not come to it yet (C1.5)."""
        self.urgent = False
        """Whether a human waits for the cancellation (C2.5)."""

    # --- the caller's wishes ---------------------------------------------------------------

    def begin(self) -> None:
        """Start soon, and be counted. From any thread; calls start in this order."""
        self._carrier.begin(self)

    def request_cancel(self, *, urgent: bool = False) -> None:
        """Cancel soon. From any thread.

        Args:
            urgent: Whether a human waits for it: such goals are cancelled first.
        """
        self.unwanted = True
        self.urgent |= urgent
        self._carrier.call_soon(self.cancel)

    def start(self) -> None:
        """Begin the first attempt. The carrier calls it."""
        if self.unwanted:
            self.cancel()
        if self._ending is not None:
            return  # cancelled or closed before it began
        if self._request.invalid is not None:
            self._end(fx.Ending(fx.End.INVALID, GoalState.REJECTED, error=self._request.invalid))
            return
        self._try(resent=False)

    def cancel(self) -> None:
        """Cancel the goal, or end the call where none is under way."""
        self._given_up_at = self._given_up_at or time.monotonic()
        if self._attempt is not None:
            self._attempt.cancel()
        else:
            self._end_idle(fx.End.CANCELLED_BY_CALLER, "the call was cancelled")

    def close(self, *, abandon: bool, because: str = CLIENT_CLOSED) -> None:
        """End because the client closes, or something else that calls depend on."""
        self._closing = because
        self._given_up_at = self._given_up_at or time.monotonic()
        if self._attempt is not None:
            self._attempt.close(abandon=abandon)
        else:
            self._end_idle(fx.End.CLOSED, "the client was closed")

    def _end_idle(self, end: fx.End, why: str) -> None:
        """End a call that has no goal under way: it has not begun, is judged, or pauses."""
        if self._judging.under_way:
            # Its goal ended, and is not tried again; the verdict is waited for like a cancel.
            within = f"{why}, and it did not answer within {self.cancel_grace:g} s"
            self._judging.cut_short(time.monotonic() + self.cancel_grace, within)
        elif self._last is None:
            self._end(fx.Ending(end, GoalState.SENDING, given_up=True))
        else:
            # Nothing is cancelled now: what is told is the fate of the last goal, and no more.
            self._end(fx.Ending(end, self._last.status, fate=self._last.fate, given_up=True))

    def end_grace(self) -> None:
        """End a call that was closed: there is no more time for confirmations."""
        self._end_grace()
        if self._attempt is not None:
            self._attempt.end_grace()
        else:
            self._judging.end("the client was closed")

    def fail(self, reason: str, error: BaseException) -> None:
        """End because this side broke."""
        self._closing = reason  # nothing fires any more that could try again
        if self._attempt is not None:
            self._attempt.fail(reason, error)
        elif self._judging.under_way:
            self._judging.end(reason)
        else:
            self._end(fx.Ending(fx.End.LOST, GoalState.LOST, error=error))
        self._end_grace()
        if self._ending is not None:
            self._settle()  # the timer that ends the wait for callbacks fires no more

    def refuse(self, reason: str) -> None:
        """End before anything was sent, because this side cannot send."""
        self._end(fx.Ending(fx.End.LOST, GoalState.SENDING, lost_because=reason))

    # --- attempts --------------------------------------------------------------------------

    def _try(self, *, resent: bool) -> None:
        """Begin an attempt; with `resent`, of the goal that the server may have by now."""
        if resent:
            assert self._previous is not None
            self._previous.supersede()
            self._earlier.remove(self._previous)
        elif self._attempts:
            self.goal_id = uuid.uuid4()
        self._attempts += 1
        self._attempt = self._carrier.attempt(
            self.goal_id,
            self._request.goal,
            self._request.timeouts,
            self._deadline,
            self,
            resent=resent,
        )
        self._attempt.number = self._attempts
        if resent:
            assert self._previous is not None
            self._attempt.goal.facts = self._previous.goal.facts
        self.goals.add(self._attempt.goal.facts)
        self._attempt.start()
        self._reconcile()

    def may_send(self, attempt: Attempt) -> bool:
        """Whether an attempt may send its goal now: the only place that decides it (C4.2)."""
        return all(self._allows_another(earlier) for earlier in self._earlier)

    def _allows_another(self, earlier: Attempt) -> bool:
        resend = self._request.retry.resend
        if resend == "always" or not earlier.goal.facts.may_run:
            return True
        return resend == "server_gone" and earlier.is_out_of_sight

    def _reconcile(self) -> None:
        """Ask a server that is there about goals that were lost with another (C4.3)."""
        for earlier in list(self._earlier):
            if earlier.goal.stage is Stage.LOST and self._carrier.server_is_ready():
                earlier.on_server_ready()

    def on_over(self, attempt: Attempt) -> None:
        """An attempt's goal is known to run no more, or its server went out of sight."""
        current = self._attempt
        if self._grace is not None and not self._confirming:
            self._end_grace()
        elif attempt in self._earlier and current is not None and self._carrier.server_is_ready():
            current.on_server_ready()

    @property
    def _confirming(self) -> bool:
        """Whether a server in sight may yet confirm that an earlier goal runs no more."""
        return any(earlier.goal.may_run for earlier in self._earlier)

    def on_late_result(self, attempt: Attempt, state: GoalState, result: Any) -> None:
        """An earlier goal has proved to have finished: that is the call's end (C4.3, C4.4)."""
        canceled = state is GoalState.CANCELED
        if attempt not in self._earlier or (self._ending is not None and self._grace is None):
            return
        current = self._attempt
        if (canceled and attempt.cancel_is_ours) or (current and current.goal.in_flight):
            return
        if current is not None:
            self._attempt = None
            current.withdraw()
        if self._grace is not None:
            self._carrier.cancel_timer(self._grace)
            self._grace = self._ending = None
        self._stop_retrying()
        self.goal_id = attempt.goal_id
        rejected = state is GoalState.REJECTED
        progress = fx.GoalProgress.REJECTED if rejected else fx.GoalProgress.ACCEPTED
        end = fx.End.CANCELED_BY_OTHER if canceled else fx.End[state.name]
        self._judge(fx.Ending(end, state, result=result, progress=progress))

    # --- what the attempt tells ------------------------------------------------------------

    def on_record(self, attempt: Attempt, record: fx.Record) -> None:
        """Write the timeline; also after the end, for the log of a goal given up on."""
        self._record.note(
            attempt.goal_id, attempt.number, record.state, record.detail, record.cancel_refused
        )
        if not self._settled and attempt is self._attempt:
            self.state = record.state

    def on_feedback(self, attempt: Attempt, messages: list[bytes]) -> None:
        """Pass feedback on, undecoded."""
        if not self._settled and attempt is self._attempt:
            self._record.note_feedback(attempt, messages)

    def on_end(self, attempt: Attempt, ending: fx.Ending) -> None:
        """Judge how the attempt ended, and end the call or try again."""
        if attempt is not self._attempt or self._ending is not None:
            return
        never_sent = ending.progress is fx.GoalProgress.NEVER_SENT
        if not never_sent or attempt.goal.stage is not Stage.OVER:
            self._previous = attempt
            self._earlier = [e for e in (*self._earlier, attempt) if e.goal.facts.may_run]
        self._attempt = None
        if ending.end is fx.End.NO_SERVER:
            self._waited_in_vain(ending)
        else:
            self._judge(ending)

    def _waited_in_vain(self, ending: fx.Ending) -> None:
        """End the call that found no server, or go on with what came of the one it had (C2.7)."""
        late = self._deadline is not None and time.monotonic() >= self._deadline
        ready, in_flight = self._carrier.server_is_ready(), bool(self.goals.may_run)
        if self._previous is not None and (in_flight or not late):
            self.goal_id = self._previous.goal_id  # that is the goal which is told of
        limit = self._request.timeouts.server
        ending = after_no_server(ending, self._last, limit, late, ready, in_flight)
        if late or self._last is None:
            self._end(ending)
        else:
            self._plan(ending)

    def _judge(self, ending: fx.Ending) -> None:
        if ending.end is fx.End.SUCCEEDED and self._request.classify is None:
            self._judged(ending, None, Verdict.SUCCESS)  # most are: no outcome is made for it
        else:
            outcome = self._record.outcome(ending, self.goal_id, self._attempts)
            self._judging.begin(ending, outcome, time.monotonic(), self._deadline, self._judged)

    def _judged(
        self, ending: fx.Ending, error: BaseException | None, verdict: Verdict | fx.Fault
    ) -> None:
        if self._ending is not None:
            return  # cancelled or closed meanwhile
        if verdict is Verdict.SUCCESS:
            self._request.budget.on_success()
        self._last = ending = apply_verdict(ending, verdict)
        # What somebody else cancelled is not tried again, whatever `classify=` says (C4.4).
        if verdict is not Verdict.TRANSIENT or ending.end is fx.End.CANCELED_BY_OTHER:
            self._end(ending)
            return
        self._request.budget.on_transient_failure()
        if self.unwanted or self._closing:
            self._end(replace(ending, not_retried="its caller no longer wants it"))
            return
        self._cause = error or RejectedByClassifier()
        self._plan(ending)

    def _plan(self, ending: fx.Ending) -> None:
        clock, planned = time.monotonic, partial(self._planned, ending)
        self._retrying.begin(ending, self._cause, self._attempts, clock, self._deadline, planned)

    def _planned(self, ending: fx.Ending, plan: Retry | GiveUp | fx.Fault) -> None:
        if isinstance(plan, fx.Fault):
            self._end(replace(ending, strategy_fault=plan))
        elif isinstance(plan, GiveUp):
            waited = f"{ending.not_retried}, and " if ending.not_retried else ""
            self._end(replace(ending, not_retried=waited + plan.reason))
        else:
            pause = f"in {plan.seconds:.2f} s"
            self._record.note(self.goal_id, self._attempts, GoalState.RETRYING, pause)
            self.state = GoalState.RETRYING
            until = time.monotonic() + plan.seconds
            self._pause = self._carrier.call_at(until, lambda: self._resume(resent=plan.same_id))

    def _resume(self, *, resent: bool) -> None:
        self._pause = None
        previous = self._previous
        stage = None if previous is None else previous.goal.stage
        if resent and stage is Stage.ACCEPTED:
            # Accepted after all, in the pause: it was cancelled then, and has not ended so far.
            assert self._last is not None
            self._end(replace(self._last, not_retried="it was accepted late, and may still run"))
            return
        self._try(resent=resent and stage is Stage.SENT)

    # --- the end ---------------------------------------------------------------------------

    def _end(self, ending: fx.Ending) -> None:
        if self._ending is not None:
            return
        if ending.end is fx.End.CLOSED:
            ending = replace(ending, lost_because=self._closing)
        self._ending = ending
        self._stop_retrying()
        given_up = ending.end in (fx.End.CANCELLED_BY_CALLER, fx.End.CLOSED)
        if given_up and self._given_up_at is not None and self._confirming:
            until = self._given_up_at + self.cancel_grace
            self._grace = self._carrier.call_at(until, self._end_grace)
        else:
            self._finish()

    def _end_grace(self) -> None:
        if self._grace is not None:
            self._carrier.cancel_timer(self._grace)
            self._grace = None
            self._finish()

    def _finish(self) -> None:
        """End with what is known by now of all goals (C2.8)."""
        ending = self._ending
        assert ending is not None
        if may_run := self.goals.may_run:
            if ending.end is fx.End.CANCELLED_BY_CALLER:  # which means that nothing runs
                unconfirmed, late = fx.End.DEADLINE, GoalState.TIMED_OUT
                ending = replace(ending, end=unconfirmed, status=late, phase="cancel")
                if self.goal_id not in may_run:
                    self.goal_id = may_run[-1]  # that is the goal which is told of
            self._ending = ending = replace(ending, may_run=may_run)
        self._record.await_callbacks(ending, self._carrier, self._settle)

    def _stop_retrying(self) -> None:
        self._retrying.drop()
        if self._pause is not None:
            self._carrier.cancel_timer(self._pause)
            self._pause = None

    def _settle(self) -> None:
        if self._settled:
            return
        self._settled = True
        self._previous, self._earlier = None, []  # they hold this call while they are watched
        ending = self._ending
        assert ending is not None
        self.state = ending.status
        self._record.end_feedback()
        outcome = self._record.outcome(ending, self.goal_id, self._attempts)
        self._record.tell_outcome(outcome)
        self._carrier.finished(self)  # first: who sees the end sees it counted out (C1.11)
        self.future._settle(outcome, ending.end)
