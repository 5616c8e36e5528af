"""Replaces a new node if it seems to have missed the servers that are there.

A node announces itself when it is made, and every other process answers it once, at once. In Fast
DDS 2.14 a participant announces itself up to a millisecond before it can receive answers, and loses
those that come in between (R29). In that case, or if a packet is lost on a network, the servers
come into sight with their next regular announcement, up to 3 s later. But a new node gets answers
at once. So if a node sees no server of any client soon after it was made, it is replaced, twice at
most. If there is no server at all, this costs some ten milliseconds, and others see a node come and
go.

Two tries are not enough: each misses the answers in about half of the cases. Most often it misses
those of all other processes. So a node that sees no other node at all is replaced more often. There
is nobody then whom that disturbs, or all have been missed.

No goal can be lost by this: a client that has never seen a server has sent nothing.

This can be deleted when `ACTIONKIT_REPEAT=4 pytest tests/faults/test_first_answers.py` passes
without it on the oldest Fast DDS that is supported, which is 2.14 of ROS 2 Jazzy.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Protocol

from rclpy.node import Node

from actionkit._ros.endpoints import graph
from actionkit._ros.workarounds import standstill
from actionkit._threads.clock import Timers

SWITCH = "ACTIONKIT_QUICK_DISCOVERY"
"""The environment variable that turns this off, with `0`."""
_TRIES = 2
_TRIES_ALONE = 6
"""While no other node is in sight. With those before, they take little more than a second."""
_LOOKS = _TRIES_ALONE + 2
"""Looks in all, also those at which the node could not be replaced."""
_PATIENCE = 0.2
"""Seconds until a server is in sight if nothing was missed: 0.06 to 0.13, and a margin."""
_PATIENCE_ALONE = 0.16
"""The same after the first tries."""
_MOST_TIMES = 5.0
"""The largest factor for that time on a busy machine, where making the node takes longer."""


def is_wanted() -> bool:
    """Return whether a node may be replaced: yes, unless the environment says no."""
    return os.environ.get(SWITCH, "").strip() != "0"


class MovableLink(standstill.StoppableLink, Protocol):
    """The entities of one client."""

    def has_seen_servers(self) -> bool:
        """Whether a server of any type has been in view; nothing is sent before."""
        ...

    def leave(self) -> None:
        """Destroy the entities: the node is replaced."""

    def enter(self, node: Node) -> None:
        """Make the entities again, on this node."""

    def close(self) -> None:
        """Destroy the entities; nobody is told anything more."""


class NodeReplacement:
    """Decides when to replace the node, and does it. On the communication thread only."""

    def __init__(
        self,
        timers: Timers,
        *,
        can_leave: Callable[[int], bool],
        is_alone: Callable[[], bool],
        renew: Callable[[], Node],
        on_failure: Callable[[Exception], None],
    ) -> None:
        """Do nothing until `joined` is called.

        `can_leave` says whether the node can be replaced now; it gets the number of links.
        `is_alone` says whether the node sees no other node, of any process. `renew` replaces the
        node and calls `joined`. If that fails, no link has entities, and `on_failure` gets the
        error.
        """
        self.links: dict[MovableLink, None] = {}
        """The clients with entities on the node."""
        self._timers = timers
        self._can_leave = can_leave
        self._is_alone = is_alone
        self._renew = renew
        self._on_failure = on_failure
        self._tries = 0
        self._looks = 0
        self._patience = 0.0

    def joined(self, took: float, worked: float) -> None:
        """Handle that the node was made just now.

        That took `took` seconds; in that time, its thread had a core for `worked` seconds, which is
        less on a busy machine.
        """
        slower = min(max(1.0, took / max(worked, 1e-6)), _MOST_TIMES)
        self._patience = slower * (_PATIENCE if self._tries < _TRIES else _PATIENCE_ALONE)
        if self._tries < _TRIES_ALONE and is_wanted() and "fastrtps" in graph.middleware():
            self._look_later()

    def _look_later(self) -> None:
        if self._looks < _LOOKS:
            self._looks += 1
            self._timers.call_at(self._timers.now() + self._patience, self._look)

    def _look(self) -> None:
        if any(link.has_seen_servers() for link in self.links):
            return
        if self._tries >= _TRIES and not self._is_alone():
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
        except Exception as error:  # noqa: BLE001  many kinds; the thread decides
            for link in self.links:
                link.leave()
            self.links.clear()
            self._on_failure(error)
