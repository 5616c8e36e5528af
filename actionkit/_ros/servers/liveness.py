"""Asking a server now and then whether it is there (`Timeouts.liveness`, opt-in).

The middleware needs about 20 s to notice a killed process. A server that answers while it
executes can be asked instead, by the action protocol itself. One that is busy in its only
thread answers as little as a dead one: for such servers this must stay off (C5.5).
"""

from __future__ import annotations

from collections.abc import Callable

from actionkit._threads.clock import Timers

_SLOWEST = 5.0


class Liveness:
    """Watches for any sign of a server while goals are in flight. On its thread only."""

    def __init__(
        self,
        timers: Timers,
        *,
        probe: Callable[[], object],
        wanted: Callable[[], bool],
        on_silence: Callable[[float], None],
        on_return: Callable[[], None],
    ) -> None:
        """Be off.

        Args:
            timers: The clock and timers of the thread.
            probe: Asks the harmless question.
            wanted: Whether goals are in flight.
            on_silence: Called with the limit when nothing was heard for so many seconds.
            on_return: Called when something is heard after that.
        """
        self._timers = timers
        self._probe = probe
        self._wanted = wanted
        self._on_silence = on_silence
        self._on_return = on_return
        self._limit: float | None = None
        self._heard = 0.0
        self._silent = False
        self._ticking = False

    def start(self, limit: float) -> None:
        """Begin to watch; `limit` is in seconds."""
        self._limit = limit if self._limit is None else min(limit, self._limit)
        if not self._ticking:
            self._ticking = True
            self._heard = self._timers.now()
            self._tick()

    def heard(self) -> None:
        """Something came from a server."""
        self._heard = self._timers.now()
        if self._silent:
            self._silent = False
            self._on_return()

    def _tick(self) -> None:
        if not self._wanted() or self._limit is None:
            self._ticking = self._silent = False
            self._limit = None
            return
        now = self._timers.now()
        if not self._silent and now - self._heard >= self._limit:
            self._silent = True
            self._on_silence(self._limit)
        self._probe()
        self._timers.call_at(now + min(self._limit / 3, _SLOWEST), self._tick)
