"""Shows `actionkit watch`: a table on a terminal, else lines, or JSON."""

from __future__ import annotations

import time
import uuid
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from rich.console import Console, Group
from rich.live import Live
from rich.text import Text
from typing_extensions import Self

from actionkit._messages.json_text import to_json
from actionkit._model.printable import printable
from actionkit._model.values import GoalEvent, GoalState
from actionkit._observers.json_schema import event_line, note_line
from actionkit._observers.protocol import CallInfo
from actionkit._ros.holds.state import Hold
from actionkit._ros.holds.words import who
from actionkit._ros.others_goals.goal_board import Board, WatchedGoal
from actionkit._ros.others_goals.topic import TopicReader
from actionkit._ros.others_goals.watch import StatusReader
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
_STAY = 30.0
"""Seconds that a goal stays in the table of all actions after its end."""
_TENTHS = 10.0
"""Seconds up to which tenths of a second are shown."""
_WIDE = 120
"""Columns of a terminal that has room for whole ids beside the names of actions."""
_SHORT = 8
"""Digits of an id that are shown elsewhere."""
_LONGEST = 160
"""Characters of a feedback message in a line."""
Fields = Mapping[str, Any]
"""A feedback message as plain data."""


@dataclass
class Watched:
    """An action that is watched."""

    name: str
    board: Board
    type: str = ""  # its type's name; `""` while it is not known
    in_sight: float = 0.0  # when it last had a server, in monotonic seconds
    most_servers: int = 0  # that it had at a time, since it last had none
    asked_for_feedback: bool = False
    readers: list[StatusReader | TopicReader] = field(default_factory=list)

    def close(self) -> None:
        """Read it no more."""
        for reader in self.readers:
            reader.close()

    def server(self, goal: WatchedGoal) -> int | None:
        """Return the number of a goal's server if the action has several."""
        return goal.server if self._servers(goal) > 1 else None

    def server_words(self, goal: WatchedGoal) -> str:
        """Return which server has a goal."""
        number = self.server(goal)
        return f"{number} of {self._servers(goal)}" if number else ", ".join(self.board.servers)

    def _servers(self, goal: WatchedGoal) -> int:
        return max(len(self.board.servers), goal.server, self.most_servers)


class Screen:
    """Shows changes. This base class shows nothing; subclasses override what they show."""

    def servers(self, action: Watched) -> None:
        """Show that the servers have changed."""

    def hold(self, holds: Sequence[Hold]) -> None:
        """Show that a human has stopped the robot, or has released it."""

    def goal(self, action: Watched, goal: WatchedGoal, feedback: Fields | None = None) -> None:
        """Show that a goal has changed; or its feedback, and then `FEEDBACK` is its state."""

    def tick(self, actions: Sequence[Watched], holds: Sequence[Hold]) -> None:
        """Draw again; called twice a second."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None: ...


class TextScreen(Screen):
    """A line for each change."""

    def __init__(self, *, named: bool) -> None:
        """Take whether the lines have the action's name in them."""
        self._named = named

    def servers(self, action: Watched) -> None:
        names = ", ".join(action.board.servers) or "none"
        of = f" of {action.name}" if self._named else ""
        say(f"{_clock(time.time())}  servers{of}: {names}")

    def hold(self, holds: Sequence[Hold]) -> None:
        say(f"{_clock(time.time())}  {_held(holds) or 'released: agents are held no more'}")

    def goal(self, action: Watched, goal: WatchedGoal, feedback: Fields | None = None) -> None:
        words = "" if feedback is None else _short(feedback)
        on = f", on server {action.server_words(goal)}" if action.server(goal) else ""
        say(goal_line(goal, f"{action.name}  " if self._named else "", words) + on)


def goal_line(goal: WatchedGoal, name: str = "", words: str = "") -> str:
    """Return the state of a goal, and words for it: by default since when it is in that state."""
    after = f"{goal.since - goal.accepted:.1f} s"
    since = f"{after} after its acceptance, was {goal.before}"
    words = words or (since if goal.before else f"accepted {after} ago")
    return f"{_clock(goal.since)}  {name}{goal.goal_id}  {goal.state:<9}  {words}"


class JsonScreen(Screen):
    """A JSON object for each change; for a goal as the observer `JsonLines` writes it."""

    def __init__(self, write: Callable[[str], object] = say) -> None:
        """Take what writes a line."""
        self._write = write

    def servers(self, action: Watched) -> None:
        self._write(note_line("servers", action.name, time.time(), servers=action.board.servers))

    def hold(self, holds: Sequence[Hold]) -> None:
        self._write(hold_line(bool(holds), holds))

    def goal(self, action: Watched, goal: WatchedGoal, feedback: Fields | None = None) -> None:
        try:
            state = GoalState(goal.state)
        except ValueError:  # a code that is not in the action protocol
            return
        goal_id, began = uuid.UUID(goal.goal_id), goal.accepted
        to_monotonic = time.monotonic() - time.time()
        event = GoalEvent(
            goal_id, 1, state, goal.since + to_monotonic, goal.since,
            f"was {goal.before}" if goal.before else "",
        )  # fmt: skip
        # The call is not known, so its data are the goal's id and acceptance. A second server with
        # the goal has a call of its own, as `actionkit timeline` has it.
        call_id = goal_id if goal.server < 2 else uuid.uuid5(goal_id, str(goal.server))
        call = CallInfo(call_id, action.name, action.type, "", began + to_monotonic, began)
        self._write(event_line(event, call, feedback=feedback, server=action.server(goal)))


class TableScreen(Screen):
    """A table that is drawn again and again: first running goals, then the newest."""

    def __init__(self, name: str = "", *, feedback: bool = False) -> None:
        """Take the action's full name, `""` for all, and whether there is a column for feedback."""
        self._name, self._has_feedback = name, feedback
        self._feedback: dict[tuple[str, str], str] = {}
        self._console = Console(highlight=False, markup=False, emoji=False)
        self._live = Live(console=self._console, auto_refresh=False, redirect_stdout=False)

    def goal(self, action: Watched, goal: WatchedGoal, feedback: Fields | None = None) -> None:
        if feedback is not None:
            self._feedback[action.name, goal.goal_id] = _short(feedback)

    def tick(self, actions: Sequence[Watched], holds: Sequence[Hold]) -> None:
        self._live.update(self._drawn(actions, holds, time.time()), refresh=True)

    def _drawn(self, actions: Sequence[Watched], holds: Sequence[Hold], now: float) -> Group:
        shown = [
            (action, goal)
            for action in actions
            for goal in action.board.goals.values()
            if self._name or not goal.ended or now - goal.since <= _STAY
        ]
        states = Counter(goal.state for _, goal in shown)
        counts = ", ".join(f"{count} {state}" for state, count in sorted(states.items()))
        head = f"{len(actions)} action{'s' * (len(actions) != 1)} in sight"
        if self._name:
            servers = [name for action in actions for name in action.board.servers]
            head = f"{self._name}  servers: {', '.join(servers) or 'none in sight'}"
        # Running goals come before ended goals; in each group the newest comes first.
        shown.sort(key=lambda each: (each[1].ended, -each[1].accepted))
        room = max(1, self._console.height - _FRAME)
        hidden, shown = len(shown) - room, shown[:room]
        keys = [(action.name, goal.goal_id) for action, goal in shown]
        self._feedback = {key: self._feedback.get(key, "") for key in keys}  # not all for ever
        columns = {
            "action": [printable(name) for name, _ in keys],
            "goal": [goal_id for _, goal_id in keys],
            "state": [goal.state for _, goal in shown],
            "age": [_seconds((g.since if g.ended else now) - g.accepted) for _, g in shown],
            "last change": [f"{_seconds(now - goal.since)} ago" for _, goal in shown],
            "server": [printable(action.server_words(goal)) for action, goal in shown],
            "feedback": [printable(self._feedback[key]) for key in keys],
        }
        if self._name:
            del columns["action"]
            if not any(action.server(goal) for action, goal in shown):
                del columns["server"]
        elif self._console.width < _WIDE:
            columns["goal"] = [goal_id[:_SHORT] for _, goal_id in keys]
        if not self._has_feedback:
            del columns["feedback"]
        # A `Table` of rich would take ten times as long to draw.
        table = Text(no_wrap=True, overflow="ellipsis")
        widths = [max(map(len, [name, *cells])) + 2 for name, cells in columns.items()]
        for row in zip(*([name, *cells] for name, cells in columns.items()), strict=True):
            for cell, width in zip(row, widths, strict=True):
                table.append(cell.ljust(width), _STYLES.get(cell, ""))
            table.append("\n")
        has_status = not self._name or any(action.board.has_status for action in actions)
        return Group(
            Text(printable(head), style="bold"),
            *([Text(printable(held), style="bold red")] if (held := _held(holds)) else ()),
            Text(counts or ("no goals" if has_status else "no status yet"), style="dim"),
            table,
            Text(f"and {hidden} more" if hidden > 0 else "", style="dim"),
        )

    def __enter__(self) -> Self:
        self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._live.stop()


def _held(holds: Sequence[Hold]) -> str:
    return f"agents are held by {who(holds)}" if holds else ""


def _seconds(seconds: float) -> str:
    seconds = max(0.0, seconds)
    return f"{seconds:.1f} s" if seconds < _TENTHS else f"{seconds:.0f} s"


def _short(fields: Fields) -> str:
    text = to_json(dict(fields))
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"


def _clock(seconds: float) -> str:
    """Return the local time of day."""
    millis = int(seconds * 1000) % 1000
    return time.strftime("%H:%M:%S", time.localtime(seconds)) + f".{millis:03}"
