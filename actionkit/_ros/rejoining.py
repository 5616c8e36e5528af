"""Enters the ROS graph once more where a new node seems to have missed the servers that are there.

A node announces itself when it is made, and every process that is there answers at once, to it
alone and once. In Fast DDS 2.14 a participant announces itself up to a millisecond before it can
take answers, and drops those that come in between (R29). Then, or where a packet is lost on a
network, the servers come into view with their next regular announcement, up to 3 s later. A new
node is answered at once. So one that sees no server of any client soon after it was made is
replaced, twice at most: where no server is there at all, that costs some ten milliseconds, and the
others on the graph see a node come and go.

No goal can be lost by it: nothing has been sent by a client that has never seen a server.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Protocol

from rclpy.node import Node

from actionkit._ros import graph, standstill
from actionkit._threads.clock import Timers

SWITCH = "ACTIONKIT_QUICK_DISCOVERY"
"""The environment variable that turns this off, with `0`."""
_TRIES = 2
_LOOKS = 4
"""Looks in all, those included at which the node could not be replaced just then."""
_PATIENCE = 0.2
"""Seconds until a server is in view at least, where nothing was missed: 0.11, and some more."""
_MOST_TIMES = 5.0
"""How many times as long that may be on a busy machine, by how much slower the node was made."""


def is_wanted() -> bool:
    """Return whether a node may be replaced: yes, unless the environment says no."""
    return os.environ.get(SWITCH, "").strip() != "0"


class Link(standstill.Link, Protocol):
    """The entities of one client."""

    def has_seen_servers(self) -> bool:
        """Whether a server of any type has been in view; nothing is sent before."""
        ...

    def leave(self) -> None:
        """Destroy the entities: the node is replaced."""

    def enter(self, node: Node) -> None:
        """Make the entities anew on this node."""


class Rejoining:
    """Decides when to do that, and does it. On the communication thread only."""

    def __init__(
        self,
        timers: Timers,
        *,
        can_leave: Callable[[int], bool],
        renew: Callable[[], Node],
        on_failure: Callable[[Exception], None],
    ) -> None:
        """Do nothing until `joined` is called.

        Args:
            timers: The clock and timers of the thread.
            can_leave: Whether the node can be replaced just now; gets the number of links.
            renew: Replaces it, and calls `joined`.
            on_failure: Called with the error if that fails. No link has entities then.
        """
        self.links: dict[Link, None] = {}
        """Whose entities are on the node."""
        self._timers = timers
        self._can_leave = can_leave
        self._renew = renew
        self._on_failure = on_failure
        self._tries = 0
        self._looks = 0
        self._patience = 0.0

    def joined(self, took: float, worked: float) -> None:
        """Handle that the node was made just now.

        Args:
            took: Seconds that it took.
            worked: Seconds that its thread had a core in that time. It is less on a busy machine.
        """
        slower = min(max(1.0, took / max(worked, 1e-6)), _MOST_TIMES)
        # Longer the second time: it may be the servers that are slow.
        self._patience = _PATIENCE * slower * (1 + self._tries)
        if self._tries < _TRIES and is_wanted() and "fastrtps" in graph.middleware():
            self._look_later()

    def _look_later(self) -> None:
        if self._looks < _LOOKS:
            self._looks += 1
            self._timers.call_at(self._timers.now() + self._patience, self._look)

    def _look(self) -> None:
        if any(link.has_seen_servers() for link in self.links):
            return
        if self.links and self._can_leave(len(self.links)):
            self._rejoin()
        else:
            self._look_later()

    def _rejoin(self) -> None:
        self._tries += 1
        self.replace_node()

    def replace_node(self) -> None:
        """Replace the node, and create the entities of all clients again on it."""
        for link in self.links:
            link.leave()
        try:
            node = self._renew()
            for link in self.links:
                link.enter(node)
        except Exception as error:  # noqa: BLE001  of many kinds; the thread decides
            for link in self.links:
                link.leave()
            self.links.clear()
            self._on_failure(error)
