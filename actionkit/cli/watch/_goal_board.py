"""Collects the states of all goals of an action from status messages. Pure."""

from __future__ import annotations

import queue
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from actionkit._ros.holds.state import Hold

_T = TypeVar("_T")
_ENDED = ("SUCCEEDED", "CANCELED", "ABORTED", "LOST")
_MOST = 1000
"""Goals that are kept, enough for many screens, so that a watch of days stays small. The oldest
ended goals are removed first."""


@dataclass(frozen=True)
class WatchedGoal:
    """One goal. Times are in seconds since the epoch."""

    goal_id: str  # with dashes
    state: str  # `LOST` if it had not ended when the last server went
    accepted: float
    since: float  # when this state was first seen
    before: str = ""  # the state before, if it was seen

    @property
    def ended(self) -> bool:
        """Return whether it has stopped, or is lost."""
        return self.state in _ENDED


class Board:
    """The goals of an action and its servers."""

    def __init__(self, most: float = _MOST) -> None:
        self._most = most
        self.goals: dict[str, WatchedGoal] = {}
        self.servers: tuple[str, ...] = ()
        self.holds: tuple[Hold, ...] = ()
        """The holds of people who have stopped the robot by `actionkit stop`."""

    def take(self, news: Any, now: float) -> tuple[list[WatchedGoal], bool]:
        """Update the board; return the goals with a new state, and whether the servers changed.

        `news` is a list of `GoalSeen`, or the names of the servers' nodes. `now` is in seconds
        since the epoch.
        """
        if isinstance(news, tuple):
            self.servers = news
            return ([] if news else self._lose(now)), True
        return self._update(news, now), False

    def _update(self, seen: Sequence[Any], now: float) -> list[WatchedGoal]:
        changed = []
        for goal in seen:
            row = self.goals.get(goal.goal_id)
            # Messages of two servers may cross; a goal that has ended stays ended.
            if row is not None and (row.state == goal.state or (row.ended and row.state != "LOST")):
                continue
            before = "" if row is None else row.state
            new = WatchedGoal(goal.goal_id, goal.state, goal.accepted, now, before)
            self.goals[goal.goal_id] = new
            changed.append(new)
        if (too_many := len(self.goals) - self._most) > 0:
            ended = [row for row in self.goals.values() if row.ended]
            for row in sorted(ended, key=lambda row: row.accepted)[: int(too_many)]:
                del self.goals[row.goal_id]
        return sorted(changed, key=lambda row: row.accepted)

    def _lose(self, now: float) -> list[WatchedGoal]:
        lost = [row for row in self.goals.values() if not row.ended]
        for row in lost:
            self.goals[row.goal_id] = WatchedGoal(row.goal_id, "LOST", row.accepted, now, row.state)
        return [self.goals[row.goal_id] for row in lost]

    def sorted(self) -> list[WatchedGoal]:
        """Return the goals in the order of their acceptance."""
        return sorted(self.goals.values(), key=lambda row: row.accepted)

    def counts(self) -> Counter[str]:
        """Return how many goals are in each state."""
        return Counter(goal.state for goal in self.goals.values())


def arrived(inbox: queue.SimpleQueue[_T], timeout: float) -> list[_T]:
    """Wait `timeout` seconds for news; return all that is there, but nothing that comes later."""
    try:
        first = inbox.get(timeout=timeout)
    except queue.Empty:
        return []
    return [first, *(inbox.get_nowait() for _ in range(inbox.qsize()))]
