"""Brings what happened to one observer: in order, on the pool, and never on the thread that
completes the goals (R8).

Nothing is lost on the way but by a bound, and then feedback first: a client that closes, and the
interpreter at its exit, wait a bounded time for what is queued.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable

from actionkit._delivery import pool
from actionkit._waiting import Flag, taken_from

_log = logging.getLogger("actionkit")
MOST_FEEDBACK = 1_000
"""With so many waiting, feedback is left out."""
MOST = 100_000
"""With so many waiting, everything is."""

Job = Callable[[], object]


class Channel:
    """The queue to one observer of one client. Any thread may use it."""

    def __init__(self, name: str) -> None:
        """Make an empty one.

        Args:
            name: Whose it is, for the warnings.
        """
        self.name = name
        self._lock = threading.RLock()
        """Never taken by a user's thread but at exit, since `put` must not wait for a handler."""
        self._flushes: deque[Flag] = deque()
        self._jobs: deque[Job] = deque()
        self._scheduled = False
        self._draining = False
        self._closed = False
        self._lost = 0
        self._told_of_loss = False

    def put(self, job: Job, *, feedback: bool = False) -> None:
        """Queue a job; what it raises closes the channel. Never blocks."""
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
        pool.submit(self._drain)

    def flush(self, until: float, *, here: bool = False) -> bool:
        """Wait for what is queued to be told.

        Args:
            until: Monotonic time at which not to wait any longer.
            here: Tell it on this thread where none has begun to. From Python 3.12 on no thread
                can be started at the interpreter's exit.

        Returns:
            Whether nothing is queued any more.
        """
        while self._scheduled and (self._draining or not here):
            rested = Flag()
            self._flushes.append(rested)
            # It may have come to rest just before.
            if self._scheduled and not rested.wait(until - time.monotonic()):
                return False
        if self._scheduled:
            self._drain(until)
        return not self._scheduled

    def _drain(self, until: float | None = None) -> None:
        with self._lock:
            if self._draining:
                return
            self._draining = True
        try:
            while (job := self._next(until)) is not None:
                self._run(job)
        except KeyboardInterrupt:
            with self._lock:
                self._rest()
            raise

    def _next(self, until: float | None) -> Job | None:
        with self._lock:
            if self._jobs and (until is None or time.monotonic() < until):
                return self._jobs.popleft()
            self._rest()  # under the same lock, or a job that is put just now would stay
            return None

    def _rest(self) -> None:
        self._draining = False
        if not self._jobs:
            self._scheduled = False
            _busy.discard(self)
        for rested in taken_from(self._flushes):
            rested.set()

    def _run(self, job: Job) -> None:
        try:
            job()
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt) and _is_main_thread():
                raise  # a human who does not want to wait for the exit
            with self._lock:
                self._closed = True
                self._jobs.clear()
            _log.warning("%s raised, and is told nothing more", self.name, exc_info=True)
        if self._lost and not self._told_of_loss:
            self._told_of_loss = True
            _log.warning(
                "%s is too slow: events are left out, feedback from %d waiting events on",
                self.name,
                MOST_FEEDBACK,
            )


def _is_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()


_busy: set[Channel] = set()
"""The channels with something queued, for the interpreter's exit."""


def flush_all(until: float) -> None:
    """At the interpreter's exit: wait for what is queued anywhere, and warn of what is left."""
    for channel in list(_busy):
        if not channel.flush(until, here=True):
            _log.warning("at exit, %s had not been told everything", channel.name)


def after_fork() -> None:
    """In a child: what the parent's observers have to be told is the parent's business."""
    _busy.clear()
