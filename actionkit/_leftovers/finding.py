"""Finds out which goals of a call the servers know."""

from __future__ import annotations

import time
import uuid
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from actionkit._calls.ledger.store import Leftover
from actionkit._ros.tools.topic import StoppedError
from actionkit._ros.tools.watch import GoalSeen, goals_seen
from actionkit._threads.waiting import Flag

if TYPE_CHECKING:
    from actionkit._client import Client

SERVER = 5.0
"""Seconds until a server that runs is in sight."""
_AGAIN = 0.5
"""Seconds between two looks."""


def domain_of(client: Client[Any]) -> int:
    """Return the ROS domain of a client."""
    return client._session.identity.domain_id


def goals_of(client: Client[Any], until: float) -> dict[uuid.UUID, GoalSeen]:
    """Return the goals that the servers of a client's action know now, those of all clients."""
    status, domain = client._session.port.names.status, domain_of(client)
    try:
        seen = goals_seen(domain, status, lambda: time.monotonic() >= until)
    except StoppedError:  # the time is over
        return {}
    return {uuid.UUID(goal.goal_id): goal for goal in seen}


def is_last(call: Leftover, state: str) -> bool:
    """Whether a call sends no other goal after one that has ended in this state."""
    return call.attempts == 1 or (state == "SUCCEEDED" and not call.judged)


def find(
    client: Client[Any], calls: Iterable[Leftover], until: float
) -> Iterator[tuple[Leftover, uuid.UUID]]:
    """Yield each call with the goal to follow: the one that runs, else the last one known.

    A goal that was sent just before its process ended may be accepted late, and so may a retry. So
    this looks again until the monotonic time `until`, or until there is nothing more to wait for.
    """
    waiting = list(calls)
    there = bool(waiting) and client.wait_for_server(min(SERVER, until - time.monotonic()))
    while waiting:
        known = goals_of(client, until) if there else {}
        late = not there or time.monotonic() >= until
        for call in list(waiting):
            ids = [one for one in call.ids() if one in known]
            running = [one for one in ids if known[one].in_flight]
            final = [one for one in ids if is_last(call, known[one].state)]
            if running or final or late:
                waiting.remove(call)
                yield call, (running or final or ids or [call.goal_id])[-1]
        if waiting:
            Flag().wait(_AGAIN)
