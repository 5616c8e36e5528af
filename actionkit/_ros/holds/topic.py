"""The topic on which processes tell each other of holds.

Each publisher keeps its last message for those who come later ("transient local"), so a hold is
told as long as one process that knows of it lives. The type is one that rclpy itself needs, so it
is installed with rclpy; the message's text is JSON (see `state`).
"""

from __future__ import annotations

import contextlib
import logging
import uuid
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import Log
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message

from actionkit._ros import runtimes
from actionkit._ros.native import MessageSource, RCLError

TOPIC = "/actionkit/hold"
_NODE = "actionkit_hold_"
_UNKNOWN_NODE = "_NODE_NAME_UNKNOWN_"
"""The placeholder that the middleware has for a node's name just after discovery."""
_DEPTH = 200
"""Messages that wait to be read; the queue is one for all publishers."""
_JOIN = 5.0
"""Seconds for the communication thread to end; it takes some ten milliseconds."""
_log = logging.getLogger("actionkit")


@dataclass(frozen=True)
class Speaker:
    """A publisher of the topic.

    Attributes:
        node: The name of its node, or the placeholder while that is not known.
        gid: Its id; its first bytes are for the middleware and the computer.
    """

    node: str
    gid: bytes

    @property
    def computer(self) -> bytes:
        """What is the same for all on one computer, with Fast DDS."""
        return self.gid[:4]


class HoldTopic:
    """One process's ends of the topic, on the node's runtime that its clients share."""

    def __init__(self, domain_id: int, on_text: Callable[[str], None], *, speaks: bool) -> None:
        """Join the topic.

        Args:
            domain_id: The ROS domain.
            on_text: Called with the text of each message, on the communication thread.
            speaks: Whether `say` will be called. Others wait for the first words of a
                process that speaks.

        Raises:
            Exception: Anything that rclpy raises where a node cannot be made.
        """
        self._on_text = on_text
        self._publisher: Any = None
        # No two processes have the same, on any computer: others tell them apart by it.
        self.node_name = f"{_NODE}{uuid.uuid4().hex}"
        self._runtime = runtimes.acquire(domain_id, self)
        try:
            self._runtime.run(lambda: self._begin(speaks))
        except BaseException:  # also Ctrl-C: the runtime is let go
            self._release()
            raise

    @property
    def usable(self) -> bool:
        """Whether messages still come, and the graph can be asked."""
        return self._runtime.usable

    def say(self, text: str) -> None:
        """Publish a message, in place of the one before. Returns at once."""
        self._runtime.call_soon(lambda: self._publisher.publish(Log(name="actionkit", msg=text)))

    def speakers(self) -> list[Speaker]:
        """Return the publishers in sight that tell of holds, this process's included."""
        infos = self._node.get_publishers_info_by_topic(TOPIC)
        seen = [Speaker(info.node_name, bytes(info.endpoint_gid)) for info in infos]
        return [speaker for speaker in seen if speaker.node.startswith((_NODE, _UNKNOWN_NODE))]

    def close(self) -> None:
        """Leave the topic: what this process said last is not told to anybody any more."""
        try:
            self._runtime.run(self._end)
        finally:
            self._release()

    def _release(self) -> None:
        runtimes.release(self._runtime, self)
        self._runtime.join_if_stopping(_JOIN)

    def _begin(self, speaks: bool) -> None:
        # A node of its own for its name. It shares all else with the runtime's other nodes.
        self._node = Node(
            self.node_name,
            context=self._runtime.context,
            use_global_arguments=False,  # a remapped topic would be one on which nobody is
            enable_rosout=False,
            start_parameter_services=False,
            parameter_overrides=[Parameter("start_type_description_service", value=False)],
        )
        self._subscription = self._node.create_subscription(
            Log,
            TOPIC,
            _unused,
            _qos(_DEPTH),
            raw=True,
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
        )
        self._source = MessageSource(self._subscription, self._take)
        self._runtime.enable(self._source)
        if speaks:
            self._publisher = self._node.create_publisher(Log, TOPIC, _qos(1))

    def _end(self) -> None:
        self._runtime.disable(self._source)
        with contextlib.suppress(RCLError, InvalidHandle):
            self._node.destroy_node()

    def _take(self) -> None:
        for message in self._source.take():
            try:
                text = deserialize_message(message, Log).msg
            except (RuntimeError, UnicodeDecodeError):
                # Not left out: it may be a hold.
                text = repr(message[:200])
            self._on_text(text)


def _qos(depth: int) -> QoSProfile:
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    )


def _unused(_: Any) -> None:
    """Do nothing: rclpy demands a callback, but no executor calls it; the source takes."""
