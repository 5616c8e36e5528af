"""Notices that a server is dead before the middleware does (`Timeouts.liveness`, opt-in).

The middleware needs about 20 s to notice a killed process. A server that answers requests while it
executes goals can be probed. But a server that is busy in its only thread does not answer, like a
dead one. So with such servers, this must stay off (C5.5).
"""

from __future__ import annotations

from collections.abc import Callable

from actionkit._threads.clock import Timers

_PROBES_PER_LIMIT = 3
"""So two probes in a row may get lost before a server counts as dead."""
_LONGEST_PAUSE = 5.0
"""Seconds between two probes at most, so that a server that is back is noticed soon."""


class Liveness:
    """Waits for signs of life while goals are in flight. On the communication thread only."""

    def __init__(
        self,
        timers: Timers,
        *,
        probe: Callable[[], object],
        wanted: Callable[[], bool],
        on_silence: Callable[[float], None],
        on_return: Callable[[], None],
    ) -> None:
        """Do nothing until `start` is called.

        Args:
            probe: Sends a question that every live server answers.
            wanted: Whether goals are in flight. If not, this stops until the next `start`.
            on_silence: Called with the limit when nothing was heard for that many seconds, and
                again if a goal is sent in that silence.
            on_return: Called when something is heard after that.
        """
        self._timers = timers
        self._probe = probe
        self._wanted = wanted
        self._on_silence = on_silence
        self._on_return = on_return
        self._limit: float | None = None
        self.heard_at = 0.0
        """When something last came from a server, or when we began to wait for that."""
        self.has_heard = False
        """Whether anything ever came from a server."""
        self._silent = False
        self._silent_from = 0.0
        """From when the silence counts."""
        self._told = False
        """Whether `on_silence` was called for all goals in flight."""

    def start(self, limit: float) -> None:
        """Probe the server until no goal is in flight. Called for each goal that is sent.

        It counts as dead after `limit` seconds of silence. The smallest limit counts. For
        goals that are sent to a silent server, the seconds count from the first of them.
        """
        if self._limit is not None:
            self._limit = min(limit, self._limit)
            if self._told:
                self._silent_from, self._told = self._timers.now(), False
            return
        self._limit = limit
        self.start_over()
        self._check()

    def heard(self) -> None:
        """Note that something came from a server."""
        self.has_heard = True
        self.start_over()
        if self._silent:
            self._silent = self._told = False
            self._on_return()

    def start_over(self) -> None:
        """Count the silence from now on, because this process itself did not listen before."""
        self.heard_at = self._silent_from = self._timers.now()

    def _check(self) -> None:
        if not self._wanted() or self._limit is None:
            self._silent = self._told = False
            self._limit = None
            return
        now = self._timers.now()
        if not self._told and now - self._silent_from >= self._limit:
            self._silent = self._told = True
            self._on_silence(self._limit)
        self._probe()
        self._timers.call_at(
            now + min(self._limit / _PROBES_PER_LIMIT, _LONGEST_PAUSE), self._check
        )
