"""Finds out which goals of a call the servers know."""

from __future__ import annotations

import queue
import time
import uuid
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from itertools import islice
from typing import TYPE_CHECKING, Any

from actionkit._calls.ledger.store import Leftover, attempt_number
from actionkit._model.cancel_answer import CancelAnswer
from actionkit._ros import graph
from actionkit._ros.native import RCLError
from actionkit._ros.stopping.goal_board import arrived
from actionkit._ros.tools.cancel import GoalCanceller
from actionkit._ros.tools.topic import StoppedError
from actionkit._ros.tools.watch import GoalSeen, goals_seen
from actionkit._threads.waiting import Flag

if TYPE_CHECKING:
    from actionkit._client import Client

_AGAIN = 0.3
"""Seconds between two looks."""
_AT_ONCE = 50
"""Goals that servers are asked about at a time; fewer requests than these are on their way."""
_TICK = 0.05
"""Seconds between two checks whether the time is over."""
_Answer = tuple[uuid.UUID, bool]


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
    by_id = sorted(found, key=lambda call: call.goal_id.int)
    while waiting:
        seen = _by_call(by_id, _known(client, until))
        late = time.monotonic() >= until
        for call in [call for call in (found if late else seen) if call in waiting]:
            goals = seen.get(call, {})
            for goal_id, goal in goals.items():
                if goal.in_flight and goal_id not in found[call]:
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
    by_id: list[Leftover], known: dict[uuid.UUID, GoalSeen]
) -> dict[Leftover, dict[uuid.UUID, GoalSeen]]:
    """Return the goals of each call that has some. There may be many calls, and many goals."""
    seen: dict[Leftover, dict[uuid.UUID, GoalSeen]] = {}
    for goal_id, goal in known.items():
        place = bisect_right(by_id, goal_id.int, key=lambda call: call.goal_id.int)
        if place and by_id[place - 1].has(goal_id):
            seen.setdefault(by_id[place - 1], {})[goal_id] = goal
    return seen


def asked(
    client: Client[Any],
    goal_ids: Iterable[uuid.UUID],
    until: float,
    may_come: Callable[[uuid.UUID], bool],
) -> Iterator[_Answer]:
    """Ask to cancel goals; yield each with whether a server knows it, when all have answered.

    One that `may_come` is asked for until the end if no server knows it yet. This ends when each
    goal was yielded, or at the monotonic time `until`.
    """
    port = client._session.port
    answers: queue.SimpleQueue[Any] = queue.SimpleQueue()
    unknown: Counter[int] = Counter()
    """How many servers do not know the goal of each request."""
    left, waiting, may_be_accepted = iter(goal_ids), set[uuid.UUID](), set[uuid.UUID]()
    with closing(GoalCanceller(port.names, answers.put, port.runtime.place)) as canceller:
        while time.monotonic() < until:
            for goal_id in islice(left, _AT_ONCE - len(waiting)):
                waiting.add(goal_id)
                canceller.cancel(str(goal_id))
            if not waiting and not may_be_accepted:
                return
            servers = in_sight(client)
            for said in arrived(answers, _TICK):
                goal_id = uuid.UUID(said.goal_id)
                knows = said.answer is not CancelAnswer.UNKNOWN_GOAL
                unknown[said.request] += not knows
                if goal_id not in waiting and not (knows and goal_id in may_be_accepted):
                    continue
                if not knows and unknown[said.request] < max(1, servers):
                    continue
                waiting.discard(goal_id)
                may_be_accepted.discard(goal_id)
                if not knows and may_come(goal_id):
                    may_be_accepted.add(goal_id)
                    continue
                canceller.stop(said.goal_id)
                yield goal_id, knows
    for goal_id in may_be_accepted:
        yield goal_id, False


def in_sight(client: Client[Any]) -> int:
    """Return how many servers of a client's action the graph shows, also those not ready."""
    port = client._session.port
    return port.runtime.run(lambda: len(graph.servers(port.runtime.node, port.names)))


def _known(client: Client[Any], until: float) -> dict[uuid.UUID, GoalSeen]:
    """Return the goals that the servers of a client's action know now, those of all clients.

    Raises:
        ClientClosedError: The client was closed, or its context was shut down.
    """
    port = client._session.port
    try:
        seen = goals_seen(port.runtime.place, port.names.status, lambda: False, until)
    except (StoppedError, RCLError):
        client._session.check()
        raise
    return {uuid.UUID(goal.goal_id): goal for goal in seen}
