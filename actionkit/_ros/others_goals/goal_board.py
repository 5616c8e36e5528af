"""Collects the states of all goals of an action from status messages. Pure."""

from __future__ import annotations

import queue
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

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
    server: int = 1  # the number of its server, as `ServerNumbers` counts them
    entries: Mapping[int, str] = field(default_factory=dict)
    """Its state on each server that has it, by the server's stamp of the acceptance."""

    @property
    def ended(self) -> bool:
        """Return whether it has stopped, or is lost."""
        return self.state in _ENDED


class Board:
    """The goals of an action and its servers."""

    def __init__(self, most: float = _MOST, *, apart: bool = False) -> None:
        """Make it empty; `apart` means that a goal that two servers have counts as two."""
        self._most = most
        self._apart = apart
        self.goals: dict[str, WatchedGoal] = {}
        """By id or, if they are apart, by id and stamp."""
        self.servers: tuple[str, ...] = ()
        self.has_status = False
        """Whether a status has come from a server that is in sight, also one without goals."""

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
            key = f"{goal.goal_id} {goal.stamp}" if self._apart else goal.goal_id
            row = self.goals.get(key)
            known: Mapping[int, str] = {} if row is None else row.entries
            # Messages may cross; what has ended stays ended.
            if (old := known.get(goal.stamp)) in (goal.state, *_ENDED) and old != "LOST":
                continue
            entries = {**known, goal.stamp: goal.state}
            state = _state_of(entries.values())
            if row is not None and row.state == state:
                self.goals[key] = replace(row, entries=entries)
                continue
            before = "" if row is None else row.state
            server = goal.server if row is None else row.server
            new = WatchedGoal(goal.goal_id, state, goal.accepted, now, before, server, entries)
            self.goals[key] = new
            changed.append(new)
        if (too_many := len(self.goals) - self._most) > 0:
            ended = [(row.accepted, key) for key, row in self.goals.items() if row.ended]
            for _, key in sorted(ended)[: int(too_many)]:
                del self.goals[key]
        return sorted(changed, key=lambda row: row.accepted)

    def _lose(self, now: float) -> list[WatchedGoal]:
        lost = {key: row for key, row in self.goals.items() if not row.ended}
        for key, row in lost.items():
            entries = {
                stamp: state if state in _ENDED else "LOST" for stamp, state in row.entries.items()
            }
            self.goals[key] = replace(
                row, state="LOST", since=now, before=row.state, entries=entries
            )
        return [self.goals[key] for key in lost]

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
