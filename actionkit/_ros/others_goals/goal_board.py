"""Collects the states of all goals of an action from status messages. Pure."""

from __future__ import annotations

import queue
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from actionkit._ros.holds.state import Hold

_T = TypeVar("_T")
_ENDED = ("SUCCEEDED", "CANCELED", "ABORTED", "LOST")
_RUNNING = ("ACCEPTED", "EXECUTING", "CANCELING")
DISCOVERY = 3.5
"""Seconds until a new node has discovered all servers, and has the status that they keep."""
FIRST = 1.0
"""Seconds for the kept status of servers in sight. One that never had a goal sends none."""
_MOST = 1000
"""Goals that are kept, enough for many screens, so that a watch of days stays small. The oldest
ended goals are removed first."""


@dataclass(frozen=True)
class WatchedGoal:
    """One goal. Times are in seconds since the epoch."""

    goal_id: str  # with dashes
    state: str  # `LOST` if it had not ended when the last server went; see `_state_of`
    accepted: float
    since: float  # when this state was first seen
    before: str = ""  # the state before, if it was seen
    entries: Mapping[int, str] = field(default_factory=dict)
    """Its state on each server that has it, by the server's stamp of the acceptance."""

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
        self.has_status = False
        """Whether a status has come from a server that is in sight, also one without goals."""
        self.holds: tuple[Hold, ...] = ()
        """The holds of people who have stopped the robot by `actionkit stop`."""

    def take(self, news: Any, now: float) -> tuple[list[WatchedGoal], bool]:
        """Update the board; return the goals with a new state, and whether the servers changed.

        `news` is a list of `GoalSeen`, or the names of the servers' nodes. `now` is in seconds
        since the epoch.
        """
        if isinstance(news, tuple):
            self.servers = news
            self.has_status &= bool(news)
            return ([] if news else self._lose(now)), True
        return self._update(news, now), False

    def _update(self, seen: Sequence[Any], now: float) -> list[WatchedGoal]:
        self.has_status = True
        changed = []
        for goal in seen:
            row = self.goals.get(goal.goal_id)
            known: Mapping[int, str] = {} if row is None else row.entries
            # Messages may cross; what has ended stays ended.
            if (old := known.get(goal.stamp)) in (goal.state, *_ENDED) and old != "LOST":
                continue
            entries = {**known, goal.stamp: goal.state}
            state = _state_of(entries.values())
            if row is not None and row.state == state:
                self.goals[goal.goal_id] = replace(row, entries=entries)
                continue
            before = "" if row is None else row.state
            new = WatchedGoal(goal.goal_id, state, goal.accepted, now, before, entries)
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
            entries = {
                stamp: state if state in _ENDED else "LOST" for stamp, state in row.entries.items()
            }
            self.goals[row.goal_id] = replace(
                row, state="LOST", since=now, before=row.state, entries=entries
            )
        return [self.goals[row.goal_id] for row in lost]

    def sorted(self) -> list[WatchedGoal]:
        """Return the goals in the order of their acceptance."""
        return sorted(self.goals.values(), key=lambda row: row.accepted)

    def counts(self) -> Counter[str]:
        """Return how many goals are in each state."""
        return Counter(goal.state for goal in self.goals.values())


def _state_of(states: Iterable[str]) -> str:
    """Return the state of a goal that servers have in these states.

    It has ended only if each server has ended it. Of states alike in that, the last one counts,
    except that one that is being cancelled says less than one that is not.
    """
    found = list(states)
    running = [state for state in found if state not in _ENDED]
    for state in _RUNNING:
        if state in running:
            return state
    return running[-1] if running else "LOST" if "LOST" in found else found[-1]


def arrived(inbox: queue.SimpleQueue[_T], timeout: float) -> list[_T]:
    """Wait `timeout` seconds for news; return all that is there, but nothing that comes later."""
    try:
        first = inbox.get(timeout=timeout)
    except queue.Empty:
        return []
    return [first, *(inbox.get_nowait() for _ in range(inbox.qsize()))]
