"""What `actionkit watch` looks like: a table on a terminal, else lines, or JSON."""

from __future__ import annotations

import time

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text
from typing_extensions import Self

from actionkit._messages.json_text import to_json
from actionkit._model.printable import printable
from actionkit.cli._goal_board import Board, WatchedGoal
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
"""Lines around the goals: two above, the heads of the columns, one below, and two to spare."""


class Screen:
    """Where changes are shown; this one shows none, and the others override what they show."""

    def servers(self, board: Board) -> None:
        """Show that the servers have changed."""

    def goal(self, goal: WatchedGoal) -> None:
        """Show that a goal has changed."""

    def tick(self, board: Board) -> None:
        """Draw anew; called a few times a second."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None: ...


class TextScreen(Screen):
    """A line for each change."""

    def servers(self, board: Board) -> None:
        names = ", ".join(board.servers) or "none"
        say(f"{_clock(time.time())}  servers: {names}")

    def goal(self, goal: WatchedGoal) -> None:
        after = f"{goal.since - goal.accepted:.1f} s"
        words = (
            f"{after} after its acceptance, was {goal.before}"
            if goal.before
            else f"accepted {after} ago"
        )
        say(f"{_clock(goal.since)}  {goal.goal_id}  {goal.state:<9}  {words}")


class JsonScreen(Screen):
    """A JSON object for each change."""

    def servers(self, board: Board) -> None:
        record = {"event": "servers", "time": time.time(), "servers": board.servers}
        say(to_json(record))

    def goal(self, goal: WatchedGoal) -> None:
        record = {
            "event": "goal",
            "time": goal.since,
            "goal_id": goal.goal_id,
            "state": goal.state,
            "before": goal.before or None,
            "accepted": goal.accepted,
        }
        say(to_json(record))


class TableScreen(Screen):
    """A table that is drawn again and again; what runs comes first, then the newest."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._console = Console(highlight=False, markup=False, emoji=False)
        self._live = Live(console=self._console, auto_refresh=False, redirect_stdout=False)

    def servers(self, board: Board) -> None:
        self.tick(board)

    def tick(self, board: Board) -> None:
        self._live.update(self._drawn(board, time.time()), refresh=True)

    def _drawn(self, board: Board, now: float) -> Group:
        counts = ", ".join(f"{count} {state}" for state, count in sorted(board.counts().items()))
        servers = ", ".join(board.servers) or "none in sight"
        table = Table(box=None, pad_edge=False)
        for column in ("goal", "state", "in it", "accepted"):
            table.add_column(column)
        # Those that run come before those that ended; of either, the newest comes first.
        goals = sorted(board.goals.values(), key=lambda goal: (goal.ended, -goal.accepted))
        room = max(1, self._console.height - _FRAME)
        for goal in goals[:room]:
            table.add_row(
                goal.goal_id,
                Text(goal.state, style=_STYLES.get(goal.state, "")),
                "" if goal.ended else f"{now - goal.since:.1f} s",
                _clock(goal.accepted),
            )
        hidden = len(goals) - room
        return Group(
            Text(printable(f"{self._name}  servers: {servers}"), style="bold"),
            Text(counts or "no goals", style="dim"),
            table,
            Text(f"and {hidden} more" if hidden > 0 else "", style="dim"),
        )

    def __enter__(self) -> Self:
        self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._live.stop()


def _clock(seconds: float) -> str:
    """Return the local time of day."""
    millis = int(seconds * 1000) % 1000
    return time.strftime("%H:%M:%S", time.localtime(seconds)) + f".{millis:03}"
