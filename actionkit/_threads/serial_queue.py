"""A queue of jobs that run one after the other, and not on the thread that puts them in (R8)."""

from __future__ import annotations

import threading
import time
from collections import deque

from actionkit._threads.in_hand import Label
from actionkit._threads.pool import Job, Pool
from actionkit._threads.waiting import taken_from


class SerialQueue:
    """Runs jobs in order, one at a time, on the threads of a pool.

    `put` and `close` have a lock, which is held for a few bytecodes. `finish` has none, because
    threads of the user's call it: see "Locks" in docs/architecture.md.
    """

    def __init__(self, pool: Pool, label: Label, most: int) -> None:
        """Make an empty one.

        Args:
            pool: Where the jobs run.
            label: What the log calls a job that does not return.
            most: How many jobs may wait.
        """
        self.label = label
        self._pool = pool
        self._most = most
        self._lock = threading.RLock()  # at the interpreter's exit, handlers may interrupt it
        self._jobs: deque[Job] = deque()
        self._finishes: deque[Job] = deque()
        self._scheduled = False
        """Whether there are jobs, or one is running."""
        self._thread: int | None = None
        """The thread that runs the jobs, once one has begun to."""
        self._closed = False

    def put(self, *jobs: Job) -> None:
        """Queue jobs. Where too many wait, the oldest are left out. Never blocks."""
        with self._lock:
            if self._closed:
                return
            self._jobs.extend(jobs)
            while len(self._jobs) > self._most:
                self._jobs.popleft()
            waits = self._scheduled
            if not waits:
                self._schedule()
        if waits:
            self._pool.look()  # what runs may have been running for long
        else:
            self._pool.run(self)

    def finish(self, then: Job) -> None:
        """Call `then` once, when no job waits or runs; at once if that is so, or it is closed."""
        self._finishes.append(then)
        if self._closed or not self._scheduled:
            self._call_finishes()

    def close(self) -> int:
        """Run no more jobs. One that is running goes on, but `finish` does not wait for it.

        Returns:
            How many jobs were waiting.
        """
        with self._lock:
            self._closed = True
            waiting = len(self._jobs)
            self._jobs.clear()
        self._call_finishes()
        return waiting

    def step(self) -> bool:
        """Run the next job, unless another thread runs them; return whether to call again."""
        job = self._next(None)
        if job is None:
            return False
        self._run(job)
        return True

    def _run_here(self, until: float) -> None:
        """Run jobs on this thread, until none waits or that monotonic time is past."""
        try:
            while (job := self._next(until)) is not None:
                self._run(job)
        except BaseException:
            # A signal handler may raise here, at any line: the queue must be free for others.
            with self._lock:
                self._rest()
            raise

    def _run(self, job: Job) -> None:
        job()

    def _next(self, until: float | None) -> Job | None:
        here = threading.get_ident()
        with self._lock:
            if self._thread not in (None, here):
                return None
            if self._jobs and (until is None or time.monotonic() < until):
                self._thread = here
                return self._jobs.popleft()
            self._rest()  # under the same lock, or a job that is put just now would stay
        if self._finishes and not self._scheduled:
            self._call_finishes()
        return None

    def _schedule(self) -> None:
        """Under the lock: note that the pool is to run what is queued."""
        self._scheduled = True

    def _rest(self) -> None:
        """Under the lock: let any thread run what is queued, if anything is."""
        self._thread = None
        self._scheduled = bool(self._jobs)

    def _call_finishes(self) -> None:
        for then in taken_from(self._finishes):
            then()
