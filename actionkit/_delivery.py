"""Where the user's callables run: never on the communication thread (R8).

Each goal has a strand: its callbacks run one after the other, in order. Strands share a few
daemon threads, which come when there is work and go when there is none, so that one slow
callback delays nobody else's, and none holds up the interpreter's exit (R19).
"""

from __future__ import annotations

import contextvars
import logging
import queue
import threading
from collections import deque
from collections.abc import Callable

_log = logging.getLogger("actionkit")
_MOST_THREADS = 8
_IDLE_SECONDS = 1.0

in_callback: contextvars.ContextVar[bool] = contextvars.ContextVar("in_callback", default=False)
"""Whether the caller is inside a callback that ActionKit called."""

Job = Callable[[], None]


class Pool:
    """Runs jobs on up to a few daemon threads. Jobs must not raise."""

    def __init__(self, most: int = _MOST_THREADS, idle: float = _IDLE_SECONDS) -> None:
        self._most = most
        self._idle_seconds = idle
        self._jobs: queue.SimpleQueue[Job] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._threads = 0
        self._free = 0  # threads that wait for a job, less jobs that wait for a thread

    def submit(self, job: Job) -> None:
        """Run `job` soon. Never blocks."""
        with self._lock:
            self._free -= 1
            start = self._free < 0 and self._threads < self._most
            if start:
                self._threads += 1
                self._free += 1
        self._jobs.put(job)
        if not start:
            return
        try:
            threading.Thread(target=self._work, name="actionkit-callbacks", daemon=True).start()
        except RuntimeError:
            # No more threads; from Python 3.12 on there are none at the interpreter's exit. The
            # job waits for one that is there. What rests on it must not break on it.
            with self._lock:
                self._threads -= 1
                self._free -= 1

    def _work(self) -> None:
        in_callback.set(True)
        while True:
            try:
                job = self._jobs.get(timeout=self._idle_seconds)
            except queue.Empty:
                with self._lock:
                    if self._free <= 0:
                        continue  # one is on its way
                    self._threads -= 1
                    self._free -= 1
                    return
            try:
                job()
            except BaseException:  # noqa: BLE001  a thread of the pool is not to be lost
                _log.exception("an error in ActionKit itself; please report it")
            del job  # or an idle thread would keep the last goal alive
            with self._lock:
                self._free += 1


class Strand:
    """A bounded queue of jobs that run one after the other on a pool."""

    def __init__(self, pool: Pool, most: int) -> None:
        self._pool = pool
        self._most = most
        self._lock = threading.Lock()
        self._jobs: deque[Job] = deque()
        self._running = False
        self._closed = False
        self.dropped = 0

    def put(self, *jobs: Job) -> None:
        """Queue jobs. Where the queue is full the oldest give way: the newest win."""
        with self._lock:
            if self._closed:
                return
            self._jobs.extend(jobs)
            while len(self._jobs) > self._most:
                self._jobs.popleft()
                self.dropped += 1
            if self._running:
                return
            self._running = True
        self._pool.submit(self._drain)

    def finish(self, then: Job) -> None:
        """Call `then` once, when what is queued has run; at once where nothing is."""
        with self._lock:
            if self._running and not self._closed:
                self._jobs.append(then)
                return
        then()

    def close(self) -> None:
        """Run nothing more. What is running now runs on."""
        with self._lock:
            self._closed = True
            self._jobs.clear()

    def _drain(self) -> None:
        while True:
            with self._lock:
                if not self._jobs:
                    self._running = False
                    return
                job = self._jobs.popleft()
            job()


pool = Pool()
"""Shared by all clients of the process."""


def after_fork() -> None:
    """In a child: the parent's threads are not here."""
    pool.__init__()  # type: ignore[misc]  # one object, because others hold it
