"""The carriers of one client: that of new calls, and earlier ones that still have goals."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator

from actionkit._calls.carrier import PortCarrier
from actionkit._model.errors import ClientClosedError
from actionkit._ros.port import Port

_OPENING_TIMEOUT = 2.0
"""Seconds to wait for another thread that opens a port, which takes tenths; a second port does no
harm."""


class Carriers:
    """One carrier after the other, each on a port of its own. Any thread may use it."""

    def __init__(
        self, open_port: Callable[[], Port], on_freed: Callable[[], None], *, abandon: bool
    ) -> None:
        """Open the first port.

        Args:
            open_port: Opens a port; called again when a port became unusable.
            on_freed: Called on the communication thread each time a port was freed.
            abandon: What closing does to goals in flight: whether they are left to run.
        """
        self._open_port = open_port
        self._on_freed = on_freed
        self._abandon = abandon
        self._opening = threading.RLock()
        """Held while a port is opened in place of another: threads that come together share it.

        The communication thread never waits for it, and other threads for a limited time.
        """
        self._all = [self._new()]

    def __iter__(self) -> Iterator[PortCarrier]:
        return iter(list(self._all))

    def current(self) -> PortCarrier:
        """Return the carrier for new calls.

        Raises:
            ClientClosedError: The user's ROS context was shut down.
        """
        carrier = self._all[-1]
        if carrier.port.usable and not carrier.port.why_shut_down():
            return carrier
        acquired = self._opening.acquire(timeout=_OPENING_TIMEOUT)
        try:
            return self._reopened()
        finally:
            if acquired:
                self._opening.release()

    def _reopened(self) -> PortCarrier:
        carrier = self._all[-1]
        if (why := carrier.port.why_shut_down()) and not carrier.port.is_up_again():
            # A program that was told to end starts no goals.
            again = "call rclpy.try_shutdown() and rclpy.init(), or "
            remedy = "" if carrier.port.has_node else again
            raise ClientClosedError(
                f"the client of action {carrier.action_name!r} takes no more calls, because"
                f" {why}: {remedy}make a new client",
                action_name=carrier.action_name,
            )
        if not carrier.port.usable:
            # The context was shut down (R10), or the communication thread died (R8). What is left
            # of calls stays on the old port; new ones go over the new one.
            carrier.call_soon(carrier.release)
            carrier = self._new()
            self._all.append(carrier)
            for old in self:
                if old is not carrier and old.port.freed.is_set():
                    with contextlib.suppress(ValueError):  # others do the same
                        self._all.remove(old)
        return carrier

    def _new(self) -> PortCarrier:
        return PortCarrier(self._open_port(), self._on_freed, abandon=self._abandon)
