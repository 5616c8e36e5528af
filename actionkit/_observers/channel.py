"""Brings what happened to one observer: in order, on a thread of its client's for observers, and
never on the thread that completes the goals (R8).

Nothing is lost on the way but by a bound, and then feedback first: a client that closes, and the
interpreter at its exit, wait a bounded time for what is queued.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable

from actionkit._threads.blocked import Label
from actionkit._threads.diagnostics import is_interrupt, log_here, log_later, write_to_stderr
from actionkit._threads.pool import Pool
from actionkit._threads.waiting import Flag, taken_from

MOST_FEEDBACK = 1_000
"""With so many waiting, feedback is left out."""
MOST = 100_000
"""With so many waiting, everything is."""
_WARNING_PERIOD = 60.0
"""Seconds between warnings of a log handler that raises."""

Job = Callable[[], object]


class Channel:
    """The queue to one observer of one client. Any thread may use it."""

    def __init__(
        self, label: Label, pool: Pool, action_name: str, *, ends_on_error: bool = True
    ) -> None:
        """Make an empty one.

        Args:
            label: Whose it is, for the warnings.
            pool: Where the jobs run.
            action_name: The client's, for the warnings.
            ends_on_error: Whether who raises is told nothing more, as observers are; the log
                gets what comes after all the same.
        """
        self.label = label
        self.name = f"{label} of action {action_name!r}"
        self.ends_on_error = ends_on_error
        self._pool = pool
        self._lock = threading.RLock()
        """Never taken by a user's thread but at exit, since `put` must not wait for a handler."""
        self._flushes: deque[Flag] = deque()
        self._jobs: deque[Job] = deque()
        self._scheduled = False
        self._draining: int | None = None  # the thread that is at it
        self._closed = False
        self._errors = 0
        self._quiet_until = 0.0
        self._lost = 0
        self._told_of_loss = False

    def put(self, job: Job, *, feedback: bool = False) -> None:
        """Queue a job. Never blocks."""
        with self._lock:
            if self._closed:
                return
            if len(self._jobs) >= (MOST_FEEDBACK if feedback else MOST):
                self._lost += 1
                return
            self._jobs.append(job)
            if self._scheduled:
                return
            self._scheduled = True
            _busy.add(self)
        self._pool.run(self)

    def flush(self, until: float, *, here: bool = False) -> bool:
        """Wait for what is queued to be told.

        Args:
            until: Monotonic time at which not to wait any longer.
            here: Tell it on this thread where none has begun to. From Python 3.12 on no thread
                can be started at the interpreter's exit.

        Returns:
            Whether nothing is queued any more.
        """
        while self._scheduled and (self._draining is not None or not here):
            rested = Flag()
            self._flushes.append(rested)
            # It may have come to rest just before.
            if self._scheduled and not rested.wait(until - time.monotonic()):
                return False
        if self._scheduled:
            self._drain_here(until)
        return not self._scheduled

    def step(self) -> bool:
        """Run the next job, where no other thread is at it. For the pool only."""
        job = self._next(None)
        if job is None:
            return False
        self._run(job)
        return True

    def _drain_here(self, until: float) -> None:
        try:
            while (job := self._next(until)) is not None:
                self._run(job)
        except KeyboardInterrupt:
            with self._lock:
                self._rest()
            raise

    def _next(self, until: float | None) -> Job | None:
        here = threading.get_ident()
        with self._lock:
            if self._draining not in (None, here):
                return None
            if self._jobs and (until is None or time.monotonic() < until):
                self._draining = here
                return self._jobs.popleft()
            self._rest()  # under the same lock, or a job that is put just now would stay
            return None

    def _rest(self) -> None:
        self._draining = None
        if not self._jobs:
            self._scheduled = False
            _busy.discard(self)
        for rested in taken_from(self._flushes):
            rested.set()

    def _run(self, job: Job) -> None:
        try:
            job()
        except BaseException as error:
            if is_interrupt(error):
                raise  # a human who does not want to wait for the exit
            self._raised()
        if self._lost and not self._told_of_loss:
            self._told_of_loss = True
            log_here(
                logging.WARNING,
                "%s is too slow: events are left out, feedback from %d waiting events on",
                self.name,
                MOST_FEEDBACK,
            )

    def _raised(self) -> None:
        """Do what is due about an error of who is told. While it is being handled."""
        if self.ends_on_error:
            with self._lock:
                self._closed = True
                self._jobs.clear()
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


_busy: set[Channel] = set()
"""The channels with something queued, for the interpreter's exit."""


def flush_all(until: float) -> None:
    """At the interpreter's exit: wait for what is queued anywhere, and warn of what is left."""
    for channel in list(_busy):
        if channel.flush(until, here=True):
            continue
        text = "at exit, %s had not been told everything"
        if channel.ends_on_error:
            log_later(logging.WARNING, text, channel.name)
        else:  # it is the log that takes nothing
            write_to_stderr(text % channel.name)


def after_fork() -> None:
    """In a child: what the parent's observers have to be told is the parent's business."""
    _busy.clear()
