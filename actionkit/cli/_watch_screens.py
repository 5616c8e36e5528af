"""What `actionkit watch` looks like: a table on a terminal, else lines, or JSON."""

from __future__ import annotations

import time
from typing import Protocol

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table as RichTable
from rich.text import Text
from typing_extensions import Self

from actionkit._messages.json_text import to_json
from actionkit._model.printable import printable
from actionkit.cli._goal_board import Board, Row
from actionkit.cli._say import say

_STYLES = {
    "ACCEPTED": "cyan",
    "EXECUTING": "bold blue",
    "CANCELING": "yellow",
    "SUCCEEDED": "green",
    "CANCELED": "yellow",
    "ABORTED": "red",
    "LOST": "bold red",
}
_FRAME = 6
"""Lines of the table that are no goals."""


class Screen(Protocol):
    """Where changes are shown."""

    def servers(self, board: Board) -> None: ...
    def goal(self, row: Row, board: Board) -> None: ...
    def tick(self, board: Board) -> None: ...
    def __enter__(self) -> Self: ...
    def __exit__(self, *_: object) -> None: ...


class Lines:
    """A line for each change."""

    def servers(self, board: Board) -> None:
        names = ", ".join(board.servers) or "none"
        say(f"{_clock(time.time())}  servers: {names}")

    def goal(self, row: Row, board: Board) -> None:
        after = f"{row.since - row.accepted:.1f} s"
        words = (
            f"{after} after its acceptance, was {row.before}"
            if row.before
            else f"accepted {after} ago"
        )
        say(f"{_clock(row.since)}  {row.goal_id}  {row.state:<9}  {words}")

    def tick(self, board: Board) -> None:
        """Only changes are lines."""

    def __enter__(self) -> Self:
        """Nothing is held."""
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing is held."""


class JsonLines(Lines):
    """A JSON object for each change."""

    def servers(self, board: Board) -> None:
        record = {"event": "servers", "time": time.time(), "servers": board.servers}
        say(to_json(record))

    def goal(self, row: Row, board: Board) -> None:
        record = {
            "event": "goal",
            "time": row.since,
            "goal_id": row.goal_id,
            "state": row.state,
            "before": row.before or None,
            "accepted": row.accepted,
        }
        say(to_json(record))


class Table:
    """A table that is drawn again and again; what runs comes first, then the newest."""

    def __init__(self, name: str) -> None:
        """Make one.

        Args:
            name: The action's.
        """
        self._name = name
        self._console = Console(highlight=False, markup=False, emoji=False)
        self._live = Live(console=self._console, auto_refresh=False, redirect_stdout=False)

    def servers(self, board: Board) -> None:
        self.tick(board)

    def goal(self, row: Row, board: Board) -> None:
        """Shown by the next tick."""

    def tick(self, board: Board) -> None:
        self._live.update(self._drawn(board, time.time()), refresh=True)

    def _drawn(self, board: Board, now: float) -> Group:
        counts = ", ".join(f"{count} {state}" for state, count in sorted(board.counts().items()))
        servers = ", ".join(board.servers) or "none in sight"
        table = RichTable(box=None, pad_edge=False)
        for column in ("goal", "state", "in it", "accepted"):
            table.add_column(column)
        rows = board.sorted()
        rows.reverse()
        rows.sort(key=lambda row: row.ended)  # stable: among themselves the newest first
        room = max(1, self._console.height - _FRAME)
        for row in rows[:room]:
            table.add_row(
                row.goal_id,
                Text(row.state, style=_STYLES.get(row.state, "")),
                "" if row.ended else f"{now - row.since:.1f} s",
                f"{_clock(row.accepted)}",
            )
        hidden = len(rows) - room
        return Group(
            Text(printable(f"{self._name}  servers: {servers}"), style="bold"),
            Text(counts or "no goals", style="dim"),
            table,
            Text(f"and {hidden} more" if hidden > 0 else "", style="dim"),
        )

    def __enter__(self) -> Self:
        """Take the terminal."""
        self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Give it back."""
        self._live.stop()


def _clock(seconds: float) -> str:
    """Return the local time of day."""
    millis = int(seconds * 1000) % 1000
    return time.strftime("%H:%M:%S", time.localtime(seconds)) + f".{millis:03}"
