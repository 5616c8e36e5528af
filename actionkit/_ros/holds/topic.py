"""The topic on which processes tell each other about holds.

Each publisher keeps its last message for later subscribers ("transient local"). So a hold stays
known as long as one process that knows it lives. The message type is one that rclpy itself needs,
so it is always installed; the message's text is JSON (see `state`).
"""

from __future__ import annotations

import contextlib
import logging
import uuid
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from rcl_interfaces.msg import Log
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message

from actionkit._ros.communication import runtimes
from actionkit._ros.communication.own_node import make_node
from actionkit._ros.rclpy_private.native import GONE
from actionkit._ros.rclpy_private.wait_set import subscribe_raw

TOPIC = "/actionkit/hold"
_NODE = "actionkit_hold_"
_UNKNOWN_NODE = "_NODE_NAME_UNKNOWN_"
"""The middleware's placeholder for a node's name just after discovery."""
_PROCESS = 12
"""The first bytes of the id of a publisher, which all of its process have in common."""
_DEPTH = 200
"""Messages that wait to be read; all publishers share one queue."""
_JOIN = 5.0
"""Seconds for the communication thread to end; it takes some ten milliseconds."""
_log = logging.getLogger("actionkit")


@dataclass(frozen=True)
class Speaker:
    """A publisher of the topic."""

    node: str  # the name of its node, or the placeholder while that is not known
    gid: bytes  # its id
    shares_files: bool  # whether it has the same hold files as we


class HoldTopic:
    """One process's publisher and subscription, on the runtime that its clients share."""

    def __init__(
        self, domain_id: int, on_text: Callable[[str], None], *, speaks: bool, files: str
    ) -> None:
        """Join the topic; errors of rclpy go to the caller.

        `on_text` gets the text of each message, on the communication thread. `speaks` says whether
        `say` will be called: others wait for the first message of a process that speaks. `files`
        is what only processes with the same hold files have (`HoldFiles.shared_by`).
        """
        self._on_text = on_text
        self._files_topic = f"{TOPIC}/files_{files}"
        self._publisher: Any = None
        # Unique on all computers: others identify the process by it.
        self.node_name = f"{_NODE}{uuid.uuid4().hex}"
        self._runtime = runtimes.acquire(domain_id, self)
        try:
            self._runtime.run(lambda: self._begin(speaks))
        except BaseException:  # also after Ctrl-C: the runtime is released
            self._release()
            raise

    @property
    def usable(self) -> bool:
        """Whether messages still come, and the graph can be asked."""
        return self._runtime.usable

    def say(self, text: str) -> None:
        """Publish a message, in place of the one before. Returns at once."""
        self._runtime.call_soon(partial(self._publish, Log(name="actionkit", msg=text)))

    def _publish(self, message: Log) -> None:
        with contextlib.suppress(*GONE):
            self._publisher.publish(message)

    def speakers(self) -> list[Speaker]:
        """Return the publishers in sight, also that of this process."""
        sharing = {gid[:_PROCESS] for _, gid in self._publishers(self._files_topic)}
        seen = [
            Speaker(node, gid, gid[:_PROCESS] in sharing) for node, gid in self._publishers(TOPIC)
        ]
        return [speaker for speaker in seen if speaker.node.startswith((_NODE, _UNKNOWN_NODE))]

    def _publishers(self, topic: str) -> list[tuple[str, bytes]]:
        infos = self._node.get_publishers_info_by_topic(topic)
        return [(info.node_name, bytes(info.endpoint_gid)) for info in infos]

    def close(self) -> None:
        """Leave the topic: nobody gets this process's last message any more."""
        try:
            self._runtime.run(self._end)
        finally:
            self._release()

    def _release(self) -> None:
        runtimes.release(self._runtime, self)
        self._runtime.join_if_stopping(_JOIN)

    def _begin(self, speaks: bool) -> None:
        # A node of its own, for its name. It shares everything else with the runtime's nodes.
        self._node = make_node(self.node_name, self._runtime.context, own=True)
        self._source = subscribe_raw(self._node, Log, TOPIC, _qos(_DEPTH), self._take)
        self._runtime.enable(self._source)
        if speaks:
            # Never published on: its name tells who has our files, also to those who get none of
            # our data, as other users of this computer, and containers, may not.
            self._node.create_publisher(Log, self._files_topic, 1)
            self._publisher = self._node.create_publisher(Log, TOPIC, _qos(1))

    def _end(self) -> None:
        self._runtime.disable(self._source)
        with contextlib.suppress(*GONE):
            self._node.destroy_node()

    def _take(self) -> None:
        for message in self._source.take():
            try:
                text = deserialize_message(message, Log).msg
            except (RuntimeError, UnicodeDecodeError):
                # Not ignored: it may be a hold.
                text = repr(message[:200])
            self._on_text(text)


def _qos(depth: int) -> QoSProfile:
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    )
