"""The only module of agents that touches rclpy: a node, and subscriptions while they are needed."""

from __future__ import annotations

import atexit
import importlib
import logging
import os
import threading
import time
import uuid
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from dataclasses import dataclass
from typing import Any
from weakref import WeakSet

from actionkit._ros import wire

_PERIOD = 0.05
"""Seconds between two looks for publishers, while something is being read."""
_SETTLE = 0.1
"""Seconds for messages that publishers keep: there may be several, and the newest is wanted."""
_STATUS_WAIT = 1.0
"""Seconds for the status of servers that have been joined: those that never had a goal send
none."""
_DISCOVERY = 3.5
"""Seconds until a new node has found all servers that are there, and has got what they keep."""
_STATES = {1: "ACCEPTED", 2: "EXECUTING", 3: "CANCELING"}  # of goals that have not ended
_log = logging.getLogger("actionkit")


@dataclass(frozen=True)
class Reading:
    """What was read of a topic.

    Attributes:
        message: The newest message, or `None`.
        age: Seconds since it was published.
        publishers: How many there are.
        other_types: Types other than the asked one that are published on the topic.
    """

    message: Any
    age: float | None
    publishers: int
    other_types: tuple[str, ...]


@dataclass(frozen=True)
class GoalThere:
    """A goal that a server has, and that has not ended.

    Attributes:
        goal_id: Its id, with dashes.
        state: `ACCEPTED`, `EXECUTING` or `CANCELING`.
        age: Seconds since the server accepted it, by the server's clock.
    """

    goal_id: str
    state: str
    age: float


class RosNode:
    """A node of the toolbox's own, in its domain. Its thread lives while a topic is being read."""

    def __init__(self, domain_id: int | None) -> None:
        self._domain_id = domain_id
        self._lock = threading.Lock()
        self._context: Any = None
        self._node: Any = None
        self._opened = 0.0
        self._thread: threading.Thread | None = None
        self._requests: list[_Request] = []
        self._closed = False
        _open_nodes.add(self)
        self._spinning = threading.Lock()
        """Held by the thread; the one before it may not have let go of the node."""

    def open(self) -> Any:
        """Return the node, made where there is none that works. Takes a moment.

        Raises:
            RuntimeError: It was closed.
        """
        with self._lock:
            return self._open()

    def _open(self) -> Any:
        if self._closed:
            raise RuntimeError("the toolbox was closed")
        if self._node is not None and self._context.ok():
            return self._node
        context: Any = importlib.import_module("rclpy.context").Context()
        context.init(None, initialize_logging=False, domain_id=self._domain_id)
        node: Any = importlib.import_module("rclpy.node")
        self._node = node.Node(
            f"actionkit_agent_{os.getpid()}",
            context=context,
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._context, self._opened = context, time.monotonic()
        return self._node

    def read(
        self, topic: str, ros_type: str, cls: Any, wait: float, max_age: float | None
    ) -> Future[Reading]:
        """Subscribe, wait for a message, and unsubscribe. Blocks for no longer than `open`.

        Args:
            topic: Its name.
            ros_type: Such as `std_msgs/msg/String`.
            cls: The type's class.
            wait: Seconds.
            max_age: Seconds; older messages are not taken.

        Returns:
            A future. Cancelling it ends the subscription.
        """
        with self._lock:
            self._open()
            return self._begin(_Request(topic, ros_type, cls, wait, max_age))

    def _begin(self, request: _Request) -> Future[Any]:
        self._requests.append(request)
        if self._thread is None:
            self._thread = threading.Thread(
                target=self._run, args=(self._context, self._node), name="actionkit-topics"
            )
            self._thread.daemon = True
            self._thread.start()
        return request.future

    def goals(self, status_topic: str) -> Future[tuple[GoalThere, ...]]:
        """Ask the servers of an action which goals they have now, of any program.

        Their status topic tells. A server that never had a goal has nothing to tell. Blocks for no
        longer than `open`.
        """
        with self._lock:
            self._open()
            return self._begin(_StatusRequest(status_topic, self._opened))

    def _run(self, context: Any, node: Any) -> None:
        """Serve the requests until there are none. All that is done to subscriptions is here."""
        with self._spinning:
            self._spin(context, node)

    def _spin(self, context: Any, node: Any) -> None:
        executor: Any = importlib.import_module("rclpy.executors").SingleThreadedExecutor(
            context=context
        )
        try:
            executor.add_node(node)
            while self._serve(node):
                executor.spin_once(timeout_sec=_PERIOD)
        except Exception as error:  # noqa: BLE001  after any error nobody waits for ever
            _log.debug("reading topics failed", exc_info=True)
            with self._lock:
                failed, self._requests = self._requests, []
                self._thread = None
            for request in failed:
                request.fail(error)
        finally:
            with suppress(Exception):
                executor.remove_node(node)
                executor.shutdown()

    def _serve(self, node: Any) -> bool:
        """Take each request a step on; return whether there are any left."""
        with self._lock:
            requests = list(self._requests)
        for request in requests:
            if request.step(node, closed=self._closed):
                with self._lock:
                    self._requests.remove(request)
        with self._lock:
            if not self._requests:
                self._thread = None
            return bool(self._requests)

    def close(self) -> None:
        """End what is being read, and the node. Blocks for a moment."""
        with self._lock:
            self._closed = True
            thread = self._thread
        if thread is not None:
            thread.join(5.0)
        with self._lock:
            node, self._node = self._node, None
        if node is not None:
            with suppress(Exception):
                node.destroy_node()
            with suppress(Exception):  # somebody else has shut it down
                self._context.shutdown()


_open_nodes: WeakSet[RosNode] = WeakSet()


@atexit.register
def _close_all() -> None:
    """Close what nobody has closed: the middleware crashes under a thread that still uses it."""
    for node in list(_open_nodes):
        node.close()


class _Request:
    """One reading of a topic. On the thread of the node, except its future."""

    _depth = 1

    def __init__(
        self, topic: str, ros_type: str, cls: Any, wait: float, max_age: float | None
    ) -> None:
        self.future: Future[Any] = Future()
        self._topic = topic
        self._type = ros_type
        self._cls = cls
        self._until = time.monotonic() + wait
        self._max_age = max_age
        self._subscriptions: dict[tuple[Any, Any], Any] = {}
        self._newest: tuple[int, bytes] | None = None
        self._settled = 0.0
        self._publishers = 0
        self._others: set[str] = set()

    def step(self, node: Any, *, closed: bool) -> bool:
        """Subscribe to publishers that have come; return whether it is over."""
        now = time.monotonic()
        over = closed or self.future.cancelled() or now >= self._until
        if not over and self._newest is None:
            self._look(node)
        if over or (self._newest is not None and now >= self._settled):
            for subscription in self._subscriptions.values():
                node.destroy_subscription(subscription)
            self._finish()
            return True
        return False

    def fail(self, error: Exception) -> None:
        """End it with an error."""
        with suppress(InvalidStateError):  # cancelled meanwhile
            self.future.set_exception(error)

    def _look(self, node: Any) -> None:
        qos: Any = importlib.import_module("rclpy.qos")
        infos = node.get_publishers_info_by_topic(self._topic)
        self._others = {info.topic_type for info in infos} - {self._type}
        ours = [info.qos_profile for info in infos if info.topic_type == self._type]
        self._publishers = len(ours)
        # As each publisher offers it: one that asks for more is not served, and one that asks for
        # less misses what is kept for it, and parts of large messages.
        for offered in ours:
            key = (offered.reliability, offered.durability)
            if key in self._subscriptions:
                continue
            kept = offered.durability == qos.DurabilityPolicy.TRANSIENT_LOCAL
            profile = qos.QoSProfile(depth=self._depth, reliability=key[0], durability=key[1])
            self._subscriptions[key] = node.create_subscription(
                self._cls, self._topic, self._kept if kept else self._fresh, profile, raw=True
            )

    def _kept(self, message: bytes, info: Any) -> None:
        self._take(message, info, _SETTLE)

    def _fresh(self, message: bytes, info: Any) -> None:
        self._take(message, info, 0.0)

    def _take(self, message: bytes, info: Any, settle: float) -> None:
        now = time.time_ns()
        stamp = int(info["source_timestamp"]) or now
        if self._max_age is not None and now - stamp > self._max_age * 1e9:
            return
        if self._newest is None or stamp > self._newest[0]:
            self._newest = (stamp, bytes(message))
        self._settled = time.monotonic() + settle

    def _finish(self) -> None:
        try:
            message = age = None
            if self._newest is not None:
                stamp, raw = self._newest
                decode: Any = importlib.import_module("rclpy.serialization").deserialize_message
                message = decode(raw, self._cls)
                age = max(0.0, (time.time_ns() - stamp) / 1e9)
            others = tuple(sorted(self._others))
            with suppress(InvalidStateError):
                self.future.set_result(Reading(message, age, self._publishers, others))
        except Exception as error:  # noqa: BLE001  bytes that are not of the type
            self.fail(error)


class _StatusRequest(_Request):
    """One look at the goals that the servers of an action have."""

    _depth = 100  # there may be several servers, and each has a message of its own

    def __init__(self, status_topic: str, opened: float) -> None:
        cls: Any = importlib.import_module("action_msgs.msg").GoalStatusArray
        ros_type = "action_msgs/msg/GoalStatusArray"
        super().__init__(status_topic, ros_type, cls, _STATUS_WAIT, None)
        self._all: list[tuple[int, bytes]] = []
        self._found_by = opened + _DISCOVERY
        self._until = max(self._until, self._found_by)
        self._joined = False

    def _look(self, node: Any) -> None:
        super()._look(node)
        now = time.monotonic()
        joined = sum(one.get_publisher_count() for one in self._subscriptions.values())
        if not self._publishers and now > self._found_by:
            self._until = 0.0  # no server is in sight
        elif self._publishers and joined >= self._publishers and not self._joined:
            self._joined = True  # what the servers keep comes now, if there is anything
            self._until = now + _STATUS_WAIT

    def _take(self, message: bytes, info: Any, settle: float) -> None:
        if self._newest is None:
            super()._take(message, info, _SETTLE)
        self._all.append((int(info["source_timestamp"]), bytes(message)))

    def _finish(self) -> None:
        there: dict[bytes, GoalThere] = {}
        for _, message in sorted(self._all):
            for goal_id, seconds, nanoseconds, code in wire.goals(message):
                there.pop(goal_id, None)
                if code in _STATES:
                    age = max(0.0, time.time() - seconds - nanoseconds * 1e-9)
                    text = str(uuid.UUID(bytes=goal_id))
                    there[goal_id] = GoalThere(text, _STATES[code], round(age, 3))
        with suppress(InvalidStateError):  # cancelled meanwhile
            self.future.set_result(tuple(there.values()))
