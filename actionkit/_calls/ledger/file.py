"""A ledger as clients see it: goals are written down at once, and removed a little later."""

from __future__ import annotations

import os
import queue
import threading
import time
import uuid
from functools import partial
from pathlib import Path

from actionkit._calls.ledger.store import Store, attempt_id
from actionkit._threads.diagnostics import log_own_error

_FLUSH = 2.0
"""Seconds to wait at a client's end until the goals that have ended are removed from the file."""
_removers: dict[Path, Remover] = {}
_removers_lock = threading.Lock()


class Remover:
    """Removes goals from a file, on a thread of its own."""

    def __init__(self, store: Store) -> None:
        self.store = store
        self._lock = threading.Lock()
        self._pid = 0
        self._queue: queue.SimpleQueue[uuid.UUID | threading.Event] = queue.SimpleQueue()

    def remove_soon(self, goal_id: uuid.UUID) -> None:
        """Remove a call. Never blocks; from any thread."""
        if self._pid != os.getpid():
            self._begin()
        self._queue.put(goal_id)

    def flush(self) -> None:
        """Wait a moment until the goals that have ended are removed from the file."""
        if self._pid == os.getpid():
            done = threading.Event()
            self._queue.put(done)
            done.wait(_FLUSH)

    def _begin(self) -> None:
        """Start the thread; a forked child has none, and needs a queue of its own."""
        with self._lock:
            if self._pid != os.getpid():
                self._queue = queue.SimpleQueue()
                run = partial(self._run, self._queue)
                threading.Thread(target=run, name="actionkit-ledger", daemon=True).start()
                self._pid = os.getpid()

    def _run(self, ended: queue.SimpleQueue[uuid.UUID | threading.Event]) -> None:
        while True:
            items = [ended.get()]
            while not ended.empty():
                items.append(ended.get())
            try:
                self.store.remove(item for item in items if isinstance(item, uuid.UUID))
            except Exception:  # noqa: BLE001  they count as left over: too many are safe
                log_own_error()
            for item in items:
                if isinstance(item, threading.Event):
                    item.set()


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
        with _removers_lock:  # one for each file: see `Lives`
            if self.path not in _removers:
                _removers[self.path] = Remover(Store(self.path))
        self._remover = _removers[self.path]
        self._store = self._remover.store
        self._remove_soon, self._flush = self._remover.remove_soon, self._remover.flush

    def __repr__(self) -> str:
        return f"Ledger({str(self.path)!r})"

    def _add(
        self,
        goal_id: uuid.UUID,
        action: str,
        kind: str,
        domain: int,
        attempts: int = 1,
        judged: bool = False,
    ) -> None:
        """Write a call down before it is sent; the fields are those of `Leftover`.

        Raises:
            LedgerError: The file cannot be used. Then it must not be sent.
        """
        self._store.add((str(goal_id), action, kind, domain, attempts, judged, time.time()))

    def _attempt_id(self, first: uuid.UUID, number: int) -> uuid.UUID:
        """Return the id of a call's goal by the number of the attempt, from 1."""
        return attempt_id(first, number)
