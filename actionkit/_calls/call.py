"""One call: its attempts in turn, and the future that its user holds.

All of it but `begin` and `request_cancel` happens on the communication thread.
"""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, Protocol

from actionkit._calls.attempt import Attempt
from actionkit._calls.classify import apply_verdict
from actionkit._calls.classify_runner import ClassifyRunner
from actionkit._calls.explain import Story, explain
from actionkit._calls.feedback_broadcast import FeedbackBroadcast
from actionkit._calls.future import GoalFuture
from actionkit._calls.graph_snapshot import GraphSnapshot
from actionkit._calls.request import Request
from actionkit._calls.retry import GiveUp, RejectedByClassifier, Retry
from actionkit._calls.retry_runner import RetryRunner
from actionkit._goal import effects as fx
from actionkit._goal.stages import Stage
from actionkit._messages.lazy import LazyMessage
from actionkit._model.settings import Timeouts
from actionkit._model.timeline import Recorder
from actionkit._model.values import CancelReport, GoalEvent, GoalState, Outcome, Verdict
from actionkit._observers.dispatcher import NO_OBSERVERS, ObserverDispatcher
from actionkit._threads.clock import TimerHandle

_LAST_FEEDBACK_GRACE = 0.05
"""Seconds that a result waits for callbacks that are quick; slow ones do not delay it (C1.8)."""
_LATE = {
    GoalState.SUCCEEDED: fx.End.SUCCEEDED,
    GoalState.ABORTED: fx.End.ABORTED,
    GoalState.REJECTED: fx.End.REJECTED,
}
_UNDECIDED = "a server is there, but has not said whether the goal still runs"
_NOBODY_BACK = "its server went away, and no server has come back"
_NEVER_AGAIN = {fx.End.CANCELED_BY_OTHER}
"""Whatever the cause and the judgement (C4.4)."""
_WITH_RESULT = {fx.End.SUCCEEDED, fx.End.ABORTED, fx.End.CANCELED_BY_OTHER}


class Carrier(Protocol):
    """The client's side of a call: what carries its goals."""

    action_name: str
    type_name: str

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
    def decode_feedback(self, message: bytes) -> Any: ...
    def graph_snapshot(self) -> GraphSnapshot: ...
    def call_soon(self, callback: Callable[[], None]) -> None: ...
    def call_at(self, at: float, callback: Callable[[], None]) -> TimerHandle: ...
    def cancel_timer(self, handle: TimerHandle) -> None: ...
    def begin(self, call: Call) -> None: ...
    def finished(self, call: Call) -> None: ...


class Call:
    """Carries a request through to the settling of its future."""

    def __init__(
        self, carrier: Carrier, request: Request, audience: ObserverDispatcher = NO_OBSERVERS
    ) -> None:
        """Take note of a request; its time runs from now."""
        self.goal_id = uuid.uuid4()
        self.state = GoalState.SENDING
        self.timeline = Recorder()
        self.cancel_grace = request.timeouts.cancel
        self._carrier = carrier
        self._request = request
        self._began = time.monotonic()
        self._audience = audience
        self._info = audience.call_info(
            self.goal_id, request.goal, monotonic=self._began, wall=time.time()
        )
        self._deadline = None if request.timeout is None else self._began + request.timeout
        threads = request.function_pool
        self._retrying = RetryRunner(carrier, threads, request.retry, request.budget, self._began)
        self._judging = ClassifyRunner(carrier, threads, request.classify)
        self._tape: FeedbackBroadcast[Any] = FeedbackBroadcast()
        self.future: GoalFuture[Any, Any] = GoalFuture(self, self._tape, request.pool)
        self._attempt: Attempt | None = None
        self._previous: Attempt | None = None
        self._attempts = 0
        self._pause: TimerHandle | None = None
        self._last: fx.Ending | None = None  # of the attempt before the pause
        self._ending: fx.Ending | None = None
        self._settled = False
        self._closing = False
        self._grace: TimerHandle | None = None
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
            self._end(fx.Ending(fx.End.INVALID, GoalState.REJECTED, info=self._request.invalid))
            return
        self._try(resent=False)

    def cancel(self) -> None:
        """Cancel the goal, or end the call where none is under way."""
        if self._attempt is not None:
            self._attempt.cancel()
        elif self._judging.under_way:
            self._cut_judging_short("the call was cancelled")
        else:
            self._end(self._idle(fx.End.CANCELLED_BY_CALLER))

    def close(self, *, abandon: bool) -> None:
        """End because the client closes."""
        self._closing = True
        if self._attempt is not None:
            self._attempt.close(abandon=abandon)
        elif self._judging.under_way:
            self._cut_judging_short("the client was closed")
        else:
            self._end(self._idle(fx.End.CLOSED))

    def _cut_judging_short(self, why: str) -> None:
        """What ended is judged, and not tried again; that takes no longer than a cancel."""
        within = f"{why}, and it did not answer within {self.cancel_grace:g} s"
        self._judging.cut_short(time.monotonic() + self.cancel_grace, within)

    def end_grace(self) -> None:
        """End a call that was closed: there is no more time for confirmations."""
        if self._attempt is not None:
            self._attempt.end_grace()
        else:
            self._judging.end("the client was closed")

    def fail(self, reason: str, error: BaseException) -> None:
        """End because this side broke."""
        self._closing = True  # nothing fires any more that could try again
        if self._attempt is not None:
            self._attempt.fail(reason, error)
        elif self._judging.under_way:
            self._judging.end(reason)
        else:
            self._end(fx.Ending(fx.End.LOST, GoalState.LOST, info=error))
        if self._ending is not None:
            self._settle()  # the timer that ends the wait for callbacks fires no more

    def refuse(self, reason: str) -> None:
        """End before anything was sent, because this side cannot send."""
        self._end(fx.Ending(fx.End.LOST, GoalState.SENDING, info=reason))

    def _idle(self, end: fx.End) -> fx.Ending:
        """The ending of a call that has no attempt under way: not begun, judged, or pausing."""
        if self._last is None:
            return fx.Ending(end, GoalState.SENDING, cancel=CancelReport.NOT_NEEDED)
        stopped = self._last.known is fx.Known.STOPPED
        report = CancelReport.NOT_NEEDED if stopped else CancelReport.UNKNOWN
        return replace(self._last, end=end, cancel=report, phase="", result=None)

    # --- attempts --------------------------------------------------------------------------

    def _try(self, *, resent: bool) -> None:
        """Begin an attempt; with `resent`, of the goal that the server may have by now."""
        if resent:
            assert self._previous is not None
            self._previous.supersede()
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
        self._attempt.start()
        self._reconcile()

    def may_send(self, attempt: Attempt) -> bool:
        """Whether an attempt may send its goal: never while an earlier one may run (C4.2)."""
        previous = self._previous
        return (
            previous is None
            or self._request.retry.resend == "always"
            or not previous.goal.in_flight
        )

    def _reconcile(self) -> None:
        """Ask a server that is there about a goal that was lost with another (C4.3)."""
        previous = self._previous
        lost = previous is not None and previous.goal.stage is Stage.LOST
        if previous is not None and lost and self._carrier.server_is_ready():
            previous.on_server_ready()

    def on_over(self, attempt: Attempt) -> None:
        """An attempt is known to run no more."""
        current = self._attempt
        if attempt is self._previous and current is not None and self._carrier.server_is_ready():
            current.on_server_ready()

    def on_late_result(self, attempt: Attempt, state: GoalState, result: Any) -> None:
        """An earlier goal has proved to have finished: that is the call's end (C4.3, C4.4)."""
        end = _LATE.get(state)
        if state is GoalState.CANCELED and not attempt.cancel_is_ours:
            end = fx.End.CANCELED_BY_OTHER
        current = self._attempt
        if end is None or attempt is not self._previous or self._ending is not None:
            return
        if current is not None and current.goal.in_flight:
            return
        if current is not None:
            self._attempt = None
            current.withdraw()
        self._stop_retrying()
        self.goal_id = attempt.goal_id
        rejected = state is GoalState.REJECTED
        reached = fx.Reached.REJECTED if rejected else fx.Reached.ACCEPTED
        self._last = fx.Ending(end, state, result=result, reached=reached)
        self._judge(self._last)

    # --- what the attempt tells ------------------------------------------------------------

    def on_record(self, attempt: Attempt, state: GoalState, detail: str) -> None:
        """Write the timeline; also after the end, for the log of a goal given up on."""
        self._note(attempt.goal_id, attempt.number, state, detail)
        if not self._settled and attempt is self._attempt:
            self.state = state

    def on_feedback(self, attempt: Attempt, messages: list[bytes]) -> None:
        """Pass feedback on, undecoded."""
        if self._settled or attempt is not self._attempt:
            return
        handful = [LazyMessage(self._carrier.decode_feedback, message) for message in messages]
        goal_id = attempt.goal_id
        numbers = self.timeline.count_feedback(goal_id, len(handful))
        each = self._audience.hears_feedback
        for number, one in zip(numbers, handful, strict=True):
            if each or number in (1, numbers[-1]):  # the timeline keeps no others
                self._note(goal_id, attempt.number, GoalState.FEEDBACK, f"no. {number}", one)
        self._tape.put(*handful)
        if self._request.callbacks is not None:
            self._request.callbacks.put(*handful)

    def on_end(self, attempt: Attempt, ending: fx.Ending) -> None:
        """Judge how the attempt ended, and end the call or try again."""
        if attempt is not self._attempt or self._ending is not None:
            return
        earlier = self._previous
        if ending.end is fx.End.NO_SERVER and earlier and earlier.goal.in_flight:
            # Something was sent before this attempt, and its caller has to hear of that.
            reason = _UNDECIDED if self._carrier.server_is_ready() else _NOBODY_BACK
            self.goal_id = earlier.goal_id
            ending = replace(ending, end=fx.End.LOST, status=GoalState.LOST, info=reason)
        if attempt.goal.stage is not Stage.OVER or ending.reached is not fx.Reached.NEVER_SENT:
            self._previous = attempt
        self._last, self._attempt = ending, None
        self._judge(ending)

    def _judge(self, ending: fx.Ending) -> None:
        if ending.end is fx.End.SUCCEEDED and self._request.classify is None:
            self._judged(ending, None, Verdict.SUCCESS)  # most are: no outcome is made for it
        else:
            now = time.monotonic()
            self._judging.begin(ending, self._outcome(ending), now, self._deadline, self._judged)

    def _judged(
        self, ending: fx.Ending, error: BaseException | None, verdict: Verdict | fx.Fault
    ) -> None:
        if self._ending is not None:
            return  # cancelled or closed meanwhile
        if verdict is Verdict.SUCCESS:
            self._request.budget.on_success()
        ending = apply_verdict(ending, verdict)
        if verdict is not Verdict.TRANSIENT or ending.end in _NEVER_AGAIN:
            self._end(ending)
            return
        self._request.budget.on_transient_failure()
        if self.unwanted or self._closing:
            self._end(replace(ending, note="its caller no longer wants it"))
            return
        cause = error or RejectedByClassifier()
        clock, planned = time.monotonic, partial(self._planned, ending)
        self._retrying.begin(ending, cause, self._attempts, clock, self._deadline, planned)

    def _planned(self, ending: fx.Ending, plan: Retry | GiveUp | fx.Fault) -> None:
        if isinstance(plan, fx.Fault):
            self._end(replace(ending, strategy=plan))
        elif isinstance(plan, GiveUp):
            self._end(replace(ending, note=plan.reason))
        else:
            self._pause_for(plan)

    def _pause_for(self, plan: Retry) -> None:
        pause = f"in {plan.seconds:.2f} s"
        self._note(self.goal_id, self._attempts, GoalState.RETRYING, pause)
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
            self._end(replace(self._last, note="the goal was accepted late, and may still run"))
            return
        self._try(resent=resent and stage is Stage.SENT)

    # --- the end ---------------------------------------------------------------------------

    def _end(self, ending: fx.Ending) -> None:
        if self._ending is not None:
            return
        earlier = self._previous
        if ending.cancel is CancelReport.NOT_NEEDED and earlier and earlier.goal.in_flight:
            # This attempt sent nothing, but an earlier goal of the call may run.
            ending = replace(ending, cancel=CancelReport.UNKNOWN)
        self._ending = ending
        self._stop_retrying()
        callbacks = self._request.callbacks
        if ending.end not in _WITH_RESULT or callbacks is None:
            self._settle()
            return
        until = time.monotonic() + _LAST_FEEDBACK_GRACE
        self._grace = self._carrier.call_at(until, self._settle)
        callbacks.finish(lambda: self._carrier.call_soon(self._settle))

    def _stop_retrying(self) -> None:
        self._retrying.drop()
        if self._pause is not None:
            self._carrier.cancel_timer(self._pause)
            self._pause = None

    def _settle(self) -> None:
        if self._settled:
            return
        self._settled = True
        self._previous = None  # it holds this call for as long as it is watched
        if self._grace is not None:
            self._carrier.cancel_timer(self._grace)
        if self._request.callbacks is not None:
            self._request.callbacks.close()
        ending = self._ending
        assert ending is not None
        self.state = ending.status
        self._tape.end()
        outcome = self._outcome(ending)
        self._audience.outcome(outcome, self._info)
        self._carrier.finished(self)  # first: who sees the end sees it counted out (C1.11)
        self.future.settle(outcome, ending.end)

    def _outcome(self, ending: fx.Ending) -> Outcome[Any]:
        story = Story(
            action_name=self._carrier.action_name,
            type_name=self._carrier.type_name,
            goal_id=self.goal_id,
            attempts=self._attempts,
            timeline=self.timeline.events(),
            elapsed=time.monotonic() - self._began,
            timeout=self._request.timeout,
            timeouts=self._request.timeouts,
            surroundings=self._carrier.graph_snapshot,
        )
        callbacks = self._request.callbacks
        return Outcome(
            status=ending.status,
            result=ending.result,
            error=explain(ending, story),
            attempts=self._attempts,
            timeline=story.timeline,
            goal_id=self.goal_id,
            cancel=ending.cancel,
            callback_errors=0 if callbacks is None else callbacks.errors,
            feedback_count=self._tape.count,
            elapsed=story.elapsed,
        )

    def _note(
        self,
        goal_id: uuid.UUID,
        attempt: int,
        state: GoalState,
        detail: str,
        feedback: Callable[[], Any] | None = None,
    ) -> None:
        event = GoalEvent(goal_id, attempt, state, time.monotonic(), time.time(), detail)
        self.timeline.add(event)
        self._audience.event(event, self._info, feedback)
