"""Detects that this process was stopped for a while, and repairs what the middleware made of that.

A process is stopped by a debugger, by `docker pause`, or when the computer sleeps. Then it sends
and reads no announcements, and after 20 s the others drop it. When it continues, Fast DDS first
reports that the servers are gone, because the leases ran out meanwhile. The same servers, with the
same ids, are back with their next announcement, 0.1 to 3 s later. So a loss is not believed at once
(`monitor.stood_still`).

The servers have dropped this process, too. If this process read their announcements before its
leases ran out, they find its publishers again, but not its subscriptions: the servers are in sight,
but nothing that they send arrives here. (This was seen when an entity was made in the second before
the stop.) Only a new participant gets messages again. So the servers get a question that every live
server answers, and if no answer comes, the node is replaced, as `node_replacement` does.

The replacing can be deleted when `pytest --long tests/faults/test_stopped_programs.py` passes
without it on the oldest Fast DDS that is supported, which is 2.14 of ROS 2 Jazzy. That a loss is
not believed at once is needed with every middleware that has leases.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable
from functools import partial
from typing import Protocol

from actionkit._threads.clock import Timers
from actionkit._threads.diagnostics import log_later

_LOOK = 2.0
"""Seconds between two looks at the clock, while goals are in flight and once after that: the
subscription to the status is destroyed after the last goal, and the servers may miss that, too."""
NOTICED = 5.0
"""So many seconds between two looks count as a standstill. A busy machine delays a thread by less
time, and in less time no lease of the middleware runs out."""
BELIEVED_AFTER = 8.0
"""Seconds after a standstill in which no server counts as gone: two announcements of Fast DDS, and
a margin for a lost packet."""
_SETTLED = 1.0
"""Seconds in which answers prove nothing: they may be old ones that waited in a socket."""
_ASKED_AGAIN = 0.5
"""Seconds between two questions to the servers."""
_QUESTIONS = 6
"""After so many questions without an answer (3 s), the node is replaced, once for each standstill.
A server that is busy for so long does not answer, either; then the new node does no harm."""
FOUND_WITHIN = 5.0
"""Seconds for a new node to find the servers, if one announcement is missed. So the loss of a
server is reported 8.5 s after a standstill if the node could be replaced at once."""
_boot_time = partial(time.clock_gettime, time.CLOCK_BOOTTIME)


class StoppableLink(Protocol):
    """The entities of one client."""

    def is_busy(self) -> bool:
        """Whether a goal is in flight, or waits for a server."""
        ...

    def stood_still(self, until: float) -> None:
        """Believe no loss of a server before that time."""

    def ask_about_goals(self) -> None:
        """Ask for results again: they may have been lost meanwhile."""

    def hears(self, since: float) -> bool:
        """Whether a server has sent anything since then, or none is needed or in sight.

        If not, ask a question that every server answers.
        """
        ...


class Standstill:
    """Looks at the clock during goals and shortly after. On the communication thread only."""

    def __init__(
        self,
        timers: Timers,
        links: Iterable[StoppableLink],
        *,
        can_leave: Callable[[], bool],
        replace_node: Callable[[], None],
        clock: Callable[[], float] = _boot_time,
    ) -> None:
        """Do nothing until `watch` is called.

        `links` have their entities on the node. `replace_node` replaces the node with all these
        entities, if `can_leave` says that this is possible now. `clock` goes on while the computer
        sleeps.
        """
        self._timers = timers
        self._links = links
        self._can_leave = can_leave
        self._replace_node = replace_node
        self._clock = clock
        self._looked_at: float | None = None
        """When the clock was last read; `None` while it is not watched."""
        self._was_busy = False
        self._since = 0.0  # the end of the latest standstill

    def watch(self) -> None:
        """Look at the clock from time to time, until nothing has been in flight for a while."""
        self._was_busy = True
        if self._looked_at is None:
            self._looked_at = self._clock()
            self._look_later()

    def turn(self) -> None:
        """Look at the clock after the thread has waited, before it reads what has come."""
        if self._looked_at is None:
            return
        before, self._looked_at = self._looked_at, self._clock()
        if self._looked_at - before > NOTICED:
            text = "this process did not run for %.0f s: it looks for its servers again"
            log_later(logging.INFO, text, self._looked_at - before)
            self._since = self._timers.now()
            self._believe_no_loss(BELIEVED_AFTER)
            self._ask_later(self._since, _QUESTIONS)

    def _look_later(self) -> None:
        self._timers.call_at(self._timers.now() + _LOOK, self._look)

    def _look(self) -> None:
        before, self._was_busy = self._was_busy, any(link.is_busy() for link in self._links)
        if before or self._was_busy:
            self._look_later()
        else:
            self._looked_at = None

    def _believe_no_loss(self, seconds: float) -> None:
        for link in self._links:
            link.stood_still(self._timers.now() + seconds)

    def _ask_later(self, since: float, left: int) -> None:
        at = self._timers.now() + _ASKED_AGAIN
        self._timers.call_at(at, lambda: self._ask(since, left))

    def _ask(self, since: float, left: int) -> None:
        if since != self._since:
            return  # it was stopped again
        # A list, so that every link asks.
        heard = [link.hears(since + _SETTLED) for link in self._links]
        if all(heard):
            for link in self._links:
                link.ask_about_goals()
        elif left:
            self._ask_later(since, left - 1)
        elif not self._can_leave():  # something else uses the node
            if self._looked_at is not None:
                self._ask_later(since, 0)
        else:
            log_later(
                logging.WARNING,
                "no server has answered since this process stood still: ActionKit replaces its"
                " node, and goes on following its goals",
            )
            self._replace_node()
            self._believe_no_loss(FOUND_WITHIN)
