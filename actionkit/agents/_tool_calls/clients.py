"""What a toolbox needs of ROS: a client for each tool, the human's stop, readers of topics."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from concurrent.futures import Future, wait
from functools import partial
from typing import Any, TypeVar

from actionkit import Client, RetryPolicy
from actionkit._internal_api import client_in_domain, close_together, end_at_exit, in_thread
from actionkit._model.environment.domain import environment_domain
from actionkit.agents._configuration.config import ActionConfig
from actionkit.agents._tool_calls.goals import Goals
from actionkit.agents._tool_calls.hold import HoldListener

_T = TypeVar("_T")
_STOPPED_WITHIN = 5.0
"""Seconds to wait until nothing is read any more; it takes some ten milliseconds."""
_log = logging.getLogger("actionkit")


class Clients:
    """Makes each client when it is first needed; closes all together.

    All methods except `read` may block, and may be called from any thread.

    Attributes:
        closed: Whether `close` was called.
        on_hold: Called when a human stops the robot.
    """

    def __init__(self, domain_id: int | None, goals: Goals) -> None:
        self.closed = False
        self.on_hold: Callable[[str], object] = lambda why: None
        self._domain_id = domain_id
        self._goals = goals
        self._hold: HoldListener | None = None
        self._clients: dict[str, Client[Any]] = {}
        self._readings: set[Future[None]] = set()
        self._lock = threading.Lock()

    @property
    def listening(self) -> HoldListener | None:
        """The listener for a human's stop; `None` before `hold` was called. Never blocks."""
        return self._hold

    def hold(self) -> HoldListener:
        """Return the listener for a human's stop; start it if there is none.

        Raises:
            ImportError: rclpy is not there.
            RuntimeError: The toolbox was closed.
        """
        with self._lock:
            self._check()
            if self._hold is None:
                hold = HoldListener(self._domain(), self.on_hold)
                end_at_exit()
                self._hold = hold
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
                    self._domain(),
                    tool.cls,
                    tool.action,
                    retry=RetryPolicy(attempts=tool.retries + 1),
                    observers=[self._goals],
                )
            return client

    async def read(self, read: Callable[[int | None, Callable[[], bool]], _T]) -> _T:
        """Call a function that reads a topic; from the event loop.

        It gets the domain, and a function that returns whether to stop: the awaiting task was
        cancelled, or the toolbox was closed.
        """
        given_up = threading.Event()
        ended: Future[None] = Future()

        def call() -> _T:
            self._readings.add(ended)  # not before: a thread may not be there
            try:
                self.hold()  # also keeps the node, which has found the publishers by then
                return read(self._domain(), lambda: self.closed or given_up.is_set())
            finally:
                ended.set_result(None)
                self._readings.discard(ended)

        try:
            return await in_thread(call)
        finally:
            given_up.set()

    def _domain(self) -> int:
        """Return the domain: the first one is kept, even if the environment changes."""
        if self._domain_id is None:
            self._domain_id = environment_domain()
        return self._domain_id

    def _check(self) -> None:
        if self.closed:
            raise RuntimeError("the toolbox was closed")

    def close(self) -> None:
        """Cancel all goals in flight, wait for the confirmations, and free everything."""
        with self._lock:
            self.closed = True
            clients, self._clients = self._clients.values(), {}
            hold, self._hold = self._hold, None
            readings = list(self._readings)
        stopped = partial(wait, readings, _STOPPED_WITHIN)
        closing: list[Callable[[], object]] = [partial(close_together, clients), stopped]
        if hold is not None:
            closing.insert(1, hold.close)
        for close in closing:
            try:
                close()
            except Exception:  # noqa: BLE001  the others are closed all the same
                _log.exception("the toolbox could not be closed")
