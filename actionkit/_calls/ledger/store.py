"""Keeps goals in an SQLite file that several processes share. There is one for each file."""

from __future__ import annotations

import os
import socket
import sqlite3
import threading
import time
import uuid
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary

from actionkit._calls.ledger.lives import Lives
from actionkit._model.errors import LedgerError

_BUSY = 5.0
"""Seconds to wait for another process that writes; a write takes some 50 microseconds."""
_AGAIN = 0.01
"""Seconds between two tries to make the file."""
_PAGE = 1024
"""Bytes of a new file's pages: each write writes some whole, and a goal takes some 100 bytes."""
_MOST_IN_USE = 1000
"""Processes that may still use an earlier file, which was removed: their numbers are not free."""
_VERSION = 2
_FULL = "PRAGMA synchronous=FULL"
_SCHEMA = """
CREATE TABLE processes (number INTEGER PRIMARY KEY AUTOINCREMENT, pid INTEGER, host TEXT);
CREATE TABLE goals (
  goal_id TEXT PRIMARY KEY, action TEXT, type TEXT, domain INTEGER, attempts INTEGER,
  judged INTEGER, parallel INTEGER, sent REAL, owner INTEGER, holder INTEGER, follows INTEGER
) WITHOUT ROWID;
"""
ADD = "INSERT INTO goals VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, NULL, 0)"
REMOVE = "DELETE FROM goals WHERE goal_id = ?"
_CLAIM = "UPDATE goals SET holder = ?, follows = ? WHERE goal_id = ?"
LIMIT = "UPDATE goals SET attempts = ? WHERE goal_id = ?"
RELEASE = "UPDATE goals SET holder = NULL WHERE goal_id = ? AND holder = ?"
_KEYS = (  # an earlier version of ActionKit leaves this table alone
    "CREATE TABLE IF NOT EXISTS keys (key TEXT PRIMARY KEY, action TEXT, type TEXT, layout TEXT,"
    " domain INTEGER, goal BLOB, call_id TEXT, attempt INTEGER, state INTEGER, result BLOB,"
    " changed REAL)"
)
_ALL = (
    "SELECT goal_id, goals.action, goals.type, goals.domain, attempts, judged, parallel, sent, pid,"
    " host, key, owner, holder, follows FROM goals JOIN processes ON number = owner"
    " LEFT JOIN keys ON call_id = goal_id {} ORDER BY sent"
)
_HELD = "WHERE holder IS NOT NULL"
_IDLE = "SELECT number FROM processes WHERE number NOT IN (SELECT owner FROM goals)"


@dataclass(frozen=True)
class Leftover:
    """A call of a process that has ended. Its goals may still run."""

    goal_id: uuid.UUID
    """The id of its first goal."""
    action_name: str
    """The full name of the action."""
    type_name: str
    """The action's type, such as `test_msgs/action/Fibonacci`."""
    domain_id: int
    """The ROS domain of its client."""
    attempts: int
    """How many goals it may have sent at most."""
    judged: bool
    """Whether `classify=` decides. Then the call can send another goal even after a success."""
    parallel: bool
    """Whether `resend=` allows another goal while one may still run."""
    sent: float
    """When its first goal was sent, or waited for a server, in seconds since the epoch."""
    pid: int
    """The id of its process (PID)."""
    host: str
    """The name of the computer or container of its process."""
    key: str | None = None
    """The `key=` of the call, if it has one."""

    def has(self, goal_id: uuid.UUID) -> bool:
        """Whether a goal belongs to this call: as its first goal, or as a retry."""
        return 1 <= attempt_number(self.goal_id, goal_id) <= self.attempts


def attempt_id(first: uuid.UUID, number: int) -> uuid.UUID:
    """Return the id of a call's goal by the number of the attempt, from 1.

    So the file need not be written again before a retry.
    """
    return uuid.UUID(int=first.int + number - 1)


def attempt_number(first: uuid.UUID, goal_id: uuid.UUID) -> int:
    """Return the number of the attempt with this goal, from 1."""
    return goal_id.int - first.int + 1


@dataclass(frozen=True)
class Row:
    """A leftover, and who has it in hand."""

    goal: Leftover
    owner: int
    holder: int | None
    """The process that cancels or follows it, if any."""
    follows: bool
    """Whether the holder follows it."""


def _row(
    goal_id: str,
    action: str,
    kind: str,
    domain: int,
    attempts: int,
    judged: int,
    parallel: int,
    sent: float,
    pid: int,
    host: str,
    key: str | None,
    owner: int,
    holder: int | None,
    follows: int,
) -> Row:
    call = uuid.UUID(goal_id), action, kind, domain, attempts, bool(judged), bool(parallel)
    return Row(Leftover(*call, sent, pid, host, key), owner, holder, bool(follows))


class Store:
    """The file, for this process. All methods may be called from any thread; they block.

    Each raises `LedgerError` if the file cannot be used.
    """

    def __init__(self, path: Path) -> None:
        """Open the file, or make it."""
        self.path = path
        self._durable = False
        self.holds: WeakValueDictionary[str, Any] = WeakValueDictionary()
        """What the calls of this process hold, by the key: `KeyHold`."""
        self._name = str(path)
        self.lock = threading.RLock()  # a signal handler may come in the middle
        self._pid = 0
        self._db: sqlite3.Connection | None = None
        with self._used():
            pass

    def before_fork(self) -> None:
        """Hold the lock, until `after_fork`, and have nothing open that both processes would have.

        So a child finds neither the lock nor SQLite in the hands of a thread that it has not got.
        """
        self.lock.acquire()
        if self._db is not None:
            self._db.close()
            self._db = None

    def after_fork(self, *, child: bool) -> None:
        """Go on, in both processes. Each opens the file again."""
        if child:
            self._lives.close()  # or the parent would count as alive for as long as the child lives
            self.holds.clear()
        self.lock.release()

    def make_durable(self) -> None:
        """Wait at each write from now on until it is on the disk, for power cuts."""
        with self._used() as db:
            self._durable = True
            db.execute(_FULL)

    def is_there(self) -> bool:
        """Whether the file is still at its path. Raises nothing."""
        with suppress(OSError):
            return self._lives.is_at(self._name)
        return False

    @property
    def number(self) -> int:
        """The number of this process in the file."""
        return self._number

    def is_alive(self, number: int) -> bool:
        """Whether the process with this number lives."""
        return self._lives.is_alive(number)

    @contextmanager
    def change(self) -> Iterator[sqlite3.Connection]:
        """Give the file, for changes that are made together, or not at all."""
        with self._used() as db, _transaction(db):
            yield db

    def add(self, row: tuple[object, ...]) -> None:
        """Write a call of this process down: the columns from `goal_id` to `sent`."""
        with self._used() as db:
            self.check_there()
            db.execute(ADD, (*row, self._number))

    def remove(self, goal_ids: Iterable[uuid.UUID]) -> None:
        """Remove calls that have no goal that may run."""
        with self.change() as db:
            db.executemany(REMOVE, [(str(one),) for one in goal_ids])

    def limit(self, goal_id: uuid.UUID, attempts: int) -> None:
        """Record that a call sends no more goals than these."""
        with self._used() as db:
            db.execute(LIMIT, (attempts, str(goal_id)))

    def writers(self) -> set[int]:
        """Return the ids of the living processes that write here."""
        with self._used() as db:
            here = (socket.gethostname(),)
            rows = db.execute("SELECT number, pid FROM processes WHERE host = ?", here).fetchall()
            return {pid for number, pid in rows if self._lives.is_alive(number)}

    def leftovers(self) -> list[Leftover]:
        """Return the calls of dead processes that no living one has in hand, oldest first."""
        return [row.goal for row in self._rows() if not self._is_held(row)]

    def in_other_hands(self) -> dict[Leftover, bool]:
        """Return the calls of dead processes that another living one cancels or follows.

        The value is whether it follows the goal.
        """
        rows = self._rows(_HELD)
        return {
            row.goal: row.follows
            for row in rows
            if self._is_held(row) and row.holder != self._number
        }

    def claim(
        self, wanted: Callable[[Leftover], bool], claimed: list[Leftover], *, follows: bool
    ) -> None:
        """Take in hand what is wanted of the leftovers, and add it to a list, oldest first."""
        with self.change() as db:
            goals = [goal for goal in self.leftovers() if wanted(goal)]
            claimed += goals  # before: to give back what is not ours does nothing
            db.executemany(_CLAIM, [(self._number, follows, str(goal.goal_id)) for goal in goals])

    def end_claims(self, goals: Iterable[Leftover], stopped: Iterable[Leftover] = ()) -> None:
        """Remove those that have stopped, and give the others back: they are left over again."""
        with self.change() as db:
            db.executemany(REMOVE, [(str(goal.goal_id),) for goal in stopped])
            db.executemany(RELEASE, [(str(goal.goal_id), self._number) for goal in goals])

    def _rows(self, where: str = "") -> list[Row]:
        """Return the calls of dead processes, or some of them."""
        with self._used() as db:
            rows = [_row(*cells) for cells in db.execute(_ALL.format(where)).fetchall()]
            alive = {owner: self._lives.is_alive(owner) for owner in {row.owner for row in rows}}
        return [row for row in rows if not alive[row.owner]]

    def _is_held(self, row: Row) -> bool:
        return row.holder is not None and self._lives.is_alive(row.holder)

    @contextmanager
    def _used(self) -> Iterator[sqlite3.Connection]:
        try:
            with self.lock:
                yield self._db or self._open()
        except LedgerError:
            raise
        except (sqlite3.Error, OSError) as error:
            raise LedgerError(
                f"the ledger {self.path} cannot be used ({error}), so nothing was sent. Make room"
                " on its disk, or name another file, on a disk of this computer"
            ) from error

    def check_there(self) -> None:
        """Raise `LedgerError` if the file is gone: nobody would find what is written into it."""
        if not self._lives.is_at(self._name):
            raise LedgerError(
                f"the ledger {self.path} was removed, renamed, replaced or emptied while this"
                " program used it, so nothing was sent. Put the file back, or start the program"
                " again"
            )

    def _open(self) -> sqlite3.Connection:
        again = self._pid == os.getpid()  # in a parent after its fork
        if again:
            self.check_there()
        else:
            Path(f"{self._name}-alive").touch()  # its error says more than SQLite's
        with ExitStack() as unless_used:
            db = sqlite3.connect(
                self.path, timeout=_BUSY, isolation_level=None, check_same_thread=False
            )
            unless_used.callback(db.close)
            _make_file(db)
            if not again:
                db.execute("PRAGMA user_version").fetchone()  # SQLite opens all files only now
                lives = Lives(self._name)
                unless_used.callback(lives.close)
                with _transaction(db):
                    self._number = _begin(db, lives)
                self._lives, self._pid = lives, os.getpid()
            if self._durable:
                db.execute(_FULL)
            self._db = db
            unless_used.pop_all()
        return db


def _make_file(db: sqlite3.Connection) -> None:
    """Set how the file is written; make it if there is none."""
    db.execute(f"PRAGMA page_size={_PAGE}")
    until = time.monotonic() + _BUSY
    while True:  # SQLite itself does not wait here for another process that makes the file
        try:
            db.execute("PRAGMA journal_mode=WAL")
            break
        except sqlite3.OperationalError:
            if time.monotonic() >= until:
                raise
            time.sleep(_AGAIN)
    db.execute("PRAGMA synchronous=NORMAL")


def _begin(db: sqlite3.Connection, lives: Lives) -> int:
    """Make the tables if there are none, and write this process down; return its number."""
    (version,) = db.execute("PRAGMA user_version").fetchone()
    if version == 0:
        for statement in _SCHEMA.split(";"):
            db.execute(statement)
        db.execute(f"PRAGMA user_version={_VERSION}")
    elif version != _VERSION:
        raise sqlite3.DatabaseError(f"its version is {version}, and not {_VERSION}")
    db.execute(_KEYS)
    me = (os.getpid(), socket.gethostname())
    for _ in range(_MOST_IN_USE):
        cursor = db.execute("INSERT INTO processes (pid, host) VALUES (?, ?)", me)
        number = int(cursor.lastrowid or 0)
        if lives.begin(number):  # before others can see the number
            break
    else:
        raise BlockingIOError("another program has locked its -alive file")
    dead = [row for row in db.execute(_IDLE).fetchall() if not lives.is_alive(row[0])]
    db.executemany("DELETE FROM processes WHERE number = ?", dead)
    return number


@contextmanager
def _transaction(db: sqlite3.Connection) -> Iterator[None]:
    """Do it as one; within another one, as a part of that (a signal handler, `claim`)."""
    if db.in_transaction:
        yield
        return
    try:
        db.execute("BEGIN IMMEDIATE")  # Ctrl-C may be heard only after it
        yield
        db.execute("COMMIT")
    except BaseException:  # also Ctrl-C: nothing of it may count
        if db.in_transaction:
            db.execute("ROLLBACK")
        raise
