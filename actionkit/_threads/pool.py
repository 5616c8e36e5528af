"""Daemon threads that run the user's callables, never the communication thread (R8).

Each client has pools of its own: one for feedback and done callbacks, one for its observers and
the log, one for `classify=` and retry strategies. So no callable waits for one of another client,
and no callback for a log handler.

The threads of a pool start when there is work and end when there is none. They are daemons, so
that none holds up the interpreter's exit for ever (R19). Closing and the exit wait for callbacks
that are due or running, within a bound, and then nothing of the user's begins any more (C1.10).
"""

from __future__ import annotations

import contextvars
import queue
import threading
import time
from collections.abc import Callable

from actionkit._threads.diagnostics import log_own_error
from actionkit._threads.in_hand import CALLBACKS, FUNCTIONS, Dues, InHand, Label, Work

MOST_THREADS = 64
"""Threads of a client for its callbacks: so many megabytes of stack at the most, and more blocked
callbacks than a program has that works."""
_IDLE_SECONDS = 1.0
"""Seconds until an idle thread ends: longer than between two feedback messages of most servers."""

in_callback: contextvars.ContextVar[bool] = contextvars.ContextVar("in_callback", default=False)
"""Whether the caller is inside a callback that ActionKit called."""

Job = Callable[[], object]


class Pool:
    """Daemon threads: another one while all are busy, up to a limit. Jobs must not raise."""

    def __init__(
        self,
        owner: str = "",
        *,
        name: str = "actionkit-callbacks",
        most: int = MOST_THREADS,
        idle: float = _IDLE_SECONDS,
        kind: dict[Dues, None] = CALLBACKS,
    ) -> None:
        """Make one without threads.

        Args:
            owner: The name of the client's action, for the log.
            name: The name of the threads.
            most: How many there are at most.
            idle: Seconds that a thread waits for more work before it ends.
            kind: What its jobs are, as `Dues` takes it.
        """
        self._name = name
        self._most = most
        self._idle_seconds = idle
        self._warns = kind is not FUNCTIONS
        self.dues = Dues(owner, kind)
        """What is due or running, and its end."""
        self.dues.run_one = self._run_one_here
        self._waiting: queue.SimpleQueue[InHand] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._threads = 0
        self._free = 0  # threads that wait for work, less work that waits for a thread
        self._lacks_threads = False

    def submit(self, job: Job, label: Label) -> str:
        """Run one job soon. Never blocks.

        Args:
            job: What to run.
            label: What is said of it where it does not return.

        Returns:
            `""`, or why no thread could be started for it. It runs all the same where another
            thread of the pool is free in time.
        """
        return self.run(_Single(job, label))

    def run(self, work: Work) -> str:
        """Run all steps of `work` soon, one after the other on one thread. Never blocks.

        Returns:
            As `submit`.
        """
        if self.dues.ended:
            self.dues.warn([InHand(work.label, work)])
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
            # No more threads; from Python 3.12 on there are none at the interpreter's exit. The
            # work waits for one that is there, or for the exit. What rests on it must not break.
            with self._lock:
                self._lacks_threads = True
                self._threads -= 1
                self._free -= 1
            return str(error)
        return ""

    def look(self) -> None:
        """Name in the log what has been running for long. To be called when more comes."""
        if self._warns:
            self.dues.look(time.monotonic())

    def _run_one_here(self) -> bool:
        """At the interpreter's exit: take a step of what no thread comes for; return if one was."""
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

    def _next(self) -> InHand | None:
        """Wait for work; `None` where the thread is to end, and is counted out."""
        while True:
            try:
                return self._waiting.get(timeout=self._idle_seconds)
            except queue.Empty:
                with self._lock:
                    if self._free <= 0:
                        continue  # some is on its way
                    self._threads -= 1
                    self._free -= 1
                    return None

    def _carry_out(self, due: InHand) -> None:
        work, more = due.work, True
        assert work is not None
        due.thread = threading.get_ident()
        while more and not self.dues.ended:
            due.since = time.monotonic()
            try:
                more = work.step()
            except BaseException:  # noqa: BLE001  a thread of the pool is not to be lost
                log_own_error()
        self.dues.done(due)


class _Single:
    """Work of one job."""

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
