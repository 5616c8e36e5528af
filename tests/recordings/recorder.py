"""Records the topics of actions, as `ros2 bag record --include-hidden-topics` does."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import rclpy
from action_msgs.msg import GoalStatusArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from test_msgs.action import Fibonacci

from actionkit._ros.answers.wire import goals
from actionkit._ros.others_goals.server_numbers import GoalKey
from tests.recordings.bags import FIBONACCI, Message
from tests.waiting import until

_TYPES = {
    "status": (GoalStatusArray, "action_msgs/msg/GoalStatusArray"),
    "feedback": (Fibonacci.Impl.FeedbackMessage, f"{FIBONACCI}_FeedbackMessage"),
}


class Recorder:
    """Has all messages that came."""

    def __init__(self, node: Any, names: tuple[str, ...]) -> None:
        self.messages: list[Message] = []
        self._readers = [
            self._subscribe(node, f"{name}/_action/{kind}", *_TYPES[kind])
            for name in names
            for kind in _TYPES
        ]

    def _subscribe(self, node: Any, topic: str, cls: Any, ros_type: str) -> Any:
        qos = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
        if topic.endswith("status"):
            qos.durability = DurabilityPolicy.TRANSIENT_LOCAL

        def record(data: bytes) -> None:
            self.messages.append(Message(topic, ros_type, time.time_ns(), bytes(data)))

        return node.create_subscription(cls, topic, record, qos, raw=True)

    def sees(self, servers: int) -> None:
        """Wait until so many servers of each action are in sight."""
        until(lambda: all(each.get_publisher_count() >= servers for each in self._readers))

    def has_ends(self, count: int) -> None:
        """Wait until so many goals have ended."""

        def ended() -> set[GoalKey]:
            arrays = (each.data for each in list(self.messages) if each.topic.endswith("status"))
            return {goal[:3] for array in arrays for goal in goals(array) if goal[3] > 3}

        until(lambda: len(ended()) >= count, f"{count} ends")


@contextmanager
def recording(domain: int, *names: str) -> Iterator[Recorder]:
    """Record the actions with these names."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node("recorder", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin, daemon=True)
    recorder = Recorder(node, names)
    thread.start()
    try:
        yield recorder
    finally:
        executor.shutdown()
        thread.join(10)
        node.destroy_node()
        rclpy.shutdown(context=context)
