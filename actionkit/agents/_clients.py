"""What a toolbox holds of ROS: its node, a client for each tool, and the human's stop."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from functools import partial
from typing import Any

from actionkit import Client, RetryPolicy
from actionkit._internal_api import client_in_domain, close_together
from actionkit.agents._config import ActionConfig, Config
from actionkit.agents._goals import Goals
from actionkit.agents._hold import HoldListener
from actionkit.agents._ros import RosNode

_log = logging.getLogger("actionkit")


class Clients:
    """Made when they are needed first, closed together. Its methods block, from any thread.

    Attributes:
        closed: Whether `close` was called.
        node: The toolbox's own node, for its topics.
    """

    def __init__(self, config: Config, domain_id: int | None, goals: Goals) -> None:
        self.closed = False
        self.node = RosNode(domain_id)
        self._domain_id = domain_id
        self._goals = goals
        self._hold: HoldListener | None = None
        self._clients: dict[str, Client[Any]] = {}
        self._lock = threading.Lock()

    @property
    def listening(self) -> HoldListener | None:
        """The human's stop where it is listened to, without blocking."""
        return self._hold

    def hold(self, on_hold: Callable[[str], object]) -> HoldListener:
        """Return the human's stop, listened to from now on.

        Raises:
            ImportError: rclpy is not there.
            RuntimeError: The toolbox was closed.
        """
        with self._lock:
            self._check()
            if self._hold is None:
                self._hold = HoldListener(self._domain_id, on_hold)
                self.node.open()  # so that it has found servers and publishers when it is asked
            return self._hold

    def client(self, tool: ActionConfig) -> Client[Any]:
        """Return the client of a tool.

        Raises:
            ImportError: rclpy is not there.
            RuntimeError: The toolbox was closed.
            ActionTypeMismatchError, ValueError: The action's name or type cannot be used.
        """
        with self._lock:
            self._check()
            client = self._clients.get(tool.name)
            if client is None or client.closed:
                client = self._clients[tool.name] = client_in_domain(
                    self._domain_id,
                    tool.cls,
                    tool.action,
                    retry=RetryPolicy(attempts=tool.retries + 1),
                    observers=[self._goals],
                )
            return client

    def _check(self) -> None:
        if self.closed:
            raise RuntimeError("the toolbox was closed")

    def close(self) -> None:
        """Cancel all goals in flight, wait for the confirmations, and free everything."""
        with self._lock:
            self.closed = True
            clients, self._clients = self._clients.values(), {}
            hold, self._hold = self._hold, None
        closing: list[Callable[[], object]] = [partial(close_together, clients), self.node.close]
        if hold is not None:
            closing.insert(1, hold.close)
        for close in closing:
            try:
                close()
            except Exception:  # noqa: BLE001  the others are closed all the same
                _log.exception("the toolbox could not be closed")
