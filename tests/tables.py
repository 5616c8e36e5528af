"""Tables in `docs/` that tests write, and compare with their own results.

A table is between two marks, and everything else on the page is written by hand, the head of
the table too:

    <!-- table: NAME -->

    | head | head |
    |---|---|
    | cells that say what was tried | cells that say what was seen |

    <!-- end of table -->

Rows that differ only in the last of several cells of their key share a line, with `; ` between.

With `ACTIONKIT_WRITE_TABLES=1` in the environment, tests write the rows that they try. Run them in
one process then (`-n 0`), since each of them writes the whole page.
"""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
VARIABLE = "ACTIONKIT_WRITE_TABLES"
WRITING = os.environ.get(VARIABLE) == "1"
ROOM = 1.9
"""Times differ from run to run: a bound is this many times what was seen when it was written."""
_LEASE = "about 20 s"  # of the middleware: it is not to the second
BOUNDS = (*(f"< {n} s" for n in (2, 4, 5, 10, 15, 20, 30)), _LEASE, "< 45 s", "< 60 s", "< 110 s")


class Seconds(float):
    """A time that was measured; the page has a bound for it."""

    def __str__(self) -> str:
        return f"{float(self):.1f} s"


Key = tuple[str, ...]
Cell = str | int | Seconds


def limit(bound: str) -> float:
    """Return the seconds that no run may exceed; 0.0 if the text is not a bound."""
    found = re.fullmatch(r"(< |about )(\d+) s", bound)
    return float(found[2]) * (2 if found[1] == "about " else 1) if found else 0.0


class Page:
    """A page with tables.

    Args:
        path: The file, in `docs/`.
        tables: For each table the keys of its rows, in order. A key is a row's first cells.
    """

    def __init__(self, path: str | Path, tables: Mapping[str, Sequence[Key]]) -> None:
        self.path = DOCS / path
        self.name = os.path.relpath(self.path, DOCS.parent)
        self.tables = tables

    def rows(self, table: str) -> dict[Key, tuple[str, ...]]:
        """Return the rows of a table: what was seen, by key."""
        size, found = len(next(iter(self.tables[table]), ())), dict[Key, tuple[str, ...]]()
        for cells in map(_cells, self._find(table)["rows"].splitlines()):
            key, seen = cells[:size], cells[size:]
            lasts = key[-1].split("; ") if size > 1 else key
            found |= {(*key[:-1], last): seen for last in lasts}
        return found

    def record(self, table: str, seen: Mapping[Key, Sequence[Cell]]) -> None:
        """Compare what a test saw with the page, or write it there."""
        test = os.environ.get("PYTEST_CURRENT_TEST", "tests").rpartition(" ")[0]
        command = f"{VARIABLE}=1 .venv/bin/pytest -n 0 --long {shlex.quote(test)}"
        if WRITING:
            assert "PYTEST_XDIST_WORKER" not in os.environ, f"only one process may write: {command}"
            self.write(table, seen)
            return
        head, rows, wrong = _cells(self._find(table)["head"]), self.rows(table), []
        for key, cells in seen.items():
            if key not in rows:
                wrong.append(f"{key}: there is no such row")
                continue
            for name, cell, was in zip(head[len(key) :], cells, rows[key], strict=True):
                if not (cell <= limit(was) if isinstance(cell, Seconds) else str(cell) == was):
                    wrong.append(f"{key}: {name!r} is {str(cell)!r}, and the page says {was!r}")
        assert not wrong, "\n".join(
            [f"{self.name}, table {table!r}:", *wrong, f"If this is right, write it: {command}"]
        )

    def write(self, table: str, seen: Mapping[Key, Sequence[Cell]]) -> None:
        """Write these rows; the others stay as they are."""
        rows = self.rows(table)
        for key, cells in seen.items():
            assert key in self.tables[table], f"{self.name}, {table!r} has no row {key}"
            was = rows.get(key, ("",) * len(cells))
            rows[key] = tuple(_written(cell, old) for cell, old in zip(cells, was, strict=True))
        self.path.write_text(self._render(table, rows), "utf-8")

    def check(self) -> None:
        """See that the page has each table and each row, and no other."""
        if WRITING:
            pytest.skip(f"{self.name} is being written")
        name, text = self.name, self.path.read_text("utf-8")
        unknown = set(re.findall("<!-- table: (.+) -->", text)) - set(self.tables)
        assert not unknown, f"{name}: no test has the tables {unknown}"
        for table, keys in self.tables.items():
            rows = self.rows(table)
            missing, surplus = set(keys) - set(rows), set(rows) - set(keys)
            assert not missing, f"{name}, {table!r}: rows are missing: {missing}"
            assert not surplus, f"{name}, {table!r}: no test has the rows {surplus}"
            assert self._render(table, rows) == text, f"{name}, {table!r}: in another order"

    def _find(self, table: str) -> re.Match[str]:
        mark = f"<!-- table: {re.escape(table)} -->\n\n"
        lines = r"(?P<head>\|.*\n)\|[-|]+\n(?P<rows>(\|.*\n)*)\n<!-- end of table -->"
        found = re.search(mark + lines, self.path.read_text("utf-8"))
        assert found, f"{self.name}: no table between the marks of {table!r}"
        return found

    def _render(self, table: str, rows: Mapping[Key, Sequence[str]]) -> str:
        """Return the whole page, with these rows."""
        lines = ""
        keys = [key for key in self.tables[table] if key in rows]
        for _, same in groupby(keys, lambda key: (key[:-1] if len(key) > 1 else key, rows[key])):
            first, *more = same
            last = "; ".join(key[-1] for key in (first, *more))
            lines += "| " + " | ".join((*first[:-1], last, *rows[first])) + " |\n"
        found = self._find(table)
        return found.string[: found.start("rows")] + lines + found.string[found.end("rows") :]


def _cells(line: str) -> tuple[str, ...]:
    return tuple(cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1])


def _written(cell: Cell, was: str) -> str:
    """Return how a cell is written; a bound stays where it has enough room."""
    if not isinstance(cell, Seconds):
        return str(cell)
    enough = cell * ROOM
    return next((b for b in (was, *BOUNDS) if limit(b) >= enough), f"< {enough:.0f} s")
