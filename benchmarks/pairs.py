"""Pairs of a server and a client, each in processes and in a ROS domain of their own.

So nothing of one client reaches another's server, all can stay connected, and turns can be as
short as it takes for the machine's noise to fall on all of them alike.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable
from contextlib import ExitStack

from typing_extensions import Self

from actionkit.testing import isolated_domain
from benchmarks import process
from benchmarks.child import Child
from benchmarks.clients import OURS
from benchmarks.measure import Sample, console

FORGETFUL = 0.5
"""Seconds that a server of which nothing is to be remembered keeps a result."""
_WARM = 2
_TURNS = 8


class Pair:
    """One server and one client, connected. A context manager."""

    def __init__(self, variant: str, **options: float) -> None:
        """Name the variant of the client, and the options of the server's `reset`."""
        self._variant = variant
        self._options = options
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        with self._stack:
            self._domain = self._stack.enter_context(isolated_domain())
            self.server = self._start("benchmarks.server")
            self.client = self._start("benchmarks.worker", self._variant)
            self.renew()
            self._stack = self._stack.pop_all()
        return self

    def _start(self, *arguments: str) -> Child:
        return self._stack.enter_context(Child(self._domain, *arguments))

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def another(self, variant: str) -> Child:
        """Start another client's process; it has to be ended, and connected."""
        return Child(self._domain, "benchmarks.worker", variant)

    def renew(self, **options: float) -> None:
        """Have a new server, which remembers nothing; with options, of another kind."""
        self.client.do("close")
        self.server.do("reset", **{**self._options, **options})
        self.client.do("open")

    def renew_one(self, name: str, **options: float) -> None:
        """Have a new server of one action, beside those of others, and a client of it."""
        self.client.do("close", name=name)
        self.server.do("renew", name=name, **options)
        self.client.do("open", name=name)

    def fill(self, goals: int, name: str) -> None:
        """Let the action's server remember so many goals more, of another client."""
        with self.another(OURS[0]) as other:
            other.do("open", name=name)
            other.do("fill", goals=goals, name=name)

    def turn(self, calls: int, order: int, **how: str | float) -> Sample:
        """Make some calls; `how` is what `Worker.in_a_row` may be told besides."""
        return tried_again(lambda: self._turn(calls, order, how))

    def _turn(self, calls: int, order: int, how: dict[str, str | float]) -> Sample:
        self.client.do("in_a_row", calls=_WARM, order=order, **how)  # what slept is awake again
        before = process.cpu(self.server.pid)
        sample = self.client.do("in_a_row", calls=calls, order=order, **how)
        server = (process.cpu(self.server.pid) - before) / calls
        return {
            **sample,
            "latency": statistics.median(sample["took"]),
            "server": server,
            "rest": max(0.0, statistics.mean(sample["took"]) - server),
        }


def tried_again(turn: Callable[[], Sample]) -> Sample:
    """Take a turn, and another where that fails.

    On a busy machine a server may have forgotten a result, and a raw client may miss an answer that
    comes before it has stored the request's number.
    """
    for _ in range(_TURNS - 1):
        try:
            return turn()
        except RuntimeError as error:
            console.print(str(error).splitlines()[-1], style="dim")
    return turn()
