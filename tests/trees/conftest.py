"""A ROS domain and reference servers that the tests of a file share, to save time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import py_trees
import pytest
from test_msgs.action import Fibonacci

from actionkit import Client, servers
from actionkit.servers import Server
from actionkit.testing import isolated_domain

BOUND = 30.0
"""Seconds; only what hangs takes so long."""
MakeClient = Callable[..., Client[Any]]


class Place:
    """One domain, and the servers in it by their action's name."""

    def __init__(self, stack: ExitStack) -> None:
        self.stack = stack
        self.servers: dict[str, Server] = {}
        self._clients: dict[str, Client[Any]] = {}

    def server(self, action: str, name: str = "scripted", **options: Any) -> Server:
        """Return the server of an action; it is started where it is not there."""
        if action not in self.servers:
            started = servers.start(name, action_name=action, **options)
            self.servers[action] = self.stack.enter_context(started)
        return self.servers[action]

    def client(self, action: str) -> Client[Any]:
        """Return the client of an action that all tests of the file share."""
        if action not in self._clients:
            self._clients[action] = self.stack.enter_context(Client(Fibonacci, action))
            if action in self.servers:
                assert self._clients[action].wait_for_server(20)  # discovery may take seconds
        return self._clients[action]


@pytest.fixture(scope="module")
def place() -> Iterator[Place]:
    with ExitStack() as stack:
        patch = stack.enter_context(pytest.MonkeyPatch.context())
        patch.setenv("ROS_DOMAIN_ID", str(stack.enter_context(isolated_domain())))
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        patch.delenv("ROS_LOCALHOST_ONLY", raising=False)
        patch.delenv("ROS_STATIC_PEERS", raising=False)
        yield Place(stack)


@pytest.fixture
def open_client(place: Place) -> Iterator[Callable[..., Client[Any]]]:
    """Make clients in the file's domain; all are closed at the test's end."""
    with ExitStack() as stack:

        def make(action: str, **options: Any) -> Client[Any]:
            client: Client[Any] = Client(Fibonacci, action, **options)
            stack.enter_context(client)
            assert client.wait_for_server(20)  # discovery may take seconds
            return client

        yield make


@pytest.fixture(autouse=True)
def _blackboard() -> Iterator[None]:
    """Leave nothing on the blackboard, which all trees of a process share."""
    yield
    py_trees.blackboard.Blackboard.clear()


def received(server: Server) -> int:
    """Return how many goals have come to a server, those of earlier tests too."""
    server.sync()
    return server.count("goal_received")


def fate(server: Server, goal_id: object) -> list[str]:
    """Return what a server saw of a goal: the words that matter, in order."""
    server.sync()
    words = ("goal_received", "cancel_requested", "accepted", "canceled", "succeeded", "aborted")
    return [e.event for e in server.events if e.goal_id == str(goal_id) and e.event in words]


@pytest.fixture
def client(place: Place, open_client: MakeClient) -> Client[Any]:
    """A client of the server fibonacci, which sends feedback and rejects negative orders."""
    place.server("fibonacci", "fibonacci", period=0.02)
    return open_client("fibonacci")
