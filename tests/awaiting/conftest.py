"""A server and goals for the tests of awaiting, and what reached the server."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from actionkit import CancelReport, Client, GoalFuture, servers
from actionkit.servers import Server
from actionkit.testing import isolated_domain

CONFIRMED = "cancelled, confirmed"
CANCELLED = "cancelled"
NOTHING = "nothing: the goal goes on"


QUICK, LONG = {"order": 1}, {"order": 100}


@pytest.fixture(scope="module")
def ros_domain() -> Iterator[int]:
    """Return the id of a ROS domain that a module has for itself, as its servers are kept."""
    with isolated_domain() as domain, pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(domain))
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        yield domain


@pytest.fixture(scope="module")
def server(ros_domain: int) -> Iterator[Server]:
    """A server that needs 0.3 s for each number of a goal. The tests of a module share it."""
    with servers.start(
        "fibonacci", action_name="shared", domain_id=ros_domain, period=0.3
    ) as started:
        yield started


@pytest.fixture
def client(server: Server, make_client: Callable[..., Client[Any]]) -> Client:
    """A client that knows the server."""
    client = make_client(name="shared")
    assert client.wait_for_server(20)
    return client


@pytest.fixture
def begun(server: Server, client: Client) -> GoalFuture:
    """A goal that runs for longer than any test."""
    future = client.call_async(LONG)
    server.wait_for("executing", goal_id=str(future.goal_id))
    return future


def reached(server: Server, client: Client, future: GoalFuture) -> str:
    """Return what the server has heard of, by its own journal, when a wait has just ended."""
    if future.done():
        assert future.outcome(0).cancel is CancelReport.CONFIRMED
        server.wait_for("canceled", goal_id=str(future.goal_id))
        return CONFIRMED
    # Another goal is cancelled: when that has come, so has every request that was sent before it.
    later = client.call_async(LONG)
    server.wait_for("executing", goal_id=str(later.goal_id))
    later.cancel()
    server.wait_for("canceled", goal_id=str(later.goal_id))
    asked = [event for event in server.events if event.event == "cancel_requested"]
    if any(event.goal_id == str(future.goal_id) for event in asked):
        server.wait_for("canceled", goal_id=str(future.goal_id))
        return CANCELLED
    assert str(future.goal_id) in server.running()
    future.cancel()
    server.wait_for("canceled", goal_id=str(future.goal_id))
    return NOTHING
