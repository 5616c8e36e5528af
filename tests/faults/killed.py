"""A program that is killed, and what then stops its goal, as in docs/maintainers/faults.md."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from tests.tables import Cell, Key, Seconds

TABLE = "A killed program, with a ledger"

NOT_SENT = "not sent yet"
SENT = "sent, not accepted yet"
ACCEPTED = "accepted, waits for its turn"
EXECUTING = "executing"
CANCELLING = "cancelling"

#: The server in each phase, its options, and the event after which the program is killed.
PHASES: dict[str, tuple[str, dict[str, Any], str]] = {
    NOT_SENT: ("never_finishes", {}, ""),
    SENT: ("slow_accept", {"gate": 1, "period": 0.3}, "goal_received"),
    ACCEPTED: ("queued", {"period": 0.3}, "accepted"),
    EXECUTING: ("never_finishes", {}, "executing"),
    CANCELLING: ("slow_cancel", {"gate": 1}, "cancel_requested"),
}

START_CANCELS = "the next start: `ledger.cancel()`"
START_FOLLOWS = "the next start: `ledger.attach(client)`"
GUARD = "its guard"
NEXT_GUARD = "the next guard: the first was killed, too"
WAYS = (START_CANCELS, START_FOLLOWS, GUARD, NEXT_GUARD)

#: Gets the action's name and the phase; prints its process and the goal, before that is sent. What
#: it reads makes it cancel.
PROGRAM = """
import os, signal, sys
from actionkit import Client, Timeouts
from actionkit._calls.ledger.file import LedgerFile
from test_msgs.action import Fibonacci

add = LedgerFile._add

def tell(ledger, goal_id, *more, **how):
    add(ledger, goal_id, *more, **how)
    print(os.getpid(), goal_id, flush=True)
    if sys.argv[2] == "not sent yet":
        os.kill(os.getpid(), signal.SIGKILL)

LedgerFile._add = tell
client = Client(Fibonacci, sys.argv[1], timeouts=Timeouts(server=None, accept=None, cancel=60.0))
future = client.call_async({"order": 100})
for _ in sys.stdin:
    future.cancel()
"""


@dataclass(frozen=True)
class Case:
    """How far the goal is when its program is killed, and what stops it."""

    way: str
    phase: str

    @property
    def key(self) -> Key:
        """Of its row."""
        return self.way, self.phase


@dataclass(frozen=True)
class Row:
    """What came of it."""

    case: Case
    received: int  # how many goals the server got
    left: int
    seconds: float

    @property
    def cells(self) -> tuple[Cell, ...]:
        """How it is written."""
        never = self.case.phase == NOT_SENT
        return self.received, "-" if never else Seconds(self.seconds)


CASES = [Case(way, phase) for way in WAYS for phase in PHASES]
TABLES: dict[str, list[Key]] = {TABLE: [case.key for case in CASES]}
BY_DEFAULT = (
    Case(START_CANCELS, SENT),
    Case(START_FOLLOWS, NOT_SENT),
    Case(GUARD, EXECUTING),
    Case(NEXT_GUARD, CANCELLING),
)
"""Each way once; the rest takes long."""
