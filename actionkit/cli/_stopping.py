"""Stops all goals of an action, and finds out what happened to them. Pure: no clock, no ROS."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

from actionkit.cli._cancelling import Cancelling, Fate
from actionkit.cli._exits import Exit
from actionkit.cli._goal_board import Board

_AGAIN = 1.0
"""Seconds after which a request without an answer counts as lost and is repeated. This is harmless:
a goal is cancelled only once."""
_SINGLY = 0.5
"""Seconds after the answer until a goal must be seen as canceling. Otherwise it is cancelled by its
id: after each goal that an rclpy server refuses to cancel, it skips the next goal, but answers that
it is cancelling it (`list.remove` in a loop over that list)."""


class Stopping:
    """One action: its servers, the requests to cancel all goals, and the fate of each goal."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.board = Board(most=math.inf)  # a goal that is left out would have no known end
        self.servers: tuple[str, ...] = ()
        """The nodes of all servers that were seen."""
        self.answers = 0
        """How many answers have come."""
        self._cancelling = Cancelling()
        self._asked: dict[str, float] = {}
        """For each goal, when the first request after its sight was sent."""
        self._singly: set[str] = set()
        self._number = 0
        self._at = 0.0
        self._want = True
        self._first = 1
        """The number of the first request since there was a reason for one. Later requests repeat
        it; an answer to any of them is enough."""
        self._answers: Counter[int] = Counter()
        """How many servers have answered each request."""

    # --- what happens ----------------------------------------------------------------------

    def seen(self, servers: Sequence[str]) -> None:
        """Record the servers of the action; servers that have gone are remembered."""
        new = {name for name in servers if name} - set(self.servers)
        if new or len(servers) > len(self.servers):
            self._want = True  # a new one has had no request
        self.servers = tuple(sorted(new | set(self.servers)))

    def take_news(self, news: Any, wall: float) -> None:
        """Record news from a `StatusReader`."""
        self.board.take(news, wall)

    def take_answer(self, said: Any, now: float) -> None:
        """Record an `AllSaid`."""
        self.answers += 1
        self._answers[said.request] += 1
        for goal_id in said.canceling:
            self._add(goal_id, now)
        # So that it counts as not ended yet: otherwise it would seem that somebody else ended it.
        self._cancelling.to_ask({})

    def take_single(self, said: Any, now: float) -> None:
        """Record a `CancelSaid`, about one goal."""
        self.answers += 1
        self._cancelling.take(said, now)

    def once_more(self) -> None:
        """Ask the servers again: they may have accepted goals in the meantime."""
        self._want = True

    def _add(self, goal_id: str, now: float) -> None:
        self._cancelling.add(goal_id)
        self._asked.setdefault(goal_id, now)

    # --- what is to be done ----------------------------------------------------------------

    def to_ask(self, now: float) -> int | None:
        """Return the number of a request to send now, or `None`."""
        running = {goal.goal_id for goal in self.board.goals.values() if not goal.ended}
        lost = self._number and self._waits_for_answers and now - self._at >= _AGAIN
        reason = self._want or bool(running - set(self._asked))
        if not (reason or lost):
            return None
        self._want = False
        self._number += 1
        self._at = now
        if reason:
            self._first = self._number
        for goal_id in running:
            self._add(goal_id, now)
        self._cancelling.to_ask(self.board.goals)
        return self._number

    def to_ask_singly(self, now: float) -> list[str]:
        """Return the goals to cancel by their ids now."""
        new = []
        for goal_id, asked in self._asked.items():
            goal = self.board.goals.get(goal_id)
            stopping = goal is not None and (goal.ended or goal.state == "CANCELING")
            if self.answers and now - asked >= _SINGLY and not stopping:
                new.append(goal_id)
        new = [goal_id for goal_id in new if goal_id not in self._singly]
        self._singly.update(new)
        return new

    def settle(self, now: float, *, over: bool) -> None:
        """Update the fates of the goals; `over` means that the wait has ended."""
        self._cancelling.to_ask(self.board.goals)
        self._cancelling.settle(self.board.goals, now, over=over)

    def done(self) -> bool:
        """Whether all servers have answered, and the fate of every goal is known."""
        return not self._want and not self._waits_for_answers and self._cancelling.done

    @property
    def _waits_for_answers(self) -> bool:
        answers = (self._answers[number] for number in range(self._first, self._number + 1))
        return max(answers, default=0) < max(1, len(self.board.servers))

    # --- what happened to it ---------------------------------------------------------------

    @property
    def fates(self) -> list[Fate]:
        """The fates of the goals."""
        return self._cancelling.fates

    def gets_more(self, now: float) -> bool:
        """Return whether new goals came in until now, so that more will come."""
        asked = list(self._asked.values())  # the oldest first
        return bool(asked) and asked[-1] - asked[0] >= _AGAIN and now - asked[-1] < _AGAIN

    @property
    def silent(self) -> bool:
        """Whether no server has answered."""
        return not self.answers

    @property
    def missing(self) -> int:
        """How many servers in sight have not answered; their goals may be unknown."""
        return max(0, len(self.board.servers) - max(self._answers.values(), default=0))

    @property
    def counts(self) -> Counter[str]:
        """The number of goals for each value of `Fate.cancel`."""
        return Counter(fate.cancel for fate in self.fates)

    @property
    def exit(self) -> Exit:
        """The worst exit code of all goals; with a silent server, the fate is not known."""
        code = self._cancelling.exit
        unknown = self.silent or self.missing
        return Exit.CANCEL_UNKNOWN if code is Exit.OK and unknown else code


_WORST = (Exit.CANCEL_REFUSED, Exit.CANCEL_UNKNOWN, Exit.FAILED, Exit.NO_SERVER)


def worst(codes: Sequence[Exit]) -> Exit:
    """Return the worst of these exit codes."""
    return next((code for code in _WORST if code in codes), Exit.OK)


_HEADS = ("ACTION", "SERVER", "GOALS", "CANCELED", "ENDED", "REFUSED", "UNKNOWN")


def table(actions: Sequence[Stopping]) -> list[str]:
    """Return the lines of a table of actions, and a line for each goal that may still run."""
    rows = [_HEADS] + [_row(action) for action in actions]
    widths = [max(len(row[column]) for row in rows) for column in range(len(_HEADS))]
    lines = []
    for row in rows:
        cells = [
            cell.ljust(width) if column < 2 else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    for action in actions:
        if action.silent:
            lines.append(f"{action.name}: no server answered. GOALS MAY STILL BE RUNNING.")
        elif action.missing:
            those = f"{action.missing} of {len(action.board.servers)} servers"
            lines.append(f"{action.name}: {those} did not answer. GOALS MAY STILL BE RUNNING.")
        for fate in action.fates:
            if fate.cancel in ("REFUSED", "UNKNOWN"):
                lines.append(f"{action.name} {fate.goal_id}: {fate.text}")
    return lines


def _row(action: Stopping) -> tuple[str, ...]:
    counts = action.counts
    goals = str(len(action.fates)) if action.fates or not action.silent else "?"
    numbers = [counts[name] for name in ("CONFIRMED", "NOT_NEEDED", "REFUSED", "UNKNOWN")]
    servers = ", ".join(action.servers) or "-"
    return (action.name, servers, goals, *(str(number) if number else "-" for number in numbers))
