"""A server and goals for the tests of awaiting, and what reached the server."""

from __future__ import annotations

import pytest

from actionkit import CancelReport, Client, GoalFuture
from actionkit.servers import Server

CONFIRMED = "cancelled, and confirmed before the wait ended"
CANCELLED = "cancelled"
NOTHING = "nothing: the goal goes on"


@pytest.fixture
def server(action_server) -> Server:
    """A server whose goals last 0.3 s for each number."""
    return action_server("fibonacci", period=0.3)


QUICK, LONG = {"order": 1}, {"order": 100}


@pytest.fixture
def client(server, make_client) -> Client:
    """A client that knows the server."""
    client = make_client()
    assert client.wait_for_server(20)
    return client


@pytest.fixture
def begun(server, client) -> GoalFuture:
    """A goal that runs for longer than any test."""
    future = client.call_async(LONG)
    server.wait_for("executing")
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
