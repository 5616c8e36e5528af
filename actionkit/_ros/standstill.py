"""Notices that this process itself stood still, and takes care of what the middleware made of it.

A process that is stopped (a debugger, `docker pause`) or whose computer sleeps announces itself to
nobody and reads no announcement. After 20 s the others drop it, and the first thing that Fast DDS
tells here when it goes on is that the servers are gone: its leases ran out in the same moment. The
same servers, with the same ids, are back with their next announcement, 0.1 to 3 s later. So what
was concluded from the pause is not believed at once (`monitor.stood_still`).

The other side has dropped this process as well, and may not find all of it again: then nothing that
it sends arrives here, though all is in sight. So the servers are asked what every live server
answers. Where nothing is heard of any, the node is made anew, as `rejoining` does.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable
from typing import Protocol

from actionkit._threads.clock import Timers
from actionkit._threads.diagnostics import log_later

_LOOK = 2.0
"""Seconds between two looks at the clock, while goals are in flight."""
NOTICED = 5.0
"""Seconds between two looks that are taken for a standstill. A busy machine delays a thread by
less, and no lease of the middleware runs out in less."""
BELIEVED_AFTER = 8.0
"""Seconds after a standstill in which no server counts as gone: two announcements of Fast DDS, and
some more for a discovery in which a packet is lost."""
_SETTLED = 1.0
"""Seconds in which what had come before, and waited in a socket, is read: it proves nothing."""
_ASKED_AGAIN = 0.5
"""Seconds between two questions whether anybody is heard."""
_QUESTIONS = 6
"""After so many without an answer, 3 s, the node is taken for deaf. A server that is busy for so
long is silent as well; then the node is made anew in vain, and nothing is lost by it."""
_TRIES = 3


class Link(Protocol):
    """The entities of one client."""

    def is_busy(self) -> bool:
        """Whether any goal is in flight, or waits for a server."""
        ...

    def stood_still(self, until: float) -> None:
        """Believe no loss of a server before that time."""

    def ask_about_goals(self) -> None:
        """Ask for what may have been lost meanwhile."""

    def hears(self, since: float) -> bool:
        """Whether anything has come from a server since then; if not, ask what all answer."""
        ...


class Standstill:
    """Looks at the clock while goals are in flight. On the communication thread only."""

    def __init__(
        self,
        timers: Timers,
        links: Iterable[Link],
        *,
        can_leave: Callable[[], bool],
        make_anew: Callable[[], None],
        clock: Callable[[], float] = lambda: time.clock_gettime(time.CLOCK_BOOTTIME),
    ) -> None:
        """Do nothing until `watch` is called.

        Args:
            timers: The clock and timers of the thread.
            links: Whose entities are on the node.
            can_leave: Whether the node can be replaced just now.
            make_anew: Replaces it, with the entities of all links.
            clock: Seconds that go on while the computer sleeps.
        """
        self._timers = timers
        self._links = links
        self._can_leave = can_leave
        self._make_anew = make_anew
        self._clock = clock
        self._looked_at: float | None = None
        """When `turn` was last called; `None` while nobody watches."""
        self._number = 0  # of the latest standstill
        self._since = 0.0
        self._tries = 0

    def watch(self) -> None:
        """Look at the clock now and then, until nothing is in flight."""
        if self._looked_at is None:
            self._looked_at = self._clock()
            self._look_later()

    def turn(self) -> None:
        """Handle that the thread has waited, and has read nothing so far of what came."""
        if self._looked_at is None:
            return
        before, self._looked_at = self._looked_at, self._clock()
        if self._looked_at - before > NOTICED:
            self._tries = 0
            text = "this process stood still for %.0f s: its servers are looked for again"
            log_later(logging.INFO, text, self._looked_at - before)
            self._begin()

    def _look_later(self) -> None:
        self._timers.call_at(self._timers.now() + _LOOK, self._look)

    def _look(self) -> None:
        if any(link.is_busy() for link in self._links):
            self._look_later()
        else:
            self._looked_at = None

    def _begin(self) -> None:
        """Doubt what the middleware tells, and find out whether anybody is heard."""
        self._number += 1
        self._since = self._timers.now()
        for link in self._links:
            link.stood_still(self._since + BELIEVED_AFTER)
        self._ask_later(self._number, _QUESTIONS)

    def _ask_later(self, number: int, left: int) -> None:
        at = self._timers.now() + _ASKED_AGAIN
        self._timers.call_at(at, lambda: self._ask(number, left))

    def _ask(self, number: int, left: int) -> None:
        if number != self._number:
            return  # it stood still again
        since = self._since + _SETTLED
        heard = [link.hears(since) for link in self._links if link.is_busy()]  # all are to ask
        if all(heard):
            for link in self._links:
                link.ask_about_goals()
        elif left:
            self._ask_later(number, left - 1)
        elif self._tries < _TRIES and not self._can_leave():
            self._ask_later(number, 0)  # somebody else uses the node just now
        elif self._tries < _TRIES:
            self._tries += 1
            log_later(
                logging.WARNING,
                "nothing was heard from a server since this process stood still: ActionKit's node"
                " is made anew, and its goals are followed on",
            )
            self._make_anew()
            self._begin()
