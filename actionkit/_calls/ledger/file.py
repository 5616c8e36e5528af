"""A ledger as clients see it: goals are written down at once, and removed a little later."""

from __future__ import annotations

import os
import queue
import signal
import threading
import time
import uuid
from collections.abc import Callable
from functools import partial
from pathlib import Path

from actionkit._calls.ledger.store import Store, attempt_id
from actionkit._threads.diagnostics import log_own_error

_FLUSH = 2.0
"""Seconds to wait at a client's end until the goals that have ended are removed from the file."""
_PAUSE = 0.2
"""Seconds in which goals that have ended are collected, to be removed together. If the process is
killed meanwhile, they count as left over, and turn out to have ended."""
_Asked = queue.SimpleQueue[tuple[uuid.UUID | None, Callable[[], object] | None]]
_writers: dict[Path, Writer] = {}
_writers_lock = threading.RLock()


def _before_fork() -> None:
    _writers_lock.acquire()
    for writer in _writers.values():
        writer.store.before_fork()


def _after_fork() -> None:
    for writer in _writers.values():
        writer.store.after_fork()
    _writers_lock.release()


os.register_at_fork(before=_before_fork, after_in_parent=_after_fork, after_in_child=_after_fork)


class Writer:
    """Writes into a file what can wait, on a thread of its own."""

    def __init__(self, store: Store) -> None:
        self.store = store
        self._pid = 0
        self._begin()  # now: while a program ends, Python starts no more threads

    def soon(self, goal_id: uuid.UUID | None, do: Callable[[], object] | None = None) -> None:
        """Remove a call, or do something else with the file. Never blocks; from any thread."""
        if self._pid != os.getpid():
            self._begin()
        self._asked.put((goal_id, do))

    def flush(self) -> None:
        """Wait a moment until all that was asked for is done."""
        if self._pid == os.getpid():
            done = threading.Event()
            self.soon(None, done.set)
            self._hurry.set()
            done.wait(_FLUSH)

    def _begin(self) -> None:
        """Start the thread; a forked child has none."""
        with self.store.lock:
            if self._pid == os.getpid():
                return
            self._asked: _Asked = queue.SimpleQueue()
            self._hurry = threading.Event()
            run = partial(self._run, self._asked, self._hurry)
            thread = threading.Thread(target=run, name="actionkit-ledger", daemon=True)
            # It takes no signal: these are for the main thread, which may wait for one.
            before = signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
            try:
                thread.start()
                self._pid = os.getpid()
            except RuntimeError:  # no more threads: then the goals count as left over
                log_own_error()
            finally:
                signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def _run(self, asked: _Asked, hurry: threading.Event) -> None:
        while True:
            items = [asked.get()]
            hurry.wait(_PAUSE)  # many at once cost hardly more than one
            hurry.clear()
            while not asked.empty():
                items.append(asked.get())
            ended = [goal_id for goal_id, _ in items if goal_id is not None]
            steps: list[Callable[[], object]] = [partial(self.store.remove, ended)]
            for step in [*steps, *(do for _, do in items if do is not None)]:
                try:
                    step()
                except Exception:  # noqa: BLE001  they count as left over: too many are safe
                    log_own_error()


class LedgerFile:
    """The file of a ledger."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Open the file, or make it.

        Args:
            path: Where it is. Beside it come files with the same name and `-wal`, `-shm`, `-alive`.

        Raises:
            LedgerError: It cannot be used.
        """
        self.path = Path(path).resolve()
        with _writers_lock:  # one for each file: see `Lives`
            if self.path not in _writers:
                _writers[self.path] = Writer(Store(self.path))
        self._writer = _writers[self.path]
        self._store = self._writer.store

    def __repr__(self) -> str:
        return f"Ledger({str(self.path)!r})"

    def _add(
        self,
        goal_id: uuid.UUID,
        action: str,
        kind: str,
        domain: int,
        *,
        attempts: int = 1,
        judged: bool = False,
        parallel: bool = False,
    ) -> None:
        """Write a call down before it is sent; the fields are those of `Leftover`.

        Raises:
            LedgerError: The file cannot be used. Then it must not be sent.
        """
        how = attempts, judged, parallel
        self._store.add((str(goal_id), action, kind, domain, *how, time.time()))

    def _attempt_id(self, first: uuid.UUID, number: int) -> uuid.UUID:
        """Return the id of a call's goal by the number of the attempt, from 1."""
        return attempt_id(first, number)

    def _remove_soon(self, goal_id: uuid.UUID) -> None:
        """Remove a call. Never blocks; from any thread."""
        self._writer.soon(goal_id)
