"""The calls of a ledger that have a key: what each has sent, and how it ended.

What such a call asks for is written down before it begins, each goal before it is sent, and the end
before the call's future ends. So a program that is started again does nothing twice.
"""

from __future__ import annotations

import sqlite3
import time
import uuid
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from typing import Any, Literal, NamedTuple

from actionkit._calls.ledger.store import (
    ADD,
    LIMIT,
    RELEASE,
    REMOVE,
    Leftover,
    Store,
    attempt_id,
)
from actionkit._model.errors import LedgerError


class KeyState(IntEnum):
    """What is written down about the latest goal of a key. The numbers are in the files."""

    SENT = 0
    """It may run, or may have finished."""
    STOPPED = 1
    """It has failed, or none was sent: another goal may be."""
    SUCCEEDED = 2
    LEFT = 3
    """It may run, because its caller has left it running on purpose."""


KeyFate = Literal["running", "unknown", "stopped", "succeeded"]
_FIND = (
    "SELECT action, type, layout, domain, goal, call_id, attempt, state, result, changed"
    " FROM keys WHERE key = ?"
)
_IN_HANDS_OF = (
    "SELECT owner, holder, follows, pid, host FROM goals"
    " LEFT JOIN processes ON number = coalesce(holder, owner) WHERE goal_id = ?"
)
_PUT = "INSERT OR REPLACE INTO keys VALUES (?, ?, ?, ?, ?, ?, ?, 0, 1, NULL, ?)"
_JOIN = "UPDATE keys SET state = 0 WHERE key = ?"
_BY_KEY = 2
"""In the column `follows`: who has the goal in hand is a call with its key."""
_CLAIM = (
    f"UPDATE goals SET holder = ?, follows = {_BY_KEY}, attempts = ?, judged = max(judged, ?)"
    " WHERE goal_id = ?"
)
_SENDS = "UPDATE keys SET attempt = ?, state = 0 WHERE key = ?"
_END = "UPDATE keys SET state = ?, result = ?, changed = ? WHERE key = ? AND state = 0"
_LATEST = "SELECT attempt FROM keys WHERE key = ? AND call_id = ?"
_MOST = "UPDATE goals SET attempts = max(attempts, ?) WHERE goal_id = ?"
_STOPPED = "UPDATE keys SET state = 1 WHERE key = ? AND call_id = ? AND state = 0"
_FORGET = "DELETE FROM keys WHERE key = ?"
_ALL = (
    "SELECT key, state, goal_id IS NOT NULL FROM keys LEFT JOIN goals ON goal_id = call_id"
    " ORDER BY keys.rowid"
)
_Then = Callable[[Exception | None], object]
_Steps = Sequence[tuple[str, tuple[object, ...]]]


class Asked(NamedTuple):
    """What a call with a key asks for, as it is written down."""

    action_name: str
    type_name: str
    layout: str
    """A hash of the goal's and the result's fields: another version of the type has another one."""
    domain_id: int
    goal: bytes
    """The goal message, serialised."""


@dataclass(eq=False)
class KeyHold:
    """The key of one call, until a later call takes it. The call has the only reference to it."""

    store: Store
    soon: Callable[[Callable[[], object]], object]
    """Does something on the ledger's thread."""
    key: str
    call_id: uuid.UUID
    """The id of the call's first goal. Those of later ones follow from it."""
    attempt: int = 0
    """The number of the latest goal that may have been sent, from 1."""
    joins: bool = False
    """Whether that goal is of an earlier call. It may run, or may have finished."""
    result: bytes | None = None
    """The result that is kept, serialised; then nothing is sent."""
    since: float = 0.0
    """When the result was written, in seconds since the epoch."""
    over: bool = False
    """Whether the call is over, though its goal may run."""
    undo: _Steps = ()
    """What gives the key back as it was taken."""

    def id_of(self, attempt: int) -> uuid.UUID:
        """Return the id of a goal by its number, from 1."""
        return attempt_id(self.call_id, attempt)

    def sends(self, attempt: int, then: _Then) -> None:
        """Write down that a goal is to be sent now; if that fails, it must not be.

        `then` gets what was wrong, if anything, on another thread.
        """
        self.attempt = attempt
        steps = (_SENDS, (attempt, self.key)), (_MOST, (attempt, str(self.call_id)))
        self.soon(partial(self._write, steps, then, sends=True))

    def stopped(self) -> None:
        """Write down soon that the goal has failed, and that another one may follow."""
        self.soon(partial(self._write, [(_STOPPED, (self.key, str(self.call_id)))], repr))

    def give_back(self, then: _Then = repr) -> None:
        """Write down soon that the call is over, and has neither sent nor followed a goal.

        A goal that an earlier call has sent is left over again, or runs on purpose again.
        """
        self.soon(partial(self._write, self.undo, then))

    def end(self, state: KeyState, result: bytes | None, then: _Then, *, runs: bool) -> None:
        """Write down how the call has ended; with `runs`, its goal may run on.

        `then` gets what was wrong, if anything, on another thread.
        """
        call_id = str(self.call_id)
        goal = (LIMIT, (self.attempt, call_id)) if runs else (REMOVE, (call_id,))
        steps = (_END, (state, result, time.time(), self.key)), goal
        self.soon(partial(self._write, steps, then))

    def _write(self, steps: _Steps, then: _Then, *, sends: bool = False) -> None:
        problem = None
        try:
            with self.store.change() as db:
                if sends:
                    self.store.check_there()
                latest = db.execute(_LATEST, (self.key, str(self.call_id))).fetchone()
                is_mine = self.store.holds.get(self.key) in (None, self)
                if is_mine and latest is not None and latest[0] <= self.attempt:
                    for step, cells in steps:  # else a later call has the key, or has sent more
                        db.execute(step, cells)
        except Exception as error:  # noqa: BLE001  somebody waits for `then`
            problem = error
        then(problem)


def take(
    store: Store,
    soon: Callable[[Callable[[], object]], object],
    key: str,
    asked: Asked,
    check: Callable[[Asked], None],
    *,
    attempts: int,
    judged: bool,
) -> KeyHold:
    """Write a call down, or find out what an earlier one with its key has done.

    Args:
        store: The ledger's file.
        soon: Does something on the ledger's thread.
        key: The key.
        asked: What the call asks for.
        check: Raises `ValueError` if the earlier call has asked for something else.
        attempts: How many goals it sends at most.
        judged: Whether `classify=` decides.

    Raises:
        LedgerError: The file cannot be used; or a call in flight, or another process, has the key.
        ValueError: As `check`.
    """
    with store.lock:
        with store.change() as db:
            store.check_there()
            _check_not_in_flight(store, key)
            row = db.execute(_FIND, (key,)).fetchone()
            hold = KeyHold(store, soon, key, uuid.uuid4())
            if row is not None:
                hold = _go_on(store, db, hold, row, check)
            if hold.result is not None:
                return hold
            _write_down(store, db, hold, asked, attempts, judged)
        store.holds[key] = hold
    return hold


def _go_on(
    store: Store,
    db: sqlite3.Connection,
    hold: KeyHold,
    row: tuple[Any, ...],
    check: Callable[[Asked], None],
) -> KeyHold:
    """Return what an earlier call has left, or `hold` if another goal may be sent."""
    *was, call_id, attempt, state, result, since = row
    check(Asked(*was))
    earlier = KeyHold(store, hold.soon, hold.key, uuid.UUID(call_id), attempt)
    if state == KeyState.SUCCEEDED:
        earlier.result, earlier.since = result, since
        return earlier
    is_left = _check_in_no_other_hands(store, db, earlier)
    if state == KeyState.STOPPED:
        db.execute(REMOVE, (call_id,))
        return hold
    earlier.joins = True
    if is_left:
        earlier.undo = (LIMIT, (attempt, call_id)), (RELEASE, (call_id, store.number))
    else:
        earlier.undo = (REMOVE, (call_id,)), (_END, (state, None, since, hold.key))
    return earlier


def _write_down(
    store: Store, db: sqlite3.Connection, hold: KeyHold, asked: Asked, attempts: int, judged: bool
) -> None:
    call_id, now, most = str(hold.call_id), time.time(), hold.attempt + attempts
    if db.execute(_CLAIM, (store.number, most, judged, call_id)).rowcount:
        return  # of an earlier call
    what = asked.action_name, asked.type_name, asked.domain_id
    db.execute(ADD, (call_id, *what, most, judged, False, now, store.number))
    if hold.joins:
        db.execute(_JOIN, (hold.key,))
    else:
        hold.undo = ((REMOVE, (call_id,)),)
        db.execute(_PUT, (hold.key, *asked, call_id, now))


def forget(store: Store, key: str) -> bool:
    """Remove a key; return whether it was there. Raises `LedgerError` if its goal may run."""
    with store.change() as db:
        _check_not_in_flight(store, key)
        row = db.execute(_FIND, (key,)).fetchone()
        if row is None:
            return False
        hold, state = KeyHold(store, repr, key, uuid.UUID(row[5]), row[6]), row[7]
        in_hands = db.execute(_IN_HANDS_OF, (row[5],)).fetchone()
        if state == KeyState.STOPPED:
            _check_in_no_other_hands(store, db, hold)
            db.execute(REMOVE, (row[5],))
        elif state == KeyState.LEFT or (in_hands is not None and state == KeyState.SENT):
            raise LedgerError(
                f"goal {hold.id_of(hold.attempt)} of key {key!r} may still run, so the key cannot"
                " be forgotten. Call with the key to follow the goal, or cancel it first"
            )
        db.execute(_FORGET, (key,))
    return True


def fates(store: Store) -> dict[str, KeyFate]:
    """Return the keys, oldest first, and what is known of the goal of each."""
    with store.change() as db:
        rows = db.execute(_ALL).fetchall()
    return {key: _fate(state, may_run=bool(row)) for key, state, row in rows}


def confirm_stopped(store: Store, leftovers: Iterable[Leftover]) -> None:
    """Record that these were stopped: another goal may be sent with their keys."""
    calls = [(one.key, str(one.goal_id)) for one in leftovers if one.key is not None]
    with store.change() as db:
        db.executemany(_STOPPED, calls)


def _fate(state: int, *, may_run: bool) -> KeyFate:
    if state == KeyState.SUCCEEDED:
        return "succeeded"
    if state == KeyState.STOPPED:
        return "stopped"
    return "running" if may_run or state == KeyState.LEFT else "unknown"


def _check_not_in_flight(store: Store, key: str) -> None:
    held = store.holds.get(key)
    if held is not None and not held.over:
        raise LedgerError(
            f"key {key!r} is in the hands of another call of this process, so nothing was sent."
            " Wait until that call is over"
        )


def _check_in_no_other_hands(store: Store, db: sqlite3.Connection, hold: KeyHold) -> bool:
    """Return whether its goals are written down. Raise `LedgerError` if somebody has them."""
    row = db.execute(_IN_HANDS_OF, (str(hold.call_id),)).fetchone()
    if row is None:
        return False
    owner, holder, follows, pid, host = row
    mine = {store.number} if holder is None or follows == _BY_KEY else set()
    if any(store.is_alive(number) for number in {owner, holder} - {None} - mine):
        raise LedgerError(
            f"key {hold.key!r} is in the hands of process {pid} on {host}, so nothing was sent: it"
            f" sends goal {hold.id_of(max(hold.attempt, 1))}, or follows or cancels it. Wait until"
            " that is over"
        )
    return True
