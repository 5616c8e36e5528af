"""Reads a topic of any type.

The communication thread waits for messages. For large ones, another thread takes and decodes them.
"""

from __future__ import annotations

import queue
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message

from actionkit._ros.communication import runtimes
from actionkit._ros.rclpy_private.wait_set import MessageSource, subscribe_raw
from actionkit._threads.clock import TimerHandle

PERIOD = 0.05
"""Seconds between two searches for publishers, and between two checks whether to stop."""
SETTLE = 0.1
"""Seconds to wait for more kept messages: each publisher may send one; we want the newest."""
_JOIN = 5.0
"""Seconds for the communication thread to end; it takes some ten milliseconds."""
Stamped = tuple[int, bytes]
"""When a message was published, in nanoseconds since the epoch; and the message."""
Qos = tuple[ReliabilityPolicy, DurabilityPolicy]


class StoppedError(RuntimeError):
    """A reading was stopped: by its caller, the end of the program, or a shutdown of rclpy."""


class TopicReader:
    """Raw subscriptions to a topic until `close`, one for each QoS that its publishers offer.

    A subscription that asks for more than a publisher offers gets nothing. One that asks for less
    misses kept messages, and parts of large ones.

    The communication thread calls `on_messages` with new messages (without it, use `arriving`), and
    `on_look` with the node after each search for publishers. The subscriptions of `at_once` are
    made before any publisher is found.
    """

    def __init__(
        self,
        place: runtimes.Place | None,
        topic: str,
        ros_type: str,
        cls: Any,
        *,
        depth: int = 1,
        period: float = PERIOD,
        at_once: tuple[Qos, ...] = (),
        on_messages: Callable[[list[Stamped]], object] | None = None,
        on_look: Callable[[Node], object] = lambda node: None,
    ) -> None:
        self.publishers = 0
        self.joined = 0  # of these, how many send to us; one may count twice
        self.other_types: frozenset[str] = frozenset()  # published there besides `ros_type`
        self.keeps = False  # whether a publisher keeps messages for later subscribers
        self._topic, self._type, self._cls = topic, ros_type, cls
        self._depth, self._period, self._at_once = depth, period, at_once
        self._inbox: queue.SimpleQueue[MessageSource] = queue.SimpleQueue()
        self._on_messages, self._on_look = on_messages, on_look
        self._error: Exception | None = None
        self._timer: TimerHandle | None = None
        self._sources: dict[Qos, MessageSource] = {}
        type(cls).__import_type_support__()  # loads a library: too slow for that thread
        self.runtime = runtimes.acquire(place, self)
        try:
            self.runtime.run(self._look)
            if self._error is not None:
                raise self._error
        except BaseException:  # also after Ctrl-C: nobody would call `close`
            self.runtime.call_soon(self._end)
            raise

    def arriving(self, stopped: Callable[[], bool]) -> Iterator[list[Stamped]]:
        """Yield new messages, and an empty list every `PERIOD`. Only without `on_messages`.

        Raises:
            StoppedError: It was stopped.
            Exception: Any error of rclpy.
        """
        while self._error is None and self.runtime.usable and not stopped():
            try:
                source = self._inbox.get(timeout=PERIOD)
            except queue.Empty:
                yield []
                continue
            messages = source.take_stamped(self._depth)
            self.runtime.call_soon(partial(self.runtime.enable, source))
            yield messages
        raise self._error or StoppedError("the reading was stopped")

    def close(self) -> None:
        """End the subscriptions."""
        self.runtime.run(self._end)
        self.runtime.join_if_stopping(_JOIN)

    def _look(self) -> None:
        # All readers of one period at the same times: so many of them wake the thread once.
        now = self.runtime.now()
        self._timer = self.runtime.call_at(now - now % self._period + self._period, self._look)
        try:
            infos = self.runtime.node.get_publishers_info_by_topic(self._topic)
            ours = [info.qos_profile for info in infos if info.topic_type == self._type]
            for qos in (*self._at_once, *((one.reliability, one.durability) for one in ours)):
                if qos not in self._sources:
                    self._subscribe(*qos)
            ends = [source.subscription for source in self._sources.values()]
            self.joined = sum(end.get_publisher_count() for end in ends)
            self.other_types = frozenset(info.topic_type for info in infos) - {self._type}
            self.publishers = len(ours)
            self._on_look(self.runtime.node)
        except Exception as error:  # noqa: BLE001  such as after a shutdown (R10): see `arriving`
            self._error = error

    def _subscribe(self, reliability: ReliabilityPolicy, durability: DurabilityPolicy) -> None:
        self.runtime.expect_more()
        self.keeps |= durability == DurabilityPolicy.TRANSIENT_LOCAL
        qos = QoSProfile(depth=self._depth, reliability=reliability, durability=durability)

        def take() -> None:
            if self._on_messages is not None:
                self._on_messages(source.take_stamped(self._depth))
            else:  # `arriving` takes them: 20 MB take 40 ms
                self.runtime.disable(source)
                self._inbox.put(source)

        source = subscribe_raw(self.runtime.node, self._cls, self._topic, qos, take)
        self._sources[reliability, durability] = source
        self.runtime.enable(source)

    def _end(self) -> None:
        if self._timer is not None:
            self.runtime.cancel_timer(self._timer)
        for source in self._sources.values():
            self.runtime.disable(source)
            self.runtime.node.destroy_subscription(source.subscription)
        self.runtime.remove_user(self)


@dataclass(frozen=True)
class Reading:
    """What was read from a topic."""

    message: Any  # the newest one, or `None`
    age: float | None  # seconds since it was published
    publishers: int
    other_types: tuple[str, ...]  # published there besides the type that was asked for


def latest(
    domain_id: int | None,
    topic: str,
    ros_type: str,
    cls: Any,
    timeout: float,
    max_age: float | None,
    stopped: Callable[[], bool],
) -> Reading:
    """Return the newest message that is not older than `max_age`. Errors: see `arriving`."""
    newest: Stamped | None = None
    ends = time.monotonic() + timeout
    with closing(TopicReader(domain_id, topic, ros_type, cls)) as reader:
        for messages in reader.arriving(stopped):
            now = time.time_ns()
            for stamp, message in messages:
                at = stamp or now
                if max_age is None or now - at <= max_age * 1e9:
                    if newest is None or at > newest[0]:
                        newest = at, message
                    ends = min(ends, time.monotonic() + SETTLE * reader.keeps)
            if time.monotonic() >= ends:
                break
    others = tuple(sorted(reader.other_types))
    if newest is None:
        return Reading(None, None, reader.publishers, others)
    age = max(0.0, (time.time_ns() - newest[0]) / 1e9)
    return Reading(deserialize_message(newest[1], cls), age, reader.publishers, others)
