"""Finds out what happened to goals that are cancelled. Pure: no clock, no middleware."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from actionkit._model.cancel_answer import CancelAnswer
from actionkit.cli._exits import Exit
from actionkit.cli._goal_board import WatchedGoal

_SETTLE = 1.0
"""Seconds to wait after a refusal or "unknown goal", because more news may come: the goal's end (if
a goal ends at the same time, a server answers like a refusal), or another server's answer."""
_BEST = (
    CancelAnswer.ACCEPTED,
    CancelAnswer.TERMINATED,
    CancelAnswer.REFUSED,
    CancelAnswer.UNKNOWN_GOAL,
)
"""If several servers answer about one goal, the first of these counts."""
_EXITS = {
    "REFUSED": Exit.CANCEL_REFUSED,
    "UNKNOWN": Exit.CANCEL_UNKNOWN,
    "NO_SUCH_GOAL": Exit.NO_SUCH_GOAL,
}
"""The exit codes, the worst first; goals with other answers have stopped."""


@dataclass(frozen=True)
class Fate:
    """What happened to a goal."""

    goal_id: str  # with dashes
    cancel: str  # the name of a `CancelReport`, or `"NO_SUCH_GOAL"`
    state: str  # the last state that was seen, or `""`
    text: str  # the same as a sentence


@dataclass
class _Target:
    answer: CancelAnswer | None = None
    since: float = 0.0
    """When that answer came."""
    asked: bool = False
    fate: Fate | None = None


class Cancelling:
    """The goals that are to be cancelled, and what is known about them."""

    def __init__(self, goal_ids: Iterable[str] = ()) -> None:
        self._targets = {goal_id: _Target() for goal_id in goal_ids}

    def add(self, goal_id: str) -> None:
        """Add a goal to cancel."""
        self._targets.setdefault(goal_id, _Target())

    def to_ask(self, board: dict[str, WatchedGoal]) -> list[str]:
        """Return the goals to send a request for now, each once."""
        new = []
        for goal_id, target in self._targets.items():
            row = board.get(goal_id)
            if not target.asked and (row is None or not row.ended):
                target.asked = True
                new.append(goal_id)
        return new

    def take(self, said: Any, now: float) -> None:
        """Record a server's answer, a `CancelSaid`; `now` is on the monotonic clock."""
        target = self._targets[said.goal_id]
        if target.answer is None or _BEST.index(said.answer) < _BEST.index(target.answer):
            target.answer, target.since = said.answer, now

    def settle(self, board: dict[str, WatchedGoal], now: float, *, over: bool) -> list[Fate]:
        """Return the fates that are new since the last call; `now` is on the monotonic clock.

        `board` has the goals that the servers remember. `over` means that the wait has ended: every
        goal has a fate then.
        """
        new = []
        for goal_id, target in self._targets.items():
            if target.fate is None:
                row = board.get(goal_id)
                told = (
                    _ended(row, target) if row and row.ended else _running(row, target, now, over)
                )
                if told is not None:
                    target.fate = Fate(goal_id, told[0], row.state if row else "", told[1])
                    new.append(target.fate)
        return new

    @property
    def fates(self) -> list[Fate]:
        """The fates of the goals that are settled."""
        return [target.fate for target in self._targets.values() if target.fate is not None]

    @property
    def done(self) -> bool:
        """Whether every goal is settled."""
        return len(self.fates) == len(self._targets)

    @property
    def exit(self) -> Exit:
        """The worst exit code of all goals."""
        found = {fate.cancel for fate in self.fates}
        return next((code for cancel, code in _EXITS.items() if cancel in found), Exit.OK)


def _ended(row: WatchedGoal, target: _Target) -> tuple[str, str]:
    if row.state == "LOST":
        return "UNKNOWN", "Its last server went away; whether it runs on is not known."
    if row.state == "CANCELED" and target.asked:
        return "CONFIRMED", "It was canceled, and runs no more."
    before = "in the meantime" if target.asked else "before"
    return "NOT_NEEDED", f"It had ended {before}: {row.state}."


def _running(
    row: WatchedGoal | None, target: _Target, now: float, over: bool
) -> tuple[str, str] | None:
    """Return what is known of a goal without a seen end, or `None` if that may still change."""
    settled = over or now - target.since >= _SETTLE
    canceling = row is not None and row.state == "CANCELING"
    if target.answer is CancelAnswer.REFUSED and not canceling and settled:
        return "REFUSED", "The server refused to cancel it. IT IS STILL RUNNING."
    if target.answer is CancelAnswer.UNKNOWN_GOAL and row is None and settled:
        return "NO_SUCH_GOAL", "No server in sight knows it: it ended long ago, or never was here."
    if not over:
        return None
    if target.answer in (CancelAnswer.ACCEPTED, CancelAnswer.TERMINATED) or canceling:
        return (
            "UNKNOWN",
            "The server is cancelling it, and did not end it. IT MAY STILL BE RUNNING.",
        )
    return "UNKNOWN", "The server did not answer. IT MAY STILL BE RUNNING."
