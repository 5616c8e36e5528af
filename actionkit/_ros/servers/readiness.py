"""Whether servers of an action are there, without polling for them.

The servers' feedback publishers are watched through the `matched` event of a subscription
(R27). That a publisher is there does not mean that goals arrive: a server discovers a
client's endpoints one by one, and a goal that comes before it knows the way back is run, and
its acknowledgement lost (R4). So a harmless question is sent first: to cancel a goal that
cannot exist. Its answer comes through the endpoint that was made last, so that whoever can
answer knows all the others too.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum, auto

from actionkit._ros.graph import ServerInfo
from actionkit._threads.clock import Timers

_FIRST_STEP = 0.001
_SETTLING_STEP = 0.25
_SETTLING = 10.0
_LAST_STEP = 1.0
_PATIENCE = 0.5
"""Seconds after which a server that answers nothing is taken for busy, not for deaf (C5.5)."""
_PATIENCE_WITH_SEVERAL = 5.0
_GRAPH_PERIOD = 1.0
_NAMED_WITHIN = 10.0
"""Seconds until the graph shows a server of which there was an event; it takes milliseconds."""


UNNAMED = frozenset({b"unnamed"})
"""Stands for a server that is there, and that the graph does not show yet."""


class State(Enum):
    """What is known of the servers."""

    ABSENT = auto()
    SETTLING = auto()
    READY = auto()


class ServerReadiness:
    """Follows the servers of one action on behalf of one link. On its thread only."""

    def __init__(
        self,
        timers: Timers,
        *,
        list_servers: Callable[[], list[ServerInfo] | None],
        services_ready: Callable[[], bool],
        probe: Callable[[], object],
        on_ready: Callable[[], None],
        on_change: Callable[[frozenset[bytes], frozenset[bytes]], None],
        on_mismatch: Callable[[tuple[str, ...]], None],
        action_type: str,
    ) -> None:
        """Know of no server so far.

        Args:
            timers: The clock and timers of the thread.
            list_servers: The servers that the graph shows, of any type; `None` where the
                graph cannot be asked.
            services_ready: Whether the endpoints of the action's services are matched.
            probe: Sends the harmless question; the answer is to be told by `answered`.
            on_ready: Called when goals can be sent, again for each new server.
            on_change: Called with the ids of servers that have come, and of those that are gone.
            on_mismatch: Called with the types served while somebody waits in vain.
            action_type: The type that this side speaks.
        """
        self.state = State.ABSENT
        self.servers: frozenset[bytes] = frozenset()
        self._timers = timers
        self._list_servers = list_servers
        self._services_ready = services_ready
        self._probe = probe
        self._on_ready = on_ready
        self._on_change = on_change
        self._on_mismatch = on_mismatch
        self._action_type = action_type
        self._count = 0
        self._awaited: frozenset[bytes] = frozenset()
        """The servers that the graph shows while it does not show one that has come."""
        self._awaited_until = 0.0
        self._settling_since = 0.0
        self._closed = False
        self._looking = False

    @property
    def ready(self) -> bool:
        """Whether goals can be sent."""
        return self.state is State.READY

    @property
    def count(self) -> int:
        """How many servers are matched; more than one after a restart, too (R14)."""
        return self._count

    def matched(self, count: int, came: int = 0) -> None:
        """The middleware sees `count` feedback publishers now.

        Args:
            count: How many.
            came: How many of them it did not see before, where that is known.
        """
        self._count = count
        if count == 0:
            self.state = State.ABSENT
        before = self.servers
        self._awaited = frozenset()
        self._compare()
        # One that had no name so far may be among those that have one now.
        expected = came + len(before & UNNAMED)
        if count and expected > len(self.servers - before - UNNAMED):
            # One came in the place of one that went, and the graph still shows that one. What is
            # sent now goes to the new one, and is not lost with the old.
            self._awaited = self.servers - UNNAMED
            self._awaited_until = self._timers.now() + _NAMED_WITHIN
            self._compare()
            if self.state is State.READY:
                self._begin_settling()
        if count > 0 and self.state is State.ABSENT:
            self._begin_settling()
        if not self._agrees:
            self._compare_later(_FIRST_STEP)

    @property
    def _agrees(self) -> bool:
        """Whether the graph shows whom the middleware's event told of."""
        return len(self.servers) == self._count and not self.servers & UNNAMED

    def answered(self) -> None:
        """The harmless question was answered."""
        if self.state is State.SETTLING:
            self._become_ready()

    def look(self, wanted: Callable[[], bool]) -> None:
        """Compare the types served with ours, now and once a second while `wanted()` (R21)."""
        if not self._looking:
            self._looking = True
            self._look(wanted)

    def close(self) -> None:
        """Tell nothing any more."""
        self._closed = True

    def _look(self, wanted: Callable[[], bool]) -> None:
        if self._closed or self.state is not State.ABSENT or not wanted():
            self._looking = False
            return
        types = {server.action_type for server in self._list_servers() or ()}
        if types and self._action_type not in types:
            self._on_mismatch(tuple(sorted(types)))
        self._timers.call_at(self._timers.now() + _GRAPH_PERIOD, lambda: self._look(wanted))

    def _begin_settling(self) -> None:
        self.state = State.SETTLING
        self._settling_since = self._timers.now()
        self._settle(_FIRST_STEP)

    def _compare(self) -> None:
        """Compare the servers there are with those there were."""
        before, self.servers = self.servers, self._present()
        new = self.servers - before - UNNAMED
        # A server that got its name only now is the one that had none.
        named = UNNAMED & before - self.servers if new else frozenset()
        if self.state is State.READY and len(new) > len(named):
            self._begin_settling()  # a new one does not know us yet (R4)
        if self.servers != before:
            gone = before - self.servers
            # One that got its name is there under it.
            self._on_change(self.servers - before, gone - UNNAMED if self.servers else gone)

    def _compare_later(self, step: float) -> None:
        """The event is ahead of the graph: look again until they agree, less and less often."""

        def compare() -> None:
            if self._closed or self._agrees:
                return
            self._compare()
            self._compare_later(min(2 * step, _LAST_STEP))

        self._timers.call_at(self._timers.now() + step, compare)

    def _present(self) -> frozenset[bytes]:
        if self._count == 0:
            return frozenset()
        listed = self._list_servers()
        gids = frozenset(
            server.gid for server in listed or () if server.action_type == self._action_type
        )
        if not gids:
            # The event may be ahead of the graph, and a context that was shut down has none: a
            # server that cannot be named is still a server.
            return self.servers or UNNAMED
        if self._awaited:
            if gids <= self._awaited and self._timers.now() < self._awaited_until:
                return gids | UNNAMED
            self._awaited = frozenset()
        return gids | UNNAMED if len(gids) < self._count else gids

    def _settle(self, step: float) -> None:
        if self._closed or self.state is not State.SETTLING:
            return
        now = self._timers.now()
        if self._services_ready():
            # After a restart it is the dead server's endpoints that are matched; those of the
            # new one have been seen to take 4 s.
            patience = _PATIENCE if self._count == 1 else _PATIENCE_WITH_SEVERAL
            if now - self._settling_since >= patience:
                self._become_ready()
                return
            self._probe()
        # Asked quickly at first, and then no oftener than the graph is looked at (C7.4).
        slowest = _SETTLING_STEP if now - self._settling_since < _SETTLING else _LAST_STEP
        self._timers.call_at(now + step, lambda: self._settle(min(2 * step, slowest)))

    def _become_ready(self) -> None:
        self.state = State.READY
        self._on_ready()
