"""Records what users see of one call: its timeline, its feedback and its outcome.

All of it happens on the communication thread, except the constructor.
"""

from __future__ import annotations

import logging
import time
import uuid
from collections.abc import Callable
from typing import Any, Protocol

from actionkit._calls.errors.error_context import ErrorContext
from actionkit._calls.errors.explain import explain
from actionkit._calls.errors.graph_snapshot import GraphSnapshot
from actionkit._calls.futures.feedback import log_errors, log_left_out
from actionkit._calls.futures.feedback_broadcast import FeedbackBroadcast
from actionkit._calls.sending.attempt import Attempt
from actionkit._calls.sending.request import Request
from actionkit._goal.effects import End, Ending
from actionkit._messages.lazy import LazyMessage
from actionkit._model import values
from actionkit._model.timeline import Recorder
from actionkit._model.values import GoalEvent, GoalState, Outcome, Timeline
from actionkit._observers.delivery import ObserverDispatcher
from actionkit._threads.clock import TimerHandle
from actionkit._threads.function_runner import Scheduler

_LAST_FEEDBACK_GRACE = 0.05
"""Seconds that a result waits until callbacks have got the feedback before it. Quick callbacks need
less even on a busy machine, and a slow callback must not delay a result (C1.8)."""
_WITH_RESULT = {End.SUCCEEDED, End.ABORTED, End.CANCELED_BY_OTHER}


class ActionView(Protocol):
    """What is known about the action of a call."""

    action_name: str
    type_name: str

    def decode_feedback(self, message: bytes) -> Any: ...
    def graph_snapshot(self) -> GraphSnapshot: ...


class CallRecord:
    """Records what happens in one call, and tells its observers."""

    def __init__(
        self,
        action: ActionView,
        request: Request,
        dispatcher: ObserverDispatcher,
        call_id: uuid.UUID,
    ) -> None:
        """Make the record of a call that begins now. On the caller's thread.

        `call_id` is the id of the call's first goal.
        """
        self.began = time.monotonic()
        self.timeline = Recorder()
        self.tape: FeedbackBroadcast[Any] = FeedbackBroadcast()
        self._action = action
        self._request = request
        self._dispatcher = dispatcher
        self._grace: tuple[Scheduler, TimerHandle] | None = None
        self._info = dispatcher.call_info(
            call_id, request.goal, monotonic=self.began, wall=time.time()
        )

    def note(
        self,
        goal_id: uuid.UUID,
        attempt: int,
        state: GoalState,
        detail: str,
        cancel_refused: bool = False,
        feedback: Callable[[], Any] | None = None,
    ) -> GoalEvent:
        """Add an event to the timeline, tell the observers, and return it."""
        event = GoalEvent(
            goal_id, attempt, state, time.monotonic(), time.time(), detail, cancel_refused
        )
        self.timeline.add(event)
        self._dispatcher.event(event, self._info, feedback)
        return event

    def note_feedback(self, attempt: Attempt, messages: list[bytes]) -> None:
        """Pass on feedback without decoding it."""
        handful = [LazyMessage(self._action.decode_feedback, message) for message in messages]
        goal_id = attempt.goal_id
        numbers = self.timeline.count_feedback(goal_id, len(handful))
        each = self._dispatcher.hears_feedback
        for number, one in zip(numbers, handful, strict=True):
            if each or number in (1, numbers[-1]):  # the timeline keeps no others
                detail = f"no. {number}"
                self.note(goal_id, attempt.number, GoalState.FEEDBACK, detail, feedback=one)
        self.tape.put(*handful)
        if self._request.callbacks is not None:
            self._request.callbacks.put(*handful)

    def await_callbacks(self, ending: Ending, clock: Scheduler, then: Callable[[], None]) -> None:
        """Call `then` when the feedback callbacks have got everything, or are slow; maybe twice."""
        callbacks = self._request.callbacks
        if ending.end not in _WITH_RESULT or callbacks is None:
            then()
            return
        self._grace = clock, clock.call_at(time.monotonic() + _LAST_FEEDBACK_GRACE, then)
        callbacks.finish(lambda: clock.call_soon(then))

    def end_feedback(self, ending: Ending, *, client_closes: bool) -> None:
        """End the streams of feedback; callbacks get none after a result (C1.8).

        If the client closes before there is a result, the callbacks get everything that has
        arrived, and `close` waits for that (C1.10).
        """
        if self._grace is not None:
            clock, timer = self._grace
            clock.cancel_timer(timer)
            self._grace = None
        callbacks, has_result = self._request.callbacks, ending.end in _WITH_RESULT
        if callbacks is not None and (has_result or not client_closes):
            left_out = callbacks.close()
            if left_out and has_result:
                name = self._action.action_name
                # Not a warning: most callbacks only show progress, and the goal has ended.
                log_left_out(logging.INFO, callbacks, name, left_out, "the result has come")
        if callbacks is not None:
            log_errors(callbacks, self._action.action_name)
        self.tape.end()

    def outcome(self, ending: Ending, goal_id: uuid.UUID, attempts: int) -> Outcome[Any]:
        """Return an ending as the user sees it; it need not be the call's final outcome."""
        context = ErrorContext(
            action_name=self._action.action_name,
            type_name=self._action.type_name,
            goal_id=goal_id,
            attempts=attempts,
            timeline=self.timeline.events(),
            elapsed=time.monotonic() - self.began,
            timeout=self._request.timeout,
            timeouts=self._request.timeouts,
            surroundings=self._action.graph_snapshot,
            attached=self._request.attach == goal_id,
            key=self._request.key,
        )
        callbacks = self._request.callbacks
        return Outcome(
            status=ending.status,
            result=ending.result,
            error=explain(ending, context),
            attempts=attempts,
            timeline=context.timeline,
            goal_id=goal_id,
            cancel=ending.cancel,
            callback_errors=0 if callbacks is None else callbacks.errors,
            feedback_count=self.tape.count,
            elapsed=context.elapsed,
            goals=ending.goals,
            from_ledger=ending.from_ledger,
        )

    def tell_outcome(self, outcome: Outcome[Any]) -> None:
        """Tell the observers how the call ended."""
        self._dispatcher.outcome(outcome, self._info)


def _to_html(timeline: Timeline, outcome: Outcome[Any] | None) -> str:
    from actionkit._recordings.pictures.notebook import to_html

    return to_html(timeline, outcome)


values.to_html = _to_html
