"""Detects whether servers of an action are there and can answer, without polling.

The `matched` event of a subscription tells of all publishers of feedback (R27). Some are not
servers, as a bag player or a relay: the graph shows that these do not have the services.

A server in sight does not mean that goals arrive. A server discovers a client's endpoints one by
one. If a goal comes before the server has discovered them all, the server executes the goal, but
its answer is lost (R4). So a probe is sent first: a request to cancel a goal that cannot exist. It
uses the endpoint that was made last, so a server that answers it has discovered all the others,
too.

To answer the probe, the server must have discovered our endpoint as well. If not, it waits for that
up to 0.1 s (an rclpy server does nothing else meanwhile); then it prints a warning, and the answer
is lost. So the first probe is sent a moment after the server's services are seen, and the next one
after that wait.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum, auto

from actionkit._ros.endpoints.graph import Endpoint
from actionkit._threads.clock import Timers

_FIRST_STEP = 0.001
"""Seconds between the first two checks of the graph or the services; doubled each time."""
_SETTLING_STEP = 0.25
"""The longest time in seconds between two such checks or two probes."""
_SETTLING = 10.0
"""Seconds in which the services are checked that often; normally they are there by then."""
_LAST_STEP = 1.0
"""Seconds between two checks after that; an idle client must not check more often (C7.4)."""
_HEAD_START = 0.1
"""Seconds that a server has to discover our endpoints before it is probed. rclpy gives it as much:
it checks for a server every 0.25 s, so its first goal is 0.125 s late on average."""
_PROBE_STEP = 0.15
"""Seconds between the first two probes: a server that has not discovered our endpoint holds an
answer for up to 0.1 s. Another probe in that time would only delay it more."""
_PATIENCE = 0.5
"""Seconds after which a server that does not answer counts as busy, and so as ready (C5.5). They
begin when its services are seen; two probes are sent in that time."""
_PATIENCE_WITH_SEVERAL = 5.0
"""The same with several servers. After a restart, the dead server's endpoints are matched; the new
server's endpoints have taken up to 4 s."""
_GRAPH_PERIOD = 1.0
"""Seconds between two checks for servers of another type while a call waits (C7.4)."""
_NAMED_WITHIN = 10.0
"""Seconds until the graph shows a publisher, or its services, after its event; normally
milliseconds."""

UNNAMED = frozenset({b"unnamed"})
"""Stands for a server that is there, but that the graph does not show yet."""


class State(Enum):
    """Whether goals can be sent."""

    ABSENT = auto()
    """No server is there."""
    SETTLING = auto()
    """A server is there, and has not answered a probe yet."""
    READY = auto()
    """Goals can be sent."""


class ServerReadiness:
    """Follows the servers of one action. On the communication thread only."""

    def __init__(
        self,
        timers: Timers,
        *,
        list_publishers: Callable[[], list[Endpoint] | None],
        services_ready: Callable[[], bool],
        other_versions: Callable[[], tuple[str, ...]],
        probe: Callable[[], object],
        on_ready: Callable[[], None],
        on_change: Callable[[frozenset[bytes], frozenset[bytes]], None],
        on_mismatch: Callable[[tuple[str, ...]], None],
        on_complete: Callable[[], None],
        action_type: str,
    ) -> None:
        """Begin without servers, until `matched` is called.

        Args:
            list_publishers: All that publish feedback, as the graph shows it, of any type; `None`
                if the graph cannot be asked.
            services_ready: Whether the endpoints of the action's services are matched.
            other_versions: Returns the parts that a server has in another version than this side,
                with the type hashes of both.
            probe: Sends a question that every live server answers; the caller then calls
                `answered`.
            on_ready: Called when goals can be sent, again for each new server.
            on_change: Called with the ids of servers that have come, and of those that are gone.
            on_mismatch: Called with the types served, if none is `action_type` or one is another
                version.
            on_complete: Called when a server's services are seen; `known` may be called then.
        """
        self.state = State.ABSENT
        self.servers: frozenset[bytes] = frozenset()
        """The ids of the servers in sight."""
        self.publishers = 0
        """How many publishers of feedback the middleware sees."""
        self._timers = timers
        self._list_publishers = list_publishers
        self._services_ready = services_ready
        self._other_versions = other_versions
        self._probe = probe
        self._on_ready = on_ready
        self._on_change = on_change
        self._on_mismatch = on_mismatch
        self._on_complete = on_complete
        self._action_type = action_type
        self._versions: tuple[str, ...] = ()
        """Parts that a server has in another version: one side would misread the other's
        messages."""
        self._in_sight: frozenset[bytes] = frozenset()
        """The ids of all publishers in sight."""
        self._not_serving: frozenset[bytes] = frozenset()
        """Those of them that are not servers, or seem so until their services are known."""
        self._outdated: frozenset[bytes] = frozenset()
        """The publishers that the graph shows while it does not show the newest one yet."""
        self._matched_at = 0.0
        self._early = 0
        """How many publishers the graph has shown before their event."""
        self._settling_since = 0.0
        self._services_since: float | None = None
        """When the services were first seen since settling began."""
        self._probed = False
        """Whether a probe was sent since then."""
        self._closed = False
        self._looking = False
        self._seen = False

    @property
    def ready(self) -> bool:
        """Whether goals can be sent."""
        return self.state is State.READY

    @property
    def has_seen_servers(self) -> bool:
        """Whether a server of any type has been in view."""
        return self._seen or any(end.serves for end in self._list_publishers() or ())

    @property
    def count(self) -> int:
        """How many servers are in sight. After a restart it counts the dead one, too (R14)."""
        # A publisher that the graph shows may not be matched, so not all may be subtracted.
        at_least = min(self.publishers, len(self.servers))
        return max(at_least, self.publishers - len(self._not_serving))

    def matched(self, count: int, came: int = 0) -> None:
        """Handle that the middleware sees `count` feedback publishers now.

        `came` is how many of them it did not see before, or 0 if that is not known.
        """
        self.publishers = count
        self._matched_at = self._timers.now()
        before, early = self._in_sight, self._early
        self._outdated = frozenset()
        self._compare()
        # One that had no name before may have one now.
        missing = came + len(before & UNNAMED) - len(self._in_sight - before - UNNAMED)
        if count and missing > early:
            # A new server has replaced one that the graph still shows. A goal that is sent now
            # goes to the new one, so it is not lost with the old one.
            self._outdated = self._in_sight - UNNAMED
            self._compare()
        # Until the graph shows who has left, it may be the last server.
        doubtful = count <= len(self._not_serving)
        if (missing > 0 or doubtful) and self.state is State.READY:
            self._begin_settling()
        self._early = max(0, self._early - came)
        self._compare_later(_FIRST_STEP, self._matched_at)

    def leave(self) -> None:
        """Handle that the node is replaced: the new one will discover the servers again."""
        self.state = State.ABSENT
        self.publishers = self._early = 0
        self.servers = self._in_sight = self._not_serving = self._outdated = frozenset()

    @property
    def _agrees(self) -> bool:
        """Whether the graph shows the publishers of the middleware's event."""
        return len(self._in_sight) == self.publishers and not self._in_sight & UNNAMED

    def known(self) -> None:
        """Handle that a server has discovered our endpoints: it needs no head start."""
        if self.count == 1 and self._services_since is not None and not self._probed:
            self._settle(self._settling_since, _PROBE_STEP)

    def answered(self) -> None:
        """Handle that a probe was answered."""
        if self.state is State.SETTLING and not self._versions:
            self._become_ready()

    def look(self, wanted: Callable[[], bool]) -> None:
        """Compare the served types with ours now, then once a second while `wanted()` (R21)."""
        if not self._looking:
            self._looking = True
            self._look(wanted)

    def look_again(self) -> None:
        """Compare the served types with ours once, now.

        A server may come into sight late: if the first announcement between two processes is lost,
        Fast DDS sends the next one after 3 s.
        """
        if self._not_serving:
            self._compare()  # services may have come into sight late, too
        if self.state is not State.ABSENT:
            self._tell_versions()
            return
        types = {end.action_type for end in self._list_publishers() or () if end.serves}
        if types and self._action_type not in types:
            self._on_mismatch(tuple(sorted(types)))

    def close(self) -> None:
        """Call no callback any more."""
        self._closed = True

    def _look(self, wanted: Callable[[], bool]) -> None:
        if self._closed or not wanted():
            self._looking = False
            return
        self.look_again()
        if self.state is not State.ABSENT:
            self._looking = False
            return
        self._timers.call_at(self._timers.now() + _GRAPH_PERIOD, lambda: self._look(wanted))

    def _begin_settling(self) -> None:
        self.state = State.SETTLING
        self._settling_since = self._timers.now()
        self._services_since, self._probed, self._versions = None, False, ()
        self._settle(self._settling_since, _FIRST_STEP)

    def _compare(self) -> None:
        """Compare the present publishers, and the servers among them, with the earlier ones."""
        in_sight, servers = self._in_sight, self.servers
        self._in_sight = self._present()
        self.servers = self._in_sight - self._not_serving
        self._early = 0 if self._agrees else self._early + _new(in_sight, self._in_sight)
        if not self.servers:
            self.state = State.ABSENT
        elif self.state is State.READY and _new(servers, self.servers) > 0:
            self._begin_settling()  # a new one has not discovered us yet (R4)
        if self.servers != servers:
            self._seen = True
            gone = servers - self.servers
            # A server that has got its name is not gone.
            self._on_change(self.servers - servers, gone - UNNAMED if self.servers else gone)
        if self.servers and self.state is State.ABSENT:
            self._begin_settling()

    def _compare_later(self, step: float, since: float) -> None:
        """Look again at growing intervals until the graph agrees with the event.

        And for some seconds while a publisher does not serve: its services may come later.
        """

        def compare() -> None:
            if self._closed or since != self._matched_at:
                return
            waiting = self._not_serving and self._timers.now() - since < _NAMED_WITHIN
            if waiting or not self._agrees:
                self._compare()
                self._compare_later(min(2 * step, _LAST_STEP), since)

        if self._not_serving or not self._agrees:
            self._timers.call_at(self._timers.now() + step, compare)

    def _present(self) -> frozenset[bytes]:
        """Return the publishers in sight now, and note which of them do not serve."""
        if self.publishers == 0:
            self._not_serving = frozenset()
            return frozenset()
        listed = self._list_publishers()
        if listed is None:  # in a context that was shut down there is no graph
            return self._in_sight or UNNAMED
        ours = [end for end in listed if end.action_type == self._action_type]
        gids = frozenset(end.gid for end in ours)
        self._not_serving = frozenset(end.gid for end in ours if not end.serves)
        if not gids <= self._outdated or self._timers.now() - self._matched_at >= _NAMED_WITHIN:
            self._outdated = frozenset()
        # The event may be ahead of the graph: a server without a name is still a server.
        named = gids or self.servers
        return named | UNNAMED if self._outdated or len(named) < self.publishers else named

    def _settle(self, since: float, step: float) -> None:
        if self._closed or self.state is not State.SETTLING or since != self._settling_since:
            return
        now = self._timers.now()
        if not self._services_ready():
            slowest = _SETTLING_STEP if now - since < _SETTLING else _LAST_STEP
            self._timers.call_at(now + step, lambda: self._settle(since, min(2 * step, slowest)))
            return
        self._versions = self._other_versions()
        if self._versions:
            self._tell_versions()
            self._timers.call_at(now + step, lambda: self._settle(since, min(2 * step, _LAST_STEP)))
            return
        if self._services_since is None:
            self._services_since = now
            self._timers.call_at(now + _HEAD_START, lambda: self._end_head_start(since))
            self._on_complete()
            return
        patience = _PATIENCE if self.count == 1 else _PATIENCE_WITH_SEVERAL
        ready_at = self._services_since + patience
        if now >= ready_at:
            self._become_ready()
            return
        self._probed = True
        self._probe()
        following = min(2 * step, _SETTLING_STEP)
        self._timers.call_at(min(now + step, ready_at), lambda: self._settle(since, following))

    def _tell_versions(self) -> None:
        if self.state is State.SETTLING and self._versions:
            self._on_mismatch((f"{self._action_type} ({'; '.join(self._versions)})",))

    def _end_head_start(self, since: float) -> None:
        if not self._probed:
            self._settle(since, _PROBE_STEP)

    def _become_ready(self) -> None:
        self.state = State.READY
        self._on_ready()


def _new(before: frozenset[bytes], now: frozenset[bytes]) -> int:
    """Return how many are new. One with a new name is the one that had no name before."""
    new = len(now - before - UNNAMED)
    return new - len(UNNAMED & before - now) if new else 0
