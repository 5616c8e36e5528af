"""Whether a human has stopped the robot, as a `Toolbox` asks before it sends anything."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from actionkit._internal_api import log_own_error
from actionkit.agents._tool_calls.changes import Changes

if TYPE_CHECKING:
    from actionkit._ros.holds.state import Hold


class HoldListener:
    """Listens for holds in a ROS domain, and tells other listeners of those that it knows.

    So a hold lives as long as one listener does, or the process that `actionkit stop` leaves, or a
    file on the same computer. All methods may be called from any thread.
    """

    def __init__(
        self, domain_id: int | None = None, on_hold: Callable[[str], object] = lambda _: None
    ) -> None:
        """Begin to listen. Returns as soon as rclpy is imported.

        Args:
            domain_id: The ROS domain; `None` takes the environment's.
            on_hold: Called once for each hold, with the sentence of `why_held`. On the listener's
                thread, which it must not block.

        Raises:
            ImportError: rclpy is not there.
        """
        from actionkit._ros.holds.view import HoldView

        self._on_hold = on_hold
        self._closed = False
        self._changes = Changes()
        self._told: frozenset[str] = frozenset()
        self._view = HoldView(domain_id, "agent", speaks=True, on_change=self._on_change)
        self._view.start()

    def close(self) -> None:
        """Listen no more, and tell nobody any more; takes up to some seconds. May be repeated."""
        self._closed = True
        self._view.close()
        self._changes.tell()

    def why_held(self) -> str | None:
        """Return why nothing may be sent, as a sentence; `None` only if that is known to be free.

        Takes well under a millisecond, and raises nothing.
        """
        holds, unknown = self._known()
        if holds:
            return _sentence(holds)
        return unknown and (
            "It is not known yet whether a human has stopped the robot, so nothing is sent to it"
            f" ({unknown})."
        )

    @property
    def surely_free(self) -> bool:
        """Whether it was known at most a second ago that nobody has stopped the robot.

        For ActionKit's own threads: it takes no lock and reads no file.
        """
        return not self._closed and self._view.surely_free

    @property
    def is_known(self) -> bool:
        """Whether it is known that a human has stopped the robot, or that nobody has."""
        holds, unknown = self._known()
        return bool(holds) or unknown is None

    async def until_known(self, timeout: float) -> bool:
        """Wait until `is_known`, which takes four seconds after the start, or until `close`.

        Args:
            timeout: Seconds.

        Returns:
            Whether it is known.
        """
        await self._changes.until(lambda: self.is_known or self._closed, timeout)
        return self.is_known

    def _known(self) -> tuple[Sequence[Hold], str | None]:
        """Return the holds, and why there may be more."""
        if self._closed:
            return (), "its listener is closed"
        try:
            state, unknown = self._view.known()
        except Exception as error:  # noqa: BLE001  after any error nothing is known
            return (), f"{type(error).__name__}: {error}"
        return state.active, unknown or None

    def _on_change(self) -> None:
        holds = self._view.state.active
        now = frozenset(hold.hold_id for hold in holds)
        new, self._told = now - self._told, now
        if new:
            try:
                self._on_hold(_sentence(holds))
            except Exception:  # noqa: BLE001  the waiting calls must be woken
                log_own_error()
        self._changes.tell()


def _sentence(holds: Sequence[Hold]) -> str:
    """Return who has stopped the robot."""
    from actionkit._ros.holds.words import who

    return (
        f"A human has stopped the robot: {who(holds)}. Nothing is sent to it until a human ends"
        " that by `actionkit stop --release`."
    )
