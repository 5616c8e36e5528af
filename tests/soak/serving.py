"""The servers of one action in a round: the first, the others, and their faults."""

from __future__ import annotations

import contextlib
import copy
import tempfile
import threading
import time

from actionkit import servers
from actionkit.servers import Server, ServerEvent
from actionkit.servers._events import Journal
from tests.conftest import NEVER
from tests.faults.crowd import drain
from tests.soak.oracle import GONE, HIDDEN, SHOWN, merged
from tests.soak.place import Place
from tests.soak.plan import BEYOND_LEASE, STAYS, Fault
from tests.soak.records import KINDS

_QUIET = 12.0
_VANISHES = 8.0
"""Seconds in which somebody sends a goal to a server that vanishes at its first."""


class Serving:
    """The servers of an action.

    Attributes:
        first: The one that is there from the beginning to the end, over restarts.
        done: What was done to them, for the oracle.
    """

    def __init__(self, place: Place, kind: str) -> None:
        """Start the first."""
        self._place = place
        self._kind = kind
        self._servers: list[Server] = []
        self._marks: list[list[ServerEvent]] = []
        self._vanished: list[Server] = []
        self.done = set() if KINDS[kind].answers else {"blocks"}
        self.first = self._start(KINDS[kind].server)

    # -- what is done ------------------------------------------------------------------------

    def strike(self, fault: Fault) -> None:
        """Do it, and undo it after its time."""
        self.done.add(fault.what)
        strikes = {
            "kill": self._kill,
            "restart": self._restart,
            "stop": self._stop,
            "duplicate": self._duplicate,
            "twin": self._twin,
            "linger": self._linger,
            "vanish": self._vanish,
        }
        strikes[fault.what](fault.seconds)

    def _kill(self, seconds: float) -> None:
        self._mark(self.first, GONE)
        self.first.kill()
        NEVER.wait(seconds)
        self._come_back()

    def _restart(self, _: float) -> None:
        self._mark(self.first, GONE)
        self._come_back()

    def _stop(self, seconds: float) -> None:
        self.first.pause()
        NEVER.wait(seconds)
        self.first.resume()

    def _duplicate(self, seconds: float) -> None:
        """A second server is there for a while, or to the end of the round."""
        self._be_beside(self._start(KINDS[self._kind].server), seconds)

    def _twin(self, seconds: float) -> None:
        """The same, with the same name of its node: the same launch file, started twice."""
        self._be_beside(self._start_twin(), seconds)

    def _be_beside(self, second: Server, seconds: float) -> None:
        if seconds == STAYS:
            return
        NEVER.wait(seconds)
        self.done.add("terminate")
        self._mark(second, GONE)
        second.terminate()

    def _linger(self, seconds: float) -> None:
        """It hangs, another one takes its place, and then it goes on."""
        self.first.pause()
        leaves = seconds >= BEYOND_LEASE  # the graph; before that, its goals are not to run beside
        if leaves:
            self._mark(self.first, HIDDEN)
        self._start_twin()
        NEVER.wait(seconds)
        self.first.resume()
        if leaves:
            self._mark(self.first, SHOWN)

    def _vanish(self, _: float) -> None:
        """Its action server is destroyed while goals execute; another process takes its place."""
        self._mark(self.first, GONE)
        self.first.terminate()
        old = self._start("vanishes")
        with contextlib.suppress(AssertionError):  # nobody sends a goal
            old.wait_for("vanished", timeout=_VANISHES)
        self._mark(old, HIDDEN)
        self._vanished.append(old)
        self._come_back()

    # -- what came of it -----------------------------------------------------------------------

    @property
    def events(self) -> list[ServerEvent]:
        """What all of them saw, and what was done, in order."""
        return merged(
            [*server.events, *marks]
            for server, marks in zip(self._servers, self._marks, strict=True)
        )

    def drain(self, until: float) -> set[str]:
        """Wait until no goal runs, except goals out of reach; return the goals that still run."""
        left = self.out_of_reach
        for server in self._servers:
            if server not in self._vanished:
                left |= drain(server, max(0.0, until - time.monotonic()), _QUIET)
        return left

    @property
    def out_of_reach(self) -> set[str]:
        """The goals that run on servers which have vanished: nobody can cancel them."""
        return set().union(*(server.running() for server in self._vanished))

    def stop(self) -> None:
        """End all of them."""
        for server in self._servers:
            server.stop()

    # -- private -------------------------------------------------------------------------------

    def _start(self, name: str) -> Server:
        of = KINDS[self._kind]
        options = of.options if name == of.server else {}
        with self._place.servers():
            server = servers.start(
                name,
                action_name=self._kind,
                domain_id=self._place.domain,
                journal="goals",
                **options,
            )
        return self._add(server)

    def _start_twin(self) -> Server:
        """Start one more of the first, which is called as that is."""
        twin = copy.copy(self.first)
        twin._journal = Journal()
        twin._stderr = tempfile.TemporaryFile()  # noqa: SIM115  closed by `stop`
        twin._stdin_lock = threading.Lock()
        with self._place.servers():
            twin._launch()
        return self._add(twin)

    def _add(self, server: Server) -> Server:
        self._servers.append(server)
        self._marks.append([])
        return server

    def _come_back(self) -> None:
        with self._place.servers():
            self.first.restart()

    def _mark(self, server: Server, what: str) -> None:
        marks = self._marks[self._servers.index(server)]
        marks.append(ServerEvent(what, None, time.monotonic()))
