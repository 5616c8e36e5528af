"""The tables of the page "Where it runs" that the tests on servers of the field write."""

from __future__ import annotations

from tests.field.kinds import KINDS
from tests.tables import Cell, Key

CALLS = (
    *("Result", "Abort", "Rejection", "Deadline", "A second goal", "`replaces=`"),
    *("`preempt=True`", "Killed, restarted"),
)
CANCELS = (
    *("Cancel", "At once", "Ignored", "Refused", "`attach`, its cancel", "`cancel_everything`"),
    *("`actionkit cancel`", "`actionkit stop`", "`watch`, `doctor`"),
)
TABLES = {"field: calls": CALLS, "field: cancels": CANCELS}
"""The columns of each table, after that with the server's name."""
OWN = "field: own"
"""The table of what can happen on one server alone, and what the call says then."""
HELD = "yes"
NOT_THERE = "-"
"""The server has nothing of the kind."""
CELL = "cell of docs/where-it-runs.md"
"""The name under which a test tells what it has seen."""
_SERVERS: list[Key] = [(kind.name,) for kind in KINDS]
_OWN: list[Key] = [(kind.name, what) for kind in KINDS for what in kind.own]
KEYS: dict[str, list[Key]] = {**dict.fromkeys(TABLES, _SERVERS), OWN: _OWN}
"""The rows of each table, by their first cells."""


def rows(cells: dict[Key, str]) -> dict[str, dict[Key, tuple[Cell, ...]]]:
    """Return the rows of each table, of the servers that were not skipped.

    Args:
        cells: What was seen, by the server's name and the column, or what happened.
    """
    ran = {server for server, _ in cells}
    seen: dict[str, dict[Key, tuple[Cell, ...]]] = {
        table: {
            (server,): tuple(cells.get((server, column), NOT_THERE) for column in columns)
            for (server,) in _SERVERS
            if server in ran
        }
        for table, columns in TABLES.items()
    }
    return {**seen, OWN: {key: (cells[key],) for key in _OWN if key[0] in ran}}
