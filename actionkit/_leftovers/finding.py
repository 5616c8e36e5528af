"""Finds out which goals of a call the servers know."""

from __future__ import annotations

import time
import uuid
from bisect import bisect_right
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from actionkit._calls.ledger.store import Leftover, attempt_number
from actionkit._ros.others_goals.goal_board import WatchedGoal
from actionkit._ros.others_goals.topic import StoppedError
from actionkit._ros.others_goals.watch import goals_seen
from actionkit._ros.rclpy_private.native import RCLError
from actionkit._threads.waiting import Flag

if TYPE_CHECKING:
    from actionkit._client import Client

_AGAIN = 0.3
"""Seconds between two looks."""


def domain_of(client: Client[Any]) -> int:
    """Return the ROS domain of a client."""
    return client._session.identity.domain_id


def find(
    client: Client[Any], calls: Iterable[Leftover], until: float
) -> Iterator[tuple[Leftover, uuid.UUID | None]]:
    """Yield each goal of calls that runs; of a call without one, the last that is known, if any.

    A goal that was sent just before its process ended may be accepted late, and so may a retry. So
    this looks again until the monotonic time `until`, or until no other goal can come. The client
    must have a server.
    """
    found: dict[Leftover, set[uuid.UUID]] = {call: set() for call in calls}
    waiting = set(found)
    by_id = sorted(found, key=number_of)
    while waiting:
        seen = _by_call(by_id, _known(client, until))
        late = time.monotonic() >= until
        for call in [call for call in (found if late else seen) if call in waiting]:
            goals = seen.get(call, {})
            for goal_id, goal in goals.items():
                if not goal.ended and goal_id not in found[call]:
                    found[call].add(goal_id)
                    yield call, goal_id
            # Its process is dead, and sent a retry only when the goal before it had ended.
            last = found[call] and not call.parallel
            if last or late or any(_is_last(call, goal, goals[goal].state) for goal in goals):
                waiting.remove(call)
                if not found[call]:
                    yield call, max(goals, default=None)
        if waiting:
            Flag().wait(_AGAIN)


def _is_last(call: Leftover, goal_id: uuid.UUID, state: str) -> bool:
    """Whether a call sends no other goal beside, or after, one that is in this state."""
    if call.parallel:
        return call.attempts == 1
    last = attempt_number(call.goal_id, goal_id) == call.attempts
    return last or (state == "SUCCEEDED" and not call.judged)


def _by_call(
    by_id: list[Leftover], known: dict[uuid.UUID, WatchedGoal]
) -> dict[Leftover, dict[uuid.UUID, WatchedGoal]]:
    """Return the goals of each call that has some. There may be many calls, and many goals."""
    seen: dict[Leftover, dict[uuid.UUID, WatchedGoal]] = {}
    for goal_id, goal in known.items():
        if (call := call_with(by_id, goal_id)) is not None:
            seen.setdefault(call, {})[goal_id] = goal
    return seen


def call_with(by_id: list[Leftover], goal_id: uuid.UUID) -> Leftover | None:
    """Return the call that has a goal, of those sorted by `number_of`."""
    place = bisect_right(by_id, goal_id.int, key=number_of)
    return by_id[place - 1] if place and by_id[place - 1].has(goal_id) else None


def number_of(call: Leftover) -> int:
    """Return the id of a call's first goal as a number."""
    return call.goal_id.int


def _known(client: Client[Any], until: float) -> dict[uuid.UUID, WatchedGoal]:
    """Return the goals that the servers of a client's action know now, those of all clients.

    Raises:
        ClientClosedError: The client was closed, or its context was shut down.
    """
    connection = client._session.connection
    try:
        seen = goals_seen(connection.runtime.place, connection.names.status, lambda: False, until)
    except (StoppedError, RCLError):
        client._session.check()
        raise
    return {uuid.UUID(goal.goal_id): goal for goal in seen}
