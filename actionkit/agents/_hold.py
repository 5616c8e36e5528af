"""Whether a human has stopped the robot, as a `Toolbox` asks before it sends anything."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as _FutureTimeout
from typing import TYPE_CHECKING

from actionkit._internal_api import log_own_error

if TYPE_CHECKING:
    from actionkit._ros.holds.state import HoldState
    from actionkit._ros.holds.view import HoldView

RELEASE = "`actionkit stop --release`"


class HoldListener:
    """Listens for holds in a ROS domain, and tells other listeners of those that it knows.

    So a hold lives as long as one listener does, or the process that `actionkit stop` leaves, or a
    file on the same computer. All methods may be called from any thread.
    """

    def __init__(self, domain_id: int | None = None) -> None:
        """Take what is needed; nothing is imported or begun yet.

        Args:
            domain_id: The ROS domain; `None` takes the environment's.
        """
        self._domain_id = domain_id
        self._view: HoldView | None = None
        self._closed = False
        self._callbacks: list[Callable[[str], object]] = []
        self._waiting: list[Future[None]] = []
        self._told: frozenset[str] = frozenset()

    def start(self) -> None:
        """Begin to listen. Returns as soon as rclpy is imported.

        Raises:
            ImportError: rclpy is not there.
        """
        from actionkit._ros.holds.view import HoldView

        if self._view is None and not self._closed:
            self._view = HoldView(self._domain_id, "agent", speaks=True, on_change=self._on_change)
            self._view.start()

    def close(self) -> None:
        """Listen no more, and tell nobody any more; takes up to some seconds. May be repeated."""
        self._closed = True
        if self._view is not None:
            self._view.close()
        self._wake()

    def why_held(self) -> str | None:
        """Return why nothing may be sent, as a sentence; `None` only if that is known to be free.

        Takes well under a millisecond, and raises nothing.
        """
        if self._closed:
            return _not_known("its listener is closed")
        if self._view is None:
            return _not_known("its listener was not started")
        try:
            state, unknown = self._view.known()
            return why(state) or (_not_known(unknown) if unknown else None)
        except Exception as error:  # noqa: BLE001  after any error nothing is known
            return _not_known(f"{type(error).__name__}: {error}")

    @property
    def is_known(self) -> bool:
        """Whether it is known that a human has stopped the robot, or that nobody has."""
        if self._view is None or self._closed:
            return False
        state, unknown = self._view.known()
        return bool(state.active) or not unknown

    def on_hold(self, callback: Callable[[str], object]) -> None:
        """Have `callback` called with the sentence of `why_held` when a human stops the robot.

        Args:
            callback: Called once for each hold, on the listener's thread, which it must not block.
        """
        self._callbacks.append(callback)

    def wait_until_known(self, timeout: float) -> bool:
        """Wait until `is_known`, which takes four seconds after the start, or until `close`.

        Args:
            timeout: Seconds.

        Returns:
            Whether it is known.
        """
        until = time.monotonic() + timeout
        while not self.is_known and not self._closed:
            future = self._next_change()
            left = until - time.monotonic()
            if left <= 0:
                break
            with contextlib.suppress(TimeoutError, _FutureTimeout):
                future.result(left)
        return self.is_known

    async def until_known(self, timeout: float) -> bool:
        """Do the same in a coroutine under asyncio."""
        until = time.monotonic() + timeout
        while not self.is_known and not self._closed:
            future = self._next_change()
            left = until - time.monotonic()
            if left <= 0:
                break
            await asyncio.wait([asyncio.wrap_future(future)], timeout=left)
        return self.is_known

    def _next_change(self) -> Future[None]:
        future: Future[None] = Future()
        self._waiting = [old for old in self._waiting if not old.done()]
        self._waiting.append(future)
        if self._closed or self.is_known:  # since the caller looked
            self._wake()
        return future

    def _wake(self) -> None:
        waiting, self._waiting = self._waiting, []
        for future in waiting:
            if future.set_running_or_notify_cancel():
                future.set_result(None)

    def _on_change(self) -> None:
        if self._view is None:
            return
        state = self._view.state
        now = frozenset(hold.hold_id for hold in state.active)
        new, self._told = now - self._told, now
        sentence = why(state)
        if new and sentence is not None:
            for callback in list(self._callbacks):
                try:
                    callback(sentence)
                except Exception:  # noqa: BLE001  the others have to be told
                    log_own_error()
        if self.is_known:
            self._wake()


def why(state: HoldState) -> str | None:
    """Return who has stopped the robot, as a sentence; `None` where nobody has."""
    from actionkit._ros.holds.words import who

    if not state.active:
        return None
    return (
        f"A human has stopped the robot: {who(state.active)}. Nothing is sent to it until a human"
        f" ends that by {RELEASE}."
    )


def _not_known(reason: str) -> str:
    return (
        "It is not known yet whether a human has stopped the robot, so nothing is sent to it"
        f" ({reason})."
    )
