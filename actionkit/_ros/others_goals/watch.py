"""Reads the status topic of an action: the goals of all clients that its servers remember."""

from __future__ import annotations

import math
import time
import uuid
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import Any

from action_msgs.msg import GoalStatusArray
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rclpy.serialization import deserialize_message

from actionkit._model.action_type import type_name_of
from actionkit._ros.answers.wire import ID_SIZE, STATES, feedback_goal_id, goals
from actionkit._ros.communication.runtimes import Place
from actionkit._ros.endpoints import graph
from actionkit._ros.endpoints.names import ActionNames
from actionkit._ros.others_goals.goal_board import DISCOVERY, FIRST, Board, WatchedGoal
from actionkit._ros.others_goals.server_numbers import GoalKey, ServerNumbers
from actionkit._ros.others_goals.topic import SETTLE, Stamped, TopicReader

_TYPE = "action_msgs/msg/GoalStatusArray"
_DEPTH = 100
"""Depth of the queue; the topic's usual 1 would keep only the last state of each goal."""
_OFFERED = ((ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL),)
"""The usual QoS of servers. So their kept status arrives as soon as they are discovered."""
_PERIOD = 0.25
"""Seconds between two checks for servers, often enough for a person who watches."""
_FEEDBACK_DEPTH = 10
"""As servers have it."""
_FEEDBACK_PERIOD = 1.0
"""Seconds between two feedback messages of a goal; those between them are dropped."""


@dataclass(frozen=True)
class GoalSeen:
    """One goal in a server's status message.

    Each of several servers on one name stamps its acceptance of a goal itself. So the id and the
    stamp together tell which server's goal it is, even if no message says from whom it comes.
    """

    goal_id: str  # with dashes, as everywhere in ActionKit
    state: str  # the name of a `GoalState`
    stamp: int  # when the server accepted it: nanoseconds since the epoch, by the server's clock
    server: int = 1  # the server's number, as `ServerNumbers` counts them

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
        period: float = _PERIOD,
    ) -> None:
        """Subscribe to the topic; `place` is that of `runtimes.acquire`.

        It looks for servers every `period` seconds.

        On another thread, `on_goals` gets the goals that have changed, at first all that a server
        remembers, which may be none, and `on_servers` gets the names of the servers' nodes when
        they change.
        """
        self._names = names
        self._on_goals = on_goals
        self._on_servers = on_servers
        self._servers: tuple[str, ...] = ()
        self._has_status = False
        self._numbers = ServerNumbers()
        self._codes: dict[int, dict[GoalKey, int]] = {}
        """The status codes in the latest array of each server, so that goals do not pile up."""
        self._reader = TopicReader(
            place,
            self._names.status,
            _TYPE,
            GoalStatusArray,
            depth=_DEPTH,
            period=period,
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
        changed = []
        for _, message in arrays:
            codes = {goal[:3]: goal[3] for goal in goals(message)}
            number = self._numbers.of(codes, len(self._servers)) if codes else 0
            before = self._codes.get(number, {})
            for key, code in codes.items():
                if before.get(key) != code:
                    changed.append((*key, code, number))
            self._codes[number] = codes
        if changed or (arrays and not self._has_status):
            self._has_status = True
            self._on_goals([_seen(*goal) for goal in changed])

    def _look(self, node: Node) -> None:
        infos = graph.servers(node, self._names)
        servers = tuple(sorted(info.node or "(a node not known yet)" for info in infos))
        if servers != self._servers:
            if not servers:
                self._numbers = ServerNumbers()  # those that come now are others
            self._servers = servers
            self._codes = {}  # goals that counted as lost are told of again
            self._has_status = False
            self._on_servers(servers)


def read_feedback(
    names: ActionNames,
    action_type: Any,
    on_feedback: Callable[[str, Callable[[], Any]], None],
    period: float,
) -> TopicReader:
    """Read the feedback of all goals of an action until `close`: of each goal, one in a second.

    `action_type` is the class of its type. On another thread, `on_feedback` gets a goal's id, and a
    function that decodes the feedback. `period` is as for `StatusReader`.
    """
    cls = action_type.Impl.FeedbackMessage
    latest: dict[bytes, float] = {}  # when each goal's last one was passed on, the oldest first

    def take(messages: list[Stamped]) -> None:
        now = time.monotonic()
        while latest and now - next(iter(latest.values())) >= _FEEDBACK_PERIOD:
            del latest[next(iter(latest))]
        for _, message in messages:
            goal_id = feedback_goal_id(message)
            # Before decoding: most messages are dropped.
            if goal_id not in latest and len(goal_id) == ID_SIZE:
                latest[goal_id] = now
                on_feedback(str(uuid.UUID(bytes=goal_id)), partial(_feedback_in, message, cls))

    ros_type = type_name_of(action_type) + "_FeedbackMessage"
    depth, topic = _FEEDBACK_DEPTH, names.feedback
    return TopicReader(None, topic, ros_type, cls, depth=depth, period=period, on_messages=take)


def _feedback_in(message: bytes, cls: Any) -> Any:
    return deserialize_message(message, cls).feedback


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


def _seen(goal_id: bytes, seconds: int, nanoseconds: int, code: int, server: int = 1) -> GoalSeen:
    state, stamp = STATES.get(code, f"UNKNOWN ({code})"), seconds * 10**9 + nanoseconds
    return GoalSeen(str(uuid.UUID(bytes=goal_id)), str(state), stamp, server)
