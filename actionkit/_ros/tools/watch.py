"""Reads the status topic of an action: the goals of all clients that its servers remember."""

from __future__ import annotations

import uuid
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from action_msgs.msg import GoalStatusArray
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.exceptions import InvalidHandle
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from actionkit._ros import graph, runtimes
from actionkit._ros.codes import STATES
from actionkit._ros.native import MessageSource, RCLError
from actionkit._ros.wire import goals
from actionkit._threads.clock import TimerHandle

_DEPTH = 100
"""Depth of the queue; the topic's usual 1 would keep only the last state of each goal."""
_PERIOD = 0.25
"""Seconds between two checks for servers, often enough for a person who watches."""
_JOIN = 5.0
"""Seconds for the communication thread to end; it takes some ten milliseconds."""


@dataclass(frozen=True)
class GoalSeen:
    """One goal in a server's status message."""

    goal_id: str  # with dashes, as everywhere in ActionKit
    state: str  # the name of a `GoalState`
    accepted: float  # when the server accepted it: seconds since the epoch, by the server's clock


class StatusReader:
    """Reads the status topic of an action of any type until `close`."""

    def __init__(
        self,
        action_name: str,
        on_goals: Callable[[list[GoalSeen]], None],
        on_servers: Callable[[tuple[str, ...]], None],
    ) -> None:
        """Subscribe to the topic.

        On another thread, `on_goals` gets the goals that have changed, at first all that a server
        remembers, and `on_servers` gets the names of the servers' nodes when they change.
        """
        self._name = action_name
        self._on_goals = on_goals
        self._on_servers = on_servers
        self._servers: tuple[str, ...] = ()
        self._codes: dict[bytes, int] = {}
        """The status codes of the goals in the latest arrays, so that goals do not pile up here."""
        self._timer: TimerHandle | None = None
        self._runtime = runtimes.acquire(None, self)
        self._runtime.run(self._begin)

    def close(self) -> None:
        """Destroy the subscription and release the node."""
        self._runtime.run(self._end)
        runtimes.release(self._runtime, self)
        self._runtime.join_if_stopping(_JOIN)

    def _begin(self) -> None:
        self._subscription = self._runtime.node.create_subscription(
            GoalStatusArray,
            f"{self._name}/_action/status",
            _unused,
            QoSProfile(
                depth=_DEPTH,
                reliability=ReliabilityPolicy.RELIABLE,
                durability=DurabilityPolicy.TRANSIENT_LOCAL,
            ),
            raw=True,
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
        )
        self._source = MessageSource(self._subscription, self._take)
        self._runtime.enable(self._source)
        self._look()

    def _end(self) -> None:
        if self._timer is not None:
            self._runtime.cancel_timer(self._timer)
        self._runtime.disable(self._source)
        self._runtime.node.destroy_subscription(self._subscription)

    def _take(self) -> None:
        # Every array counts: a server that forgets goals at once shows an end in one array only.
        # But another client may cause hundreds of arrays in a second, of thousands of goals each.
        # So they are not decoded, and only changes are told.
        messages = self._source.take()
        if not messages:
            return
        before, self._codes = self._codes, {}
        changed = []
        for message in messages:
            for goal in goals(message):
                goal_id, _, _, code = goal
                if before.get(goal_id) != code:
                    before[goal_id] = code
                    changed.append(goal)
                self._codes[goal_id] = code
        if changed:
            self._on_goals([_seen(*goal) for goal in changed])

    def _look(self) -> None:
        self._timer = self._runtime.call_at(self._runtime.now() + _PERIOD, self._look)
        try:
            infos = graph.servers(self._runtime.node, graph.feedback_topic(self._name))
        except (RCLError, InvalidHandle):  # the context was shut down (R10)
            return
        servers = tuple(sorted(info.node or "(a node not known yet)" for info in infos))
        if servers != self._servers:
            self._servers = servers
            self._codes = {}  # goals that counted as lost are told of again
            self._on_servers(servers)


def _seen(goal_id: bytes, seconds: int, nanoseconds: int, code: int) -> GoalSeen:
    state = STATES.get(code, f"UNKNOWN ({code})")
    return GoalSeen(str(uuid.UUID(bytes=goal_id)), str(state), seconds + nanoseconds * 1e-9)


def _unused(_: Any) -> None:
    """Do nothing: rclpy demands a callback, but no executor calls it; the source takes."""
