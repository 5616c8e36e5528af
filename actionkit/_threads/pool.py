"""Runs the user's callables on daemon threads, never on the communication thread (R8).

Each client has its own pools: one for feedback and done callbacks, one for its observers and the
log, one for `classify=` and retry strategies. So no callable waits for one of another client, and
no callback waits for a log handler.

The threads of a pool start when there is work and end when there is none. They are daemon threads,
so they cannot hold up the interpreter's exit for ever (R19). Closing and the exit wait for
callbacks that are due or running, for a limited time; after that, nothing of the user's begins
(C1.10).
"""

from __future__ import annotations

import contextvars
import queue
import threading
import time
from collections.abc import Callable

from actionkit._threads.diagnostics import log_own_error
from actionkit._threads.in_hand import CALLBACKS, FUNCTIONS, DueWork, Label, Work, WorkOfPool

MOST_THREADS = 64
"""Threads of a client for its callbacks: they need 64 stacks of some megabytes at most, and no
working program has that many blocked callbacks."""
_IDLE_SECONDS = 1.0
"""Seconds until an idle thread ends: longer than between two feedback messages of most servers."""

in_callback: contextvars.ContextVar[bool] = contextvars.ContextVar("in_callback", default=False)
"""Whether the caller is inside a callback that ActionKit called."""

Job = Callable[[], object]


class Pool:
    """Daemon threads; if all are busy, another one starts, up to a limit. Jobs must not raise."""

    def __init__(
        self,
        owner: str = "",
        *,
        name: str = "actionkit-callbacks",
        most: int = MOST_THREADS,
        idle: float = _IDLE_SECONDS,
        kind: dict[WorkOfPool, None] = CALLBACKS,
    ) -> None:
        """Make a pool without threads.

        `owner` is the name of the client's action, for the log; `name` is that of the threads.
        `most` limits their number. A thread waits `idle` seconds for more work before it ends.
        `kind` is the table for `WorkOfPool`.
        """
        self._name = name
        self._most = most
        self._idle_seconds = idle
        self._warns = kind is not FUNCTIONS
        self.dues = WorkOfPool(owner, kind)
        """The work that is due or running, and the end of it."""
        self.dues.run_one = self._run_one_here
        self._waiting: queue.SimpleQueue[DueWork] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._threads = 0
        self._free = 0  # threads that wait for work, minus work that waits for a thread
        self._lacks_threads = False

    def submit(self, job: Job, label: Label) -> str:
        """Run one job soon. Never blocks.

        Return `""`, or the reason why no thread could be started for it. Even then it runs if
        another thread of the pool becomes free in time.
        """
        return self.run(_Single(job, label))

    def run(self, work: Work) -> str:
        """Run all steps of `work` soon, one after the other on one thread. Never blocks.

        Return the same as `submit`.
        """
        if self.dues.ended:
            self.dues.warn([DueWork(work.label, work)], {})
            return "its client is closed"
        self.look()
        due = self.dues.begin(work.label, work)
        self._waiting.put(due)
        with self._lock:
            self._free -= 1
            if self._free >= 0 or self._threads >= self._most:
                return ""
            self._threads += 1
            self._free += 1
        try:
            threading.Thread(target=self._work, name=self._name, daemon=True).start()
        except RuntimeError as error:
            # No more threads; from Python 3.12 on, none can start at the interpreter's exit. The
            # work waits for an existing thread, or for the exit. Its caller must not fail.
            with self._lock:
                self._lacks_threads = True
                self._threads -= 1
                self._free -= 1
            return str(error)
        return ""

    def look(self) -> None:
        """Name in the log what has run for long. Call this when new work comes."""
        if self._warns:
            self.dues.look(time.monotonic())

    def _run_one_here(self) -> bool:
        """At the interpreter's exit: run a step that no thread runs; return if there was one."""
        try:
            due = self._waiting.get_nowait() if self._lacks_threads else None
        except queue.Empty:
            return False
        if due is None or due.work is None:
            return False
        due.thread = threading.get_ident()
        if due.work.step():
            due.thread = None
            self._waiting.put(due)
            return True
        with self._lock:
            self._free += 1
        self.dues.done(due)
        return True

    # --- on a thread of the pool -----------------------------------------------------------

    def _work(self) -> None:
        in_callback.set(True)
        while (due := self._next()) is not None:
            self._carry_out(due)
            del due  # or an idle thread would keep the last goal alive
            with self._lock:
                self._free += 1

    def _next(self) -> DueWork | None:
        """Wait for work; return `None` if the thread must end and is not counted any more."""
        while True:
            try:
                return self._waiting.get(timeout=self._idle_seconds)
            except queue.Empty:
                with self._lock:
                    if self._free <= 0:
                        continue  # some work is coming
                    self._threads -= 1
                    self._free -= 1
                    return None

    def _carry_out(self, due: DueWork) -> None:
        work, more = due.work, True
        assert work is not None
        due.thread = threading.get_ident()
        while more and not self.dues.ended:
            due.since = time.monotonic()
            try:
                more = work.step()
            except BaseException:  # noqa: BLE001  the pool must not lose a thread
                log_own_error()
        self.dues.done(due)


class _Single:
    """Work that is a single job."""

    __slots__ = ("_job", "label")

    def __init__(self, job: Job, label: Label) -> None:
        self._job: Job | None = job
        self.label = label

    def step(self) -> bool:
        """Run it, once."""
        job, self._job = self._job, None
        if job is not None:
            job()
        return False
