"""The tables of the page "Where it runs" that the tests on servers of the field write."""

from __future__ import annotations

from tests.field.kinds import KINDS
from tests.tables import Cell, Key, Page

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
HELD = "yes"
NOT_THERE = "-"
"""The server has nothing of the kind."""
CELL = "cell of docs/where-it-runs.md"
"""The name under which a test tells what it has seen."""
PAGE = Page("where-it-runs.md", {table: [(kind.name,) for kind in KINDS] for table in TABLES})


def rows(cells: dict[tuple[str, str], str]) -> dict[str, dict[Key, tuple[Cell, ...]]]:
    """Return the rows of each table.

    Args:
        cells: What was seen, by the server's name and the column.
    """
    return {
        table: {
            (kind.name,): tuple(cells.get((kind.name, column), NOT_THERE) for column in columns)
            for kind in KINDS
        }
        for table, columns in TABLES.items()
    }
