"""Keeps goals in an SQLite file that several processes share. There is one for each file."""

from __future__ import annotations

import os
import socket
import sqlite3
import threading
import uuid
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from actionkit._calls.ledger.lives import Lives
from actionkit._model.errors import LedgerError

_BUSY = 5.0
"""Seconds to wait for another process that writes; a write takes some 50 microseconds."""
_VERSION = 1
_SCHEMA = """
CREATE TABLE processes (number INTEGER PRIMARY KEY AUTOINCREMENT, pid INTEGER, host TEXT);
CREATE TABLE goals (
  goal_id TEXT PRIMARY KEY, action TEXT, type TEXT, domain INTEGER, attempts INTEGER,
  judged INTEGER, sent REAL, process INTEGER
);
"""
_ADD = "INSERT INTO goals VALUES (?, ?, ?, ?, ?, ?, ?, ?)"


@dataclass(frozen=True)
class Leftover:
    """A call of a process that has ended. Its goals may still run."""

    goal_id: uuid.UUID
    """The id of its first goal. `ids()` has those of its retries, too."""
    action_name: str
    """The full name of the action."""
    type_name: str
    """The action's type, such as `test_msgs/action/Fibonacci`."""
    domain_id: int
    """The ROS domain of its client."""
    attempts: int
    """How many goals it can have sent, one after the other."""
    judged: bool
    """Whether `classify=` decides, so that even after a success another goal can be sent."""
    sent: float
    """When the first was sent, or was waiting for a server: in seconds since the epoch."""
    pid: int
    """The number of its process."""
    host: str
    """The name of the computer, or container, of its process."""
    process: int
    """A number for its process in the file."""

    def ids(self) -> Iterator[uuid.UUID]:
        """Yield the ids that its goals can have."""
        return (attempt_id(self.goal_id, number) for number in range(1, self.attempts + 1))


def attempt_id(first: uuid.UUID, number: int) -> uuid.UUID:
    """Return the id of a call's goal by the number of the attempt, from 1.

    So the file need not be written again before a retry.
    """
    return first if number == 1 else uuid.uuid5(first, str(number))


class Store:
    """The file, for this process. All methods may be called from any thread; they block.

    Each raises `LedgerError` if the file cannot be used.
    """

    def __init__(self, path: Path) -> None:
        """Open the file, or make it."""
        self._path = path
        self._lock = threading.Lock()
        self._inherited: list[object] = []
        with self._errors():
            self._open()
        # So a child finds neither the lock nor SQLite in the hands of a thread that it has not got.
        os.register_at_fork(
            before=self._lock.acquire,
            after_in_parent=self._lock.release,
            after_in_child=self._lock.release,
        )

    def _open(self) -> None:
        self._pid = os.getpid()
        self._lives = Lives(f"{self._path}-alive")
        self._db = db = sqlite3.connect(
            self._path, timeout=_BUSY, isolation_level=None, check_same_thread=False
        )
        db.execute("PRAGMA journal_mode=WAL")
        db.execute("PRAGMA synchronous=NORMAL")
        with self._transaction():
            (version,) = db.execute("PRAGMA user_version").fetchone()
            if version == 0:
                for statement in _SCHEMA.split(";"):
                    db.execute(statement)
                db.execute(f"PRAGMA user_version={_VERSION}")
            elif version != _VERSION:
                raise sqlite3.DatabaseError(f"its version is {version}, and not {_VERSION}")
            host = (self._pid, socket.gethostname())
            cursor = db.execute("INSERT INTO processes (pid, host) VALUES (?, ?)", host)
            self._number = int(cursor.lastrowid or 0)
            self._lives.begin(self._number)  # before others can see the number

    def add(self, row: tuple[object, ...]) -> None:
        """Write a call of this process down: the columns from `goal_id` to `sent`."""
        with self._used():
            self._db.execute(_ADD, (*row, self._number))

    def remove(self, goal_ids: Iterable[uuid.UUID]) -> None:
        """Remove calls that have no goal that may run."""
        with self._used(), self._transaction():
            rows = [(str(one),) for one in goal_ids]
            self._db.executemany("DELETE FROM goals WHERE goal_id = ?", rows)

    def leftovers(self) -> list[Leftover]:
        """Return the calls of processes that have ended, oldest first."""
        with self._used():
            found = self._db.execute(
                "SELECT goal_id, action, type, domain, attempts, judged, sent, pid, host, process"
                " FROM goals JOIN processes ON number = process ORDER BY sent"
            ).fetchall()
            rows = [Leftover(uuid.UUID(row[0]), *row[1:]) for row in found]
            alive = {one: self._lives.is_alive(one) for one in {row.process for row in rows}}
        return [row for row in rows if not alive[row.process]]

    def claim(self, goal: Leftover) -> bool:
        """Make it this process's own; return whether nobody else was faster."""
        return self._move(goal, goal.process, self._number)

    def release(self, goal: Leftover) -> None:
        """Give a claimed one back: it is left over again."""
        self._move(goal, self._number, goal.process)

    def _move(self, goal: Leftover, old: int, new: int) -> bool:
        with self._used():
            cursor = self._db.execute(
                "UPDATE goals SET process = ? WHERE goal_id = ? AND process = ?",
                (new, str(goal.goal_id), old),
            )
            return cursor.rowcount == 1

    @contextmanager
    def _used(self) -> Iterator[None]:
        with self._lock, self._errors():
            if self._pid != os.getpid():
                # A forked child must not use its parent's connection, and not close it either.
                self._inherited += [self._db, self._lives]
                self._open()
            yield

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._db.execute("BEGIN IMMEDIATE")
        try:
            yield
        except BaseException:
            self._db.execute("ROLLBACK")
            raise
        self._db.execute("COMMIT")

    @contextmanager
    def _errors(self) -> Iterator[None]:
        try:
            yield
        except (sqlite3.Error, OSError) as error:
            raise LedgerError(
                f"the ledger {self._path} cannot be used ({error}), so nothing was sent. Make room"
                " on its disk, give another path, or do without it: ledger=None, and no"
                " ACTIONKIT_LEDGER"
            ) from error
