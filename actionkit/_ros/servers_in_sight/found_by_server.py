"""Detects that a server has discovered our endpoints, before it gets any request.

A server discovers a process's subscriptions and response readers in the order in which they are
made. So one more subscription, to the action's status, is made last. A server sends its latest
status to each new subscription: when it comes, the server has discovered all the others, too. A
server that has had no goal yet has no status to send.
"""

from __future__ import annotations

from collections.abc import Callable

from rclpy.exceptions import InvalidHandle

from actionkit._ros.communication.runtime import Runtime
from actionkit._ros.endpoints.entities import Entities
from actionkit._ros.rclpy_private.native import RCLError
from actionkit._ros.rclpy_private.wait_set import MessageSource


class FoundByServer:
    """Waits for the status message that proves this. On the communication thread only."""

    def __init__(self, runtime: Runtime, entities: Entities, on_known: Callable[[], None]) -> None:
        """Do nothing until `watch` is called.

        `entities` makes the subscription, and has made all others. `on_known` is called once for
        each `watch`, when a status message has come.
        """
        self._runtime = runtime
        self._entities = entities
        self._on_known = on_known
        self._source: MessageSource | None = None

    def watch(self) -> None:
        """Subscribe, until a message has come or `stop` is called."""
        self.stop()
        try:
            self._source = self._entities.subscribe_status(self._take)
        except (RCLError, InvalidHandle):
            return  # the context was shut down: nothing new can be made in it (R10)
        self._runtime.enable(self._source)

    def stop(self) -> None:
        """Destroy the subscription, if there is one."""
        if self._source is not None:
            self._runtime.disable(self._source)
            self._entities.unsubscribe_status(self._source)
            self._source = None

    def _take(self) -> None:
        self.stop()
        self._on_known()
