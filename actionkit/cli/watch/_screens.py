"""Shows `actionkit watch`: a table on a terminal, else lines, or JSON."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text
from typing_extensions import Self

from actionkit._model.printable import printable
from actionkit._model.values import GoalEvent, GoalState
from actionkit._observers.json_schema import event_line, note_line
from actionkit._observers.protocol import CallInfo
from actionkit._ros.holds.words import who
from actionkit._ros.others_goals.goal_board import Board, WatchedGoal
from actionkit.cli._shared.say import say
from actionkit.cli.watch._hold_lines import hold_line

_STYLES = {
    "ACCEPTED": "cyan",
    "EXECUTING": "bold blue",
    "CANCELING": "yellow",
    "SUCCEEDED": "green",
    "CANCELED": "yellow",
    "ABORTED": "red",
    "LOST": "bold red",
}
_FRAME = 7
"""Lines around the goals: three above, the heads of the columns, one below, and two to spare."""


class Screen:
    """Shows changes. This base class shows nothing; subclasses override what they show."""

    def servers(self, board: Board) -> None:
        """Show that the servers have changed."""

    def hold(self, board: Board) -> None:
        """Show that a human has stopped the robot, or has released it."""

    def goal(self, goal: WatchedGoal) -> None:
        """Show that a goal has changed."""

    def tick(self, board: Board) -> None:
        """Draw again; called a few times a second."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None: ...


class TextScreen(Screen):
    """A line for each change."""

    def servers(self, board: Board) -> None:
        names = ", ".join(board.servers) or "none"
        say(f"{_clock(time.time())}  servers: {names}")

    def hold(self, board: Board) -> None:
        say(f"{_clock(time.time())}  {_held(board) or 'released: agents are held no more'}")

    def goal(self, goal: WatchedGoal) -> None:
        say(goal_line(goal))


def goal_line(goal: WatchedGoal) -> str:
    """Return the state of a goal in words."""
    after = f"{goal.since - goal.accepted:.1f} s"
    words = (
        f"{after} after its acceptance, was {goal.before}"
        if goal.before
        else f"accepted {after} ago"
    )
    return f"{_clock(goal.since)}  {goal.goal_id}  {goal.state:<9}  {words}"


class JsonScreen(Screen):
    """A JSON object for each change; for a goal as the observer `JsonLines` writes it."""

    def __init__(self, name: str, type_of: Callable[[], str]) -> None:
        """Take the action's full name, and a function for its type's name (`""` if unknown)."""
        self._name = name
        self._type_of = type_of
        self._type = ""

    def servers(self, board: Board) -> None:
        say(note_line("servers", self._name, time.time(), servers=board.servers))

    def hold(self, board: Board) -> None:
        say(hold_line(bool(board.holds), board.holds))

    def goal(self, goal: WatchedGoal) -> None:
        try:
            state = GoalState(goal.state)
        except ValueError:  # a code that is not in the action protocol
            return
        self._type = self._type or self._type_of()
        goal_id = uuid.UUID(goal.goal_id)
        to_monotonic = time.monotonic() - time.time()
        event = GoalEvent(
            goal_id, 1, state, goal.since + to_monotonic, goal.since,
            f"was {goal.before}" if goal.before else "",
        )  # fmt: skip
        # The call is not known, so its data are the goal's id and acceptance.
        call = CallInfo(
            goal_id, self._name, self._type, "", goal.accepted + to_monotonic, goal.accepted
        )
        say(event_line(event, call))


class TableScreen(Screen):
    """A table that is drawn again and again: first running goals, then the newest."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._console = Console(highlight=False, markup=False, emoji=False)
        self._live = Live(console=self._console, auto_refresh=False, redirect_stdout=False)

    def servers(self, board: Board) -> None:
        self.tick(board)

    def hold(self, board: Board) -> None:
        self.tick(board)

    def tick(self, board: Board) -> None:
        self._live.update(self._drawn(board, time.time()), refresh=True)

    def _drawn(self, board: Board, now: float) -> Group:
        counts = ", ".join(f"{count} {state}" for state, count in sorted(board.counts().items()))
        servers = ", ".join(board.servers) or "none in sight"
        table = Table(box=None, pad_edge=False)
        for column in ("goal", "state", "in it", "accepted"):
            table.add_column(column)
        # Running goals come before ended goals; in each group the newest comes first.
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
            *([Text(printable(held), style="bold red")] if (held := _held(board)) else ()),
            Text(counts or ("no goals" if board.has_status else "no status yet"), style="dim"),
            table,
            Text(f"and {hidden} more" if hidden > 0 else "", style="dim"),
        )

    def __enter__(self) -> Self:
        self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._live.stop()


def _held(board: Board) -> str:
    return f"agents are held by {who(board.holds)}" if board.holds else ""


def _clock(seconds: float) -> str:
    """Return the local time of day."""
    millis = int(seconds * 1000) % 1000
    return time.strftime("%H:%M:%S", time.localtime(seconds)) + f".{millis:03}"
