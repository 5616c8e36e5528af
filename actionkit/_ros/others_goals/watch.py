"""Reads the status topic of an action: the goals of all clients that its servers remember."""

from __future__ import annotations

import math
import time
import uuid
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass

from action_msgs.msg import GoalStatusArray
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from actionkit._ros.answers.wire import STATES, goals
from actionkit._ros.communication.runtimes import Place
from actionkit._ros.endpoints import graph
from actionkit._ros.endpoints.names import ActionNames
from actionkit._ros.others_goals.goal_board import DISCOVERY, FIRST, Board, WatchedGoal
from actionkit._ros.others_goals.topic import SETTLE, Stamped, TopicReader

_TYPE = "action_msgs/msg/GoalStatusArray"
_DEPTH = 100
"""Depth of the queue; the topic's usual 1 would keep only the last state of each goal."""
_OFFERED = ((ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL),)
"""The usual QoS of servers. So their kept status arrives as soon as they are discovered."""
_PERIOD = 0.25
"""Seconds between two checks for servers, often enough for a person who watches."""

_Key = tuple[bytes, int, int]
"""A goal on one server: its id, and the two numbers of the stamp."""


@dataclass(frozen=True)
class GoalSeen:
    """One goal in a server's status message.

    Each of several servers on one name stamps its acceptance of a goal itself. So the id and the
    stamp together tell which server's goal it is, even if no message says from whom it comes.
    """

    goal_id: str  # with dashes, as everywhere in ActionKit
    state: str  # the name of a `GoalState`
    stamp: int  # when the server accepted it: nanoseconds since the epoch, by the server's clock

    @property
    def accepted(self) -> float:
        """When the server accepted it: seconds since the epoch, by the server's clock."""
        return self.stamp * 1e-9


class StatusReader:
    """Reads the status topic of an action of any type until `close`."""

    def __init__(
        self,
        names: ActionNames,
        on_goals: Callable[[list[GoalSeen]], None],
        on_servers: Callable[[tuple[str, ...]], None],
        place: Place | None = None,
    ) -> None:
        """Subscribe to the topic; `place` is that of `runtimes.acquire`.

        On another thread, `on_goals` gets the goals that have changed, at first all that a server
        remembers, which may be none, and `on_servers` gets the names of the servers' nodes when
        they change.
        """
        self._names = names
        self._on_goals = on_goals
        self._on_servers = on_servers
        self._servers: tuple[str, ...] = ()
        self._has_status = False
        self._codes: dict[_Key, int] = {}
        """The status codes of the goals in the latest arrays, so that goals do not pile up here."""
        self._reader = TopicReader(
            place,
            self._names.status,
            _TYPE,
            GoalStatusArray,
            depth=_DEPTH,
            period=_PERIOD,
            at_once=_OFFERED,
            on_messages=self._take,
            on_look=self._look,
        )

    def close(self) -> None:
        """End the subscription."""
        self._reader.close()

    def _take(self, arrays: list[Stamped]) -> None:
        # Every array counts: a server that forgets goals at once shows an end in one array only.
        # But another client may cause hundreds of arrays in a second, of thousands of goals each.
        # So they are not decoded, and only changes are told.
        before, self._codes = self._codes, {}
        changed = []
        for _, message in arrays:
            for goal in goals(message):
                key, code = goal[:3], goal[3]
                if before.get(key) != code:
                    before[key] = code
                    changed.append(goal)
                self._codes[key] = code
        if changed or (arrays and not self._has_status):
            self._has_status = True
            self._on_goals([_seen(*goal) for goal in changed])

    def _look(self, node: Node) -> None:
        infos = graph.servers(node, self._names)
        servers = tuple(sorted(info.node or "(a node not known yet)" for info in infos))
        if servers != self._servers:
            self._servers = servers
            self._codes = {}  # goals that counted as lost are told of again
            self._has_status = False
            self._on_servers(servers)


def goals_in_flight(
    place: Place | None, status_topic: str, stopped: Callable[[], bool]
) -> list[WatchedGoal]:
    """Return those of `goals_seen` that have not ended."""
    return [goal for goal in goals_seen(place, status_topic, stopped) if not goal.ended]


def goals_seen(
    place: Place | None,
    status_topic: str,
    stopped: Callable[[], bool],
    until: float = math.inf,
) -> list[WatchedGoal]:
    """Return the goals that the servers of an action know now, each once. Errors: see `arriving`.

    `place` is that of `runtimes.acquire`. A server that never had a goal sends no status. At the
    monotonic time `until`, what has come by then is returned.
    """
    arrays: list[Stamped] = []
    joined, heard = False, math.inf
    topic = TopicReader(place, status_topic, _TYPE, GoalStatusArray, depth=_DEPTH)
    with closing(topic) as reader:
        found_by = reader.runtime.in_graph_since + DISCOVERY
        ends = max(time.monotonic() + FIRST, found_by)
        for told in reader.arriving(stopped):
            now = time.monotonic()
            if told and not arrays:
                heard = now
            arrays += told
            if not arrays and not joined and reader.joined >= max(1, reader.publishers):
                joined = True  # a kept status would come now
                ends = now + FIRST
            # What has ended on one of several servers may run on another.
            enough = heard + (SETTLE if reader.publishers < 2 else FIRST)
            if now >= min(ends, enough, until) or (
                now >= found_by and not reader.publishers and not arrays
            ):
                break
    # Where the clock of a server stands still, its messages have one stamp: then what was published
    # last counts.
    in_order = (goal for _, array in sorted(arrays) for goal in goals(array))
    newest = {goal[:3]: goal for goal in in_order}
    board = Board(most=math.inf)
    board.take([_seen(*goal) for goal in newest.values()], time.time())
    return board.sorted()


def _seen(goal_id: bytes, seconds: int, nanoseconds: int, code: int) -> GoalSeen:
    state = STATES.get(code, f"UNKNOWN ({code})")
    return GoalSeen(str(uuid.UUID(bytes=goal_id)), str(state), seconds * 10**9 + nanoseconds)
