"""Hands what happens to the goals of one client to its log and its observers."""

from __future__ import annotations

import contextvars
import uuid
from collections.abc import Callable
from functools import partial
from typing import Any

from actionkit._messages.lazy import UndecodableError
from actionkit._model.values import GoalEvent, GoalState, Outcome
from actionkit._observers.goal_log import GoalLog
from actionkit._observers.observer_queue import ObserverQueue
from actionkit._observers.protocol import CallInfo, Observer
from actionkit._threads.in_hand import Label
from actionkit._threads.pool import Job, Pool


class Subscription:
    """One observer, with its queue."""

    def __init__(self, observer: Observer, queue: ObserverQueue) -> None:
        self.queue = queue
        self._on_event = observer.on_event
        self._on_feedback: Callable[..., object] | None = getattr(observer, "on_feedback", None)
        self._on_outcome: Callable[..., object] | None = getattr(observer, "on_outcome", None)

    def event(self, event: GoalEvent, call: CallInfo, decode: Callable[[], Any] | None) -> None:
        """Hand over a transition, soon."""
        if decode is not None and self._on_feedback is not None:
            job: Job = partial(self._hand_over, self._on_feedback, event, decode, call)
        else:
            job = partial(self._on_event, event, call)
        self.queue.put_event(job, feedback=event.state is GoalState.FEEDBACK)

    def _hand_over(
        self,
        hook: Callable[..., object],
        event: GoalEvent,
        decode: Callable[[], Any],
        call: CallInfo,
    ) -> None:
        try:
            message = decode()
        except UndecodableError:  # not the observer's fault: it gets the event alone
            self._on_event(event, call)
            return
        hook(event, message, call)

    def outcome(self, outcome: Outcome[Any], call: CallInfo) -> None:
        """Hand over the end of a call, soon."""
        if self._on_outcome is not None:
            self.queue.put_event(partial(self._on_outcome, outcome, call))


class ObserverDispatcher:
    """The log and the observers of one client. Costs next to nothing where there are none."""

    def __init__(
        self,
        observers: tuple[Observer, ...] = (),
        *,
        action_name: str = "",
        action_type: str = "",
        node_name: str = "",
    ) -> None:
        """Subscribe the observers, which were checked. The names are those of `CallInfo`."""
        self._names = (action_name, action_type, node_name)
        # A thread for each, if need be: no observer waits for another.
        most = 1 + len(observers)
        self._pool = Pool(action_name, name="actionkit-observers", most=most, awaited=False)
        self._log = GoalLog()
        log_label = Label(f"a handler of {self._log!r}", None, "the client's other records")
        log_queue = ObserverQueue(log_label, self._pool, action_name, ends_on_error=False)
        self._log_subscription = Subscription(self._log, log_queue)
        self._subscriptions = [
            Subscription(observer, self._queue_for(observer)) for observer in observers
        ]

    def _queue_for(self, observer: Observer) -> ObserverQueue:
        label = Label(f"observer {observer!r}", None, "the client's other events for it")
        return ObserverQueue(label, self._pool, self._names[0])

    def call_info(
        self, call_id: uuid.UUID, goal: Any, *, monotonic: float, wall: float
    ) -> CallInfo:
        """Return the facts of a call for the observers. On the caller's thread, for its context."""
        context = contextvars.copy_context() if self._subscriptions else None
        return CallInfo(call_id, *self._names, monotonic, wall, goal, context)

    @property
    def hears_feedback(self) -> bool:
        """Whether there is an observer, or a log record, for each feedback message."""
        return bool(self._subscriptions) or self._log.wants_feedback()

    def event(
        self, event: GoalEvent, call: CallInfo, decode: Callable[[], Any] | None = None
    ) -> None:
        """Hand a transition to all. Never blocks.

        Args:
            event: The transition.
            call: The call that it belongs to.
            decode: Returns the feedback message, if it is one.
        """
        if self._log.wants(event):
            self._log_subscription.event(event, call, None)
        for subscription in self._subscriptions:
            subscription.event(event, call, decode)

    def outcome(self, outcome: Outcome[Any], call: CallInfo) -> None:
        """Hand the end of a call to all. Never blocks."""
        if self._log.wants_outcome(outcome):
            self._log_subscription.outcome(outcome, call)
        for subscription in self._subscriptions:
            subscription.outcome(outcome, call)

    def flush(self, until: float) -> None:
        """Wait until all have got what is queued, or until that monotonic time."""
        for subscription in (self._log_subscription, *self._subscriptions):
            subscription.queue.flush(until)


NO_OBSERVERS = ObserverDispatcher()
