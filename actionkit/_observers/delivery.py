"""Tells the log and the observers of one client what happens to its goals (C6.2).

Each observer gets everything in order, never on the thread that completes the goals (R8). Nothing
is left out unless very much is waiting, and then feedback first. A client that closes, and the
interpreter at its exit, wait a limited time for what is queued.
"""

from __future__ import annotations

import contextvars
import logging
import time
import uuid
from collections.abc import Callable
from functools import partial
from typing import Any

from actionkit._messages.lazy import UndecodableError
from actionkit._model.values import GoalEvent, GoalState, Outcome
from actionkit._observers.goal_log import GoalLog
from actionkit._observers.protocol import CallInfo, Observer
from actionkit._threads.diagnostics import is_interrupt, log_here, log_later, write_to_stderr
from actionkit._threads.in_hand import OBSERVERS, Label, finish_all
from actionkit._threads.pool import Job, Pool
from actionkit._threads.serial_queue import SerialQueue

MOST_FEEDBACK = 1_000
"""If so many events wait, feedback is left out: ten seconds of feedback at 100 Hz."""
MOST = 100_000
"""If so many events wait, everything is left out. If an observer hangs, they use some 100 MB."""
_WARNING_PERIOD = 60.0
"""Seconds between warnings of a log handler that raises an error, maybe with every record."""


class Delivery(SerialQueue[Job]):
    """The queue of one observer. Only the communication thread adds to it."""

    def __init__(self, observer: Observer, label: Label, pool: Pool, action_name: str) -> None:
        super().__init__()
        self.label = label
        """The observer's name in the log."""
        self.name = f"{label} of action {action_name!r}"
        self.is_log = isinstance(observer, GoalLog)
        """Whether it is the log, which gets further events after an error. Observers do not."""
        self._pool = pool
        self._on_event = observer.on_event
        self._on_feedback: Callable[..., object] | None = getattr(observer, "on_feedback", None)
        self._on_outcome: Callable[..., object] | None = getattr(observer, "on_outcome", None)
        self._dropped = False
        self._errors = 0
        self._quiet_until = 0.0
        self._lost = 0
        self._warned_of_loss = False

    def event(self, event: GoalEvent, call: CallInfo, decode: Callable[[], Any] | None) -> None:
        """Pass on a transition, soon."""
        if decode is not None and self._on_feedback is not None:
            job: Job = partial(self._hand_over, self._on_feedback, event, decode, call)
        else:
            job = partial(self._on_event, event, call)
        self.put_job(job, feedback=event.state is GoalState.FEEDBACK)

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
        """Pass on the end of a call, soon."""
        if self._on_outcome is not None:
            self.put_job(partial(self._on_outcome, outcome, call))

    def put_job(self, job: Job, *, feedback: bool = False) -> None:
        """Queue a job that tells the observer something. Never blocks."""
        self._pool.look()  # the observer may have been busy with an earlier one for long
        if len(self._items) >= (MOST_FEEDBACK if feedback else MOST):
            self._lost += 1
        elif not self._dropped:
            self.put(job)

    def _begin(self) -> None:
        self._pool.run(self)

    def step(self) -> bool:
        """Tell it the next thing; return whether there may be another."""
        job = self._take()
        if job is None:
            return False
        try:
            if not self._dropped:
                job()
        except BaseException as error:
            if is_interrupt(error):
                raise  # a human does not want to wait for the exit
            self._on_error()
        if self._lost and not self._warned_of_loss:
            self._warned_of_loss = True
            log_here(
                logging.WARNING,
                "%s is too slow: events are left out, feedback from %d waiting events on",
                self.name,
                MOST_FEEDBACK,
            )
        return True

    def _on_error(self) -> None:
        """Log the error that is being handled; an observer gets nothing more after it."""
        if not self.is_log:
            self._dropped = True
            log_here(
                logging.WARNING, "%s raised, and is told nothing more", self.name, exc_info=True
            )
            return
        self._errors += 1
        if time.monotonic() < self._quiet_until:
            return
        self._quiet_until = time.monotonic() + _WARNING_PERIOD
        log_here(
            logging.WARNING,
            "%s raised (%d times so far), and was given what came after all the same",
            self.name,
            self._errors,
            exc_info=True,
        )


class ObserverDispatcher:
    """The log and the observers of one client. Costs almost nothing if there are no observers."""

    def __init__(
        self,
        observers: tuple[Observer, ...] = (),
        *,
        action_name: str = "",
        action_type: str = "",
        node_name: str = "",
    ) -> None:
        """Subscribe observers that were checked. The names are those of `CallInfo`."""
        self._names = (action_name, action_type, node_name)
        # One thread for each if needed: no observer waits for another.
        most = 1 + len(observers)
        self._pool = Pool(action_name, name="actionkit-observers", most=most, kind=OBSERVERS)
        self._log = GoalLog()
        self._to_log = self._to(self._log, f"a handler of {self._log!r}", "records")
        self._to_observers = [
            self._to(each, f"observer {each!r}", "events for it") for each in observers
        ]

    def _to(self, observer: Observer, name: str, others: str) -> Delivery:
        label = Label(name, None, f"the client's other {others}")
        return Delivery(observer, label, self._pool, self._names[0])

    def call_info(
        self, call_id: uuid.UUID, goal: Any, *, monotonic: float, wall: float
    ) -> CallInfo:
        """Return the facts of a call for observers. On the caller's thread, for its context."""
        context = contextvars.copy_context() if self._to_observers else None
        return CallInfo(call_id, *self._names, monotonic, wall, goal, context)

    @property
    def hears_feedback(self) -> bool:
        """Whether there is an observer, or a log record, for each feedback message."""
        return bool(self._to_observers) or self._log.wants_feedback()

    def event(
        self, event: GoalEvent, call: CallInfo, decode: Callable[[], Any] | None = None
    ) -> None:
        """Pass a transition to all; `decode` returns its feedback message, if any. Never blocks."""
        if self._log.wants(event):
            self._to_log.event(event, call, None)
        for each in self._to_observers:
            each.event(event, call, decode)

    def outcome(self, outcome: Outcome[Any], call: CallInfo) -> None:
        """Pass the end of a call to all. Never blocks."""
        if self._log.wants_outcome(outcome):
            self._to_log.outcome(outcome, call)
        for each in self._to_observers:
            each.outcome(outcome, call)

    def flush(self, until: float) -> None:
        """Wait until all have what is queued, or until that monotonic time. Takes no lock."""
        self._pool.dues.finish(until)


NO_OBSERVERS = ObserverDispatcher()


def flush_all(until: float) -> None:
    """At the interpreter's exit: wait for everything that is queued, and warn of the rest."""
    for due in finish_all(until, OBSERVERS):
        assert isinstance(due.work, Delivery)
        text = "at exit, %s had not been told everything"
        if due.work.is_log:  # the log itself accepts nothing
            write_to_stderr(text % due.work.name)
        else:
            log_later(logging.WARNING, text, due.work.name)
