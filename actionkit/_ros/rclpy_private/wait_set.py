"""Waits for chosen entities, with private parts of rclpy (as `executors` does).

In each turn, rclpy's executors build their wait set again from all entities of the node, and wrap
each event in a task. They end for ever when a user's callback raises (R8), or when rclpy's signal
handler shuts the context down (R10). Here, the wait set has only the entities to wait for. Waiting
also works in a context that was shut down, so a cancel request can be sent after Ctrl-C. Tested
with rclpy 7.1.x; its own executor uses `WaitSet`, `handle.send_request`, `handle.take_response` and
`handle.take_message`, too.
"""

from __future__ import annotations

import contextlib
import operator
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from itertools import islice
from typing import Any, TypeVar

from rclpy.callback_groups import CallbackGroup, ReentrantCallbackGroup
from rclpy.client import Client as ServiceClient
from rclpy.context import Context
from rclpy.event_handler import EventHandler, SubscriptionEventCallbacks
from rclpy.exceptions import InvalidHandle
from rclpy.guard_condition import GuardCondition
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerGuardCondition
from rclpy.subscription import Subscription

from actionkit._ros.rclpy_private.native import RCLError

_FOREVER = -1
"""The timeout of a wait without a limit."""
_LONGEST = 1e9
"""Seconds (31 years); the middleware's 64 bits of nanoseconds hold nine times as many."""
MOST_AT_ONCE = 64
"""Messages read from one entity in a row (about a millisecond); then others get their turn."""
SOURCES_OF_A_CLIENT = 7
"""The maximum: three services, feedback and its event, the status, that of `found_by_server`."""

_T = TypeVar("_T")
_call = operator.methodcaller("__call__")


class Source:
    """An entity to wait for, and what to call when there is something to read."""

    kind: str

    def __init__(self, on_readable: Callable[[], None]) -> None:
        self.on_readable = on_readable

    def add_to(self, wait_set: Any) -> int:
        """Add this entity to the wait set and return its index there."""
        raise NotImplementedError


class ResponseSource(Source):
    """The responses to a service client."""

    kind = "client"

    def __init__(self, client: ServiceClient, on_response: Callable[[int, Any], None]) -> None:
        super().__init__(self.take)
        self._on_response = on_response
        self._latest = 0
        self.use(client)

    def use(self, client: ServiceClient) -> None:
        """Switch to another service client."""
        self._before = self._latest  # rclpy's numbers start at 1 again, ours continue
        self._handle = client.handle
        self._type = client.srv_type.Response

    def add_to(self, wait_set: Any) -> int:
        return int(wait_set.add_client(self._handle))

    def send(self, request: Any) -> int:
        """Send a request; return the sequence number that its response will carry."""
        self._latest = self._before + int(self._handle.send_request(request))
        return self._latest

    def take(self) -> None:
        """Read what has come, without waiting, and pass it on."""
        for _ in range(MOST_AT_ONCE):
            header, response = self._handle.take_response(self._type)
            if header is None:
                return
            self._on_response(self._before + header.request_id.sequence_number, response)


class MessageSource(Source):
    """The messages of a raw subscription, as bytes."""

    kind = "subscription"

    def __init__(self, subscription: Subscription, on_readable: Callable[[], None]) -> None:
        super().__init__(on_readable)
        self.use(subscription)

    def use(self, subscription: Subscription) -> None:
        """Switch to another subscription."""
        self.subscription = subscription
        self._handle = subscription.handle

    def add_to(self, wait_set: Any) -> int:
        return int(wait_set.add_subscription(self._handle))

    def take(self) -> list[bytes]:
        """Return messages that have come, without waiting; a limited number at a time."""
        messages: list[bytes] = []
        while len(messages) < MOST_AT_ONCE:
            taken = self._handle.take_message(None, True)
            if taken is None:
                break
            messages.append(taken[0])
        return messages

    def take_stamped(self, most: int) -> list[tuple[int, bytes]]:
        """Take messages, each with the nanoseconds when it was published. From any thread."""
        with self._handle:  # so that it is not destroyed meanwhile
            come = iter(lambda: self._handle.take_message(None, True), None)
            return [(info["source_timestamp"], message) for message, info in islice(come, most)]

    def discard(self) -> None:
        """Ignore all messages that have come."""
        while self._handle.take_message(None, True) is not None:
            pass


def subscribe_raw(
    node: Node, cls: Any, topic: str, qos: QoSProfile, on_readable: Callable[[], None]
) -> MessageSource:
    """Subscribe to a topic. Its messages are not decoded."""
    quiet = SubscriptionEventCallbacks(use_default_callbacks=False)
    made = node.create_subscription(
        cls,
        topic,
        unused,
        qos,
        callback_group=own_group(),
        raw=True,
        event_callbacks=quiet,
    )
    return MessageSource(made, on_readable)


def own_group() -> CallbackGroup:
    """Return a callback group for one entity, to be dropped together with it.

    The node's own group keeps a weak reference to each entity for as long as the node lives.
    """
    return ReentrantCallbackGroup()


def unused(_: Any) -> None:
    """Do nothing. rclpy needs a callback, but nothing calls it: the sources take messages."""


class EventSource(Source):
    """A middleware event of a subscription; `take` works at any time."""

    kind = "event"

    def __init__(self, handler: EventHandler, on_event: Callable[[Any], None]) -> None:
        super().__init__(self.take)
        self._on_event = on_event
        self.use(handler)

    def use(self, handler: EventHandler) -> None:
        """Switch to another event handler."""
        self._handler = handler

    def add_to(self, wait_set: Any) -> int:
        self._handler.add_to_wait_set(wait_set)
        return -1

    def is_ready(self, wait_set: Any) -> bool:
        """Whether the event had come at the last wait."""
        return bool(self._handler.is_ready(wait_set))

    def take(self) -> None:
        """Read what has come, without waiting, and pass it on."""
        event = self._handler.take_data()
        if event is not None:
            self._on_event(event)


class Waiter:
    """Waits for the sources that it is given, for `wake` and for rclpy's signal handler."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._guard = GuardCondition(None, None, context=context)
        self._guard_handle = self._guard.handle
        self._signal_guard = SignalHandlerGuardCondition(context)
        self._signal_handle = self._signal_guard.handle
        self.signalled = False
        """Whether rclpy's signal handler has run during the last wait."""
        self.room = -1
        """How many sources of each kind fit into the wait set."""
        self._wait_set: Any = None

    def wake(self) -> None:
        """Make the current or next wait return at once. From any thread."""
        with contextlib.suppress(InvalidHandle):  # the thread has ended
            self._guard.trigger()

    def wake_with(self, inbox: deque[_T], item: _T) -> None:
        """Append to the inbox and `wake`, with no signal handler between the two.

        A handler runs between two bytecodes. If it ran between these two steps, it could wait for
        ever: the item is in the inbox, but the thread sleeps. So one call into C does both.
        """
        trigger = self._guard_handle.trigger_guard_condition
        with contextlib.suppress(InvalidHandle, RCLError):  # as above
            deque(map(_call, (partial(inbox.append, item), trigger)), maxlen=0)

    def wait(self, sources: Sequence[Source], timeout: float | None) -> list[Source]:
        """Wait for a source, `wake` or the end of the time; return the sources that are ready.

        The timeout is in seconds; `None` means no limit.
        """
        if len(sources) > self.room:
            self.make_room(len(sources))
        wait_set = self._wait_set
        wait_set.clear_entities()
        wait_set.add_guard_condition(self._guard_handle)
        signalled = wait_set.add_guard_condition(self._signal_handle)
        indices = [source.add_to(wait_set) for source in sources]
        wait_set.wait(_FOREVER if timeout is None else max(0, int(min(timeout, _LONGEST) * 1e9)))
        self.signalled = bool(wait_set.is_ready("guard_condition", signalled))
        return [
            source
            for source, index in zip(sources, indices, strict=True)
            if (
                source.is_ready(wait_set)
                if isinstance(source, EventSource)
                else wait_set.is_ready(source.kind, index)
            )
        ]

    def make_room(self, sources: int) -> None:
        """Make room for this many sources before they are needed.

        In a context that was shut down, no wait set can be made, and then a cancel after Ctrl-C
        adds a source (R10). Making a wait set also takes more time than waiting on one with free
        places.

        Raises:
            RCLError: The context was shut down.
        """
        # Subscriptions, guard conditions, timers, clients, services, events.
        made = rclpy_implementation.WaitSet(
            sources, 2, 0, sources, 0, sources, self._context.handle
        )
        self._release_wait_set()
        self._wait_set, self.room = made, sources

    def _release_wait_set(self) -> None:
        if self._wait_set is not None:
            self._wait_set.destroy_when_not_in_use()
            self._wait_set = None

    def destroy(self) -> None:
        """Free the wait set and the guard conditions."""
        self._release_wait_set()
        self._guard.destroy()
        self._signal_guard.destroy()
