"""Clients in this process, and two hosts with a network between them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import pytest

from actionkit import Timeouts, servers
from actionkit.servers import Server
from tests.faults import network
from tests.faults.callers import LocalCaller, RemoteCaller
from tests.faults.lab import TIMEOUTS
from tests.faults.network import Network


@pytest.fixture
def make_caller(ros_domain: int) -> Iterator[Callable[..., LocalCaller]]:
    """Make clients in this process; they are closed at the test's end."""
    with ExitStack() as stack:

        def make(timeouts: Timeouts = TIMEOUTS) -> LocalCaller:
            caller = LocalCaller(timeouts)
            stack.callback(caller.close)
            return caller

        yield make


class Field:
    """The two hosts, with a server on one of them and a client on the other."""

    def __init__(self, cable: Network, domain: int, stack: ExitStack) -> None:
        self.cable = cable
        self._domain = domain
        self._stack = stack

    def at_the_end(self, do: Callable[[], object]) -> None:
        """Have something done at the end of the test."""
        self._stack.callback(do)

    def serve(self, name: str, **options: Any) -> Server:
        with self.cable.second.inside():
            server = servers.start(name, domain_id=self._domain, **options)
        return self._stack.enter_context(server)

    def caller(self, timeouts: Timeouts = TIMEOUTS) -> RemoteCaller:
        with self.cable.first.inside():
            caller = RemoteCaller(timeouts)
        self._stack.callback(caller.kill)
        assert caller.wait_for_server(20)
        return caller


@pytest.fixture(scope="module")
def possible() -> None:
    """Skip where no hosts can be made."""
    reason = network.why_not()
    if reason:
        pytest.skip(reason)


@pytest.fixture
def field(possible: None, ros_domain: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[Field]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
    # The two hosts share this machine's memory, which a cable has no part in.
    monkeypatch.setenv("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
    with network.two_hosts() as cable, ExitStack() as stack:
        yield Field(cable, ros_domain, stack)
