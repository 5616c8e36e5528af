"""The tables of docs/maintainers/faults.md: the required rows, and how tests record them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from tests.faults import attacks, ending
from tests.faults import killed as killing
from tests.faults.lab import (
    ACCEPTED,
    BEFORE_ACCEPT,
    CANCEL,
    DEADLINE,
    ENDS,
    FEEDBACK,
    PHASES,
    POLICIES,
)
from tests.faults.table import Row
from tests.tables import Cell, Key, Page, Seconds

KILL = "SIGKILL"
KILL_RESTART = "SIGKILL, restart"
TERM = "SIGTERM"
TERM_RESTART = "SIGTERM, restart"
STOP = "SIGSTOP, SIGCONT"
STOP_LIVENESS = "SIGSTOP, SIGCONT, with liveness"
OUTAGE = "Network outage, shorter than the lease"
LONG_OUTAGE = "Network outage, longer than the lease"
GIVEN_UP_STOPPED = "Given up on, while the server is stopped"
GIVEN_UP_OUTAGE = "Given up on, during a network outage"
LOSS = "30 % of all packets lost"
TWINS = "Two servers on one name"
OTHER_TYPE = "Another type on the name"

#: The phases in which an outage strikes: a goal can end, and its result be lost on the way.
OUTAGE_PHASES = (ENDS, ACCEPTED, FEEDBACK, BEFORE_ACCEPT)
OTHER_PHASES = (ACCEPTED, FEEDBACK, BEFORE_ACCEPT)
MANY = "100 goals, 10 at a time"
ONE_GOAL = "one goal"

_ALL = dict.fromkeys(PHASES, POLICIES)
_FAULTS: dict[str, Mapping[str, Iterable[str]]] = {
    KILL: _ALL,
    KILL_RESTART: _ALL,
    TERM: _ALL,
    TERM_RESTART: _ALL,
    STOP: _ALL,
    STOP_LIVENESS: _ALL,
    OUTAGE: dict.fromkeys(OUTAGE_PHASES, POLICIES),
    LONG_OUTAGE: dict.fromkeys(OUTAGE_PHASES, POLICIES),
    GIVEN_UP_STOPPED: dict.fromkeys((DEADLINE, CANCEL), ("confirmed_stopped",)),
    GIVEN_UP_OUTAGE: dict.fromkeys((DEADLINE, CANCEL), ("confirmed_stopped",)),
    LOSS: {MANY: ("confirmed_stopped",)},
    TWINS: {ONE_GOAL: POLICIES},
    OTHER_TYPE: dict.fromkeys(OTHER_PHASES, POLICIES),
}
FAULTS: dict[str, list[Key]] = {
    fault: [(phase, policy) for phase, policies in phases.items() for policy in policies]
    for fault, phases in _FAULTS.items()
}
"""The keys of the rows of each fault: phase and policy."""
PAGE = Page("maintainers/faults.md", FAULTS | attacks.TABLES | ending.TABLES | killing.TABLES)


def record(rows: Iterable[Row]) -> None:
    """Compare the rows of one fault with the page. No goal may be left running."""
    found = list(rows)
    assert not [row for row in found if row.left]
    seen: dict[Key, tuple[Cell, ...]] = {
        (row.case.phase, row.case.policy): row.cells for row in found
    }
    PAGE.record(found[0].case.fault, seen)


def attacked(row: attacks.Row) -> None:
    """Compare the row of an attack with the page. Nothing may be left running or be wrong."""
    assert (row.left, row.wrong) == (0, 0), row
    what = row.attack
    PAGE.record(what.section, {(what.what, what.tried): (Seconds(row.delay),)})


def ended(row: ending.Row) -> None:
    """Compare the row of a program that was told to end."""
    PAGE.record(row.case.program, {row.case.key: row.cells})


def killed(row: killing.Row) -> None:
    """Compare the row of a program that was killed, and whose goal was written down."""
    assert (row.received <= 1, row.left) == (True, 0), row
    PAGE.record(killing.TABLE, {row.case.key: row.cells})
