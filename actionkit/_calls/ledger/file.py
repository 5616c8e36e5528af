"""A ledger as clients see it: goals are written down at once, and removed a little later."""

from __future__ import annotations

import os
import queue
import signal
import threading
import time
import uuid
from collections import defaultdict
from collections.abc import Callable
from functools import partial
from pathlib import Path

from actionkit._calls.ledger.keys import Asked, KeyHold, take
from actionkit._calls.ledger.store import Store, attempt_id
from actionkit._model.arguments import check_type
from actionkit._threads.diagnostics import log_own_error
from actionkit._threads.waiting import Flag

_FLUSH = 2.0
"""Seconds to wait at a client's end until the goals that have ended are removed from the file."""
_PAUSE = 0.05
"""Seconds after a removal in which goals that have ended are collected, to be removed together. If
the process is killed meanwhile, they count as left over, and turn out to have ended."""
_Item = tuple[Store, uuid.UUID] | Callable[[], object]
"""A call to remove from a file, or something else to do."""
_stores: list[Store] = []
_lock = threading.RLock()
"""For the stores, and for the start of the thread."""


def _before_fork() -> None:
    _lock.acquire()
    for store in _stores:
        store.before_fork()


def _after_fork(*, child: bool) -> None:
    for store in _stores:
        store.after_fork(child=child)
    _lock.release()


os.register_at_fork(
    before=_before_fork,
    after_in_parent=partial(_after_fork, child=False),
    after_in_child=partial(_after_fork, child=True),
)


class _Writer:
    """Writes into files what can wait, on one thread for all of them."""

    def __init__(self) -> None:
        self._pid = 0

    def begin(self) -> None:
        """Start the thread, if there is none. A forked child has none."""
        with _lock:
            if self._pid == os.getpid():
                return
            self._asked: queue.SimpleQueue[_Item] = queue.SimpleQueue()
            self._hurry = Flag()
            run = partial(self._run, self._asked)
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

    def soon(self, item: _Item) -> None:
        """Do it soon. Never blocks; from any thread."""
        if self._pid != os.getpid():
            self.begin()
        self._asked.put(item)

    def at_once(self, item: Callable[[], object]) -> None:
        """Do it soon, without a pause before it. Never blocks; from any thread."""
        self.soon(item)
        if self._pid == os.getpid():
            self._hurry.set()
        else:  # no more threads
            item()

    def flush(self) -> None:
        """Wait a moment until all that was asked for is done, for all files."""
        if self._pid == os.getpid():
            done = Flag()
            self.at_once(done.set)
            done.wait(_FLUSH)

    def _run(self, asked: queue.SimpleQueue[_Item]) -> None:
        while True:
            items = [asked.get()]
            while not asked.empty():
                items.append(asked.get())
            ended: dict[Store, list[uuid.UUID]] = defaultdict(list)
            others: list[Callable[[], object]] = []
            for item in items:
                if callable(item):
                    others.append(item)
                else:
                    ended[item[0]].append(item[1])
            steps: list[Callable[[], object]] = []
            steps += (partial(store.remove, goal_ids) for store, goal_ids in ended.items())
            for step in [*steps, *others]:
                try:
                    step()
                except Exception:  # noqa: BLE001  they count as left over: too many are safe
                    log_own_error()
            self._hurry.wait(_PAUSE)  # many at once cost hardly more than one
            self._hurry = Flag()


_writer = _Writer()
flush = _writer.flush


class LedgerFile:
    """The file of a ledger."""

    def __init__(self, path: str | os.PathLike[str], *, durable: bool = False) -> None:
        """Open the file, or make it.

        Args:
            path: The file. More files appear beside it: its name with `-wal`, `-shm` or `-alive`.
            durable: Whether each write waits until it is on the disk. Then a power cut loses
                nothing, but a write takes as long as the disk needs, mostly some milliseconds.
                Without it, a power cut can lose the last seconds; a crash of the program loses
                nothing in either case. It counts for all ledgers of this process with this file.

        Raises:
            LedgerError: The file cannot be used.
            TypeError: An argument of the wrong type.
        """
        check_type("durable", durable, bool)
        self.path = Path(path).resolve()
        with _lock:  # one for each file: a process has one number in it
            usable = [one for one in _stores if one.path == self.path and one.is_there()]
            self._store = usable[0] if usable else Store(self.path)
            if not usable:
                _stores.append(self._store)
        if durable:
            self._store.make_durable()
        _writer.begin()  # now: while a program ends, Python starts no more threads

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

    def _take(
        self, key: str, asked: Asked, check: Callable[[Asked], None], *, attempts: int, judged: bool
    ) -> KeyHold:
        """Write a call with a key down; see `keys.take`."""
        soon = _writer.at_once
        return take(self._store, soon, key, asked, check, attempts=attempts, judged=judged)

    def _attempt_id(self, first: uuid.UUID, number: int) -> uuid.UUID:
        """Return the id of a call's goal by the number of the attempt, from 1."""
        return attempt_id(first, number)

    def _remove_soon(self, goal_id: uuid.UUID) -> None:
        """Remove a call. Never blocks; from any thread."""
        _writer.soon((self._store, goal_id))

    def _limit_soon(self, goal_id: uuid.UUID, attempts: int) -> None:
        """Record that a call sends no more goals than these. Never blocks; from any thread."""
        _writer.soon(partial(self._store.limit, goal_id, attempts))

    def _do_at_once(self, do: Callable[[], object]) -> None:
        """Do something with the file, without a pause before it. Never blocks; from any thread."""
        _writer.at_once(do)
