"""A fresh process sees the servers that are there, and waits survive a second try (C7.6)."""

from __future__ import annotations

import asyncio
import signal
import threading
import time
from typing import Any

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node

from actionkit import Client, ClientClosedError, Timeouts
from actionkit._ros.communication import own_node
from actionkit._ros.communication.runtime import Runtime
from actionkit._ros.others_goals.survey import Survey
from actionkit._ros.workarounds.node_replacement import _TRIES_ALONE, SWITCH
from tests.conftest import NEVER

GOAL = {"order": 3}
PATIENT = Timeouts(server=None)
"""A server that comes later may miss the answers, too, and gets no second try."""


@pytest.fixture(autouse=True)
def _switched_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(SWITCH, raising=False)


def runtime_of(client: Client[Any]) -> Runtime:
    return client._session.connection.runtime


def tries(client: Client[Any]) -> int:
    runtime = runtime_of(client)
    return runtime.run(lambda: runtime.node_replacement._tries)


def has_tried(client: Client[Any], times: int) -> bool:
    """Wait until its node was replaced so many times."""
    until = time.monotonic() + 30
    while tries(client) < times:
        if time.monotonic() > until:
            return False
        NEVER.wait(0.01)
    return True


def has_looked_for_the_last_time(client: Client[Any]) -> bool:
    runtime = runtime_of(client)
    until = time.monotonic() + 30
    while runtime.run(lambda: len(runtime.timers)):
        if time.monotonic() > until:
            return False
        NEVER.wait(0.01)
    return True


def test_waits_and_calls_survive_a_second_try(action_server, make_client):
    client = make_client(timeouts=PATIENT)
    other = make_client(name="other", timeouts=PATIENT)
    first = runtime_of(client).node
    waits: list[bool] = []
    waiting = threading.Thread(target=lambda: waits.append(client.wait_for_server(60)))
    waiting.start()

    async def await_one() -> Any:
        return await client.call_async(GOAL, timeout=60)

    awaited: list[Any] = []
    awaiting = threading.Thread(target=lambda: awaited.append(asyncio.run(await_one())))
    awaiting.start()
    called = [client.call_async(GOAL, timeout=60), other.call_async(GOAL, timeout=60)]
    taken_back = client.call_async(GOAL, timeout=60)

    assert has_tried(client, 2)
    assert runtime_of(client).node is not first
    taken_back.cancel()
    servers = [action_server("fibonacci"), action_server("fibonacci", action_name="other")]
    for future in called:
        assert list(future.result(60).sequence) == [0, 1, 1, 2]
        assert future.outcome().attempts == 1
    for thread in (waiting, awaiting):
        thread.join(60)
    assert waits == [True]
    assert list(awaited[0].sequence) == [0, 1, 1, 2]
    assert taken_back.cancelled()
    # Each goal came to its server once, no matter what happened to the node.
    for server in servers:
        server.sync()
    assert [server.count("goal_received") for server in servers] == [2, 1]
    # What comes later goes over the node as it is now, feedback too.
    feedback: list[Any] = []
    client.call(GOAL, on_feedback=feedback.append, timeout=60)
    assert feedback
    assert list(make_client().call(GOAL, timeout=60).sequence) == [0, 1, 1, 2]
    assert 2 <= tries(client) <= _TRIES_ALONE  # more only while no other node was in sight


def test_in_a_context_of_the_users_there_is_no_second_try(action_server, make_client, ros_domain):
    context = Context()
    context.init(args=[], initialize_logging=False, domain_id=ros_domain)
    node = Node("users", context=context)
    try:
        publishers = list(node.publishers)
        client = make_client(node=node, timeouts=PATIENT)
        assert runtime_of(client).run(lambda: runtime_of(client).node_replacement._looks) == 0
        future = client.call_async(GOAL, timeout=60)
        action_server("fibonacci")
        assert list(future.result(60).sequence) == [0, 1, 1, 2]
        assert tries(client) == 0  # the participant would stay the same
        assert list(node.publishers) == publishers
        assert node.get_fully_qualified_name() == "/users"  # raises where it was destroyed
    finally:
        node.destroy_node()
        context.try_shutdown()


@pytest.mark.long
def test_alone_in_a_context_of_the_users_there_is(action_server, make_client, ros_domain):
    """A program with `rclpy.init()` and no node of its own: the participant goes with ours."""
    rclpy.init(args=[], domain_id=ros_domain)
    try:
        client = make_client(timeouts=PATIENT)
        assert runtime_of(client).context is rclpy.get_default_context()
        called = client.call_async(GOAL, timeout=60)
        assert has_tried(client, 2)
        assert not runtime_of(client).is_apart
        action_server("fibonacci")
        assert called.result(60)
        client.close()
    finally:
        rclpy.shutdown()


def test_no_second_try_once_a_server_was_seen(action_server, make_client):
    """So none while goals are in flight: nothing is sent before a server is seen."""
    server = action_server("countdown", period=0.05)
    client = make_client()
    future = client.call_async({"order": 1000})
    server.wait_for("executing")
    runtime, link = runtime_of(client), client._session.connection.link
    tried = tries(client)  # none, as a rule
    server.kill()
    # However many looks follow, and whether or not that server is still in view.
    runtime.run(lambda: link.monitor.readiness.matched(0))
    assert runtime.run(link.has_seen_servers)
    runtime.run(runtime.node_replacement._look)
    assert tries(client) == tried
    assert not future.done() or not future.outcome().ok


@pytest.mark.long
def test_no_second_try_while_tools_use_the_node(make_client, ros_domain):
    with Survey() as survey:
        node = survey.runtime.node
        client = make_client()
        assert runtime_of(client) is survey.runtime
        assert has_looked_for_the_last_time(client)
        assert tries(client) == 0
        assert survey.runtime.node is node


@pytest.mark.long
def test_a_second_try_that_fails_ends_the_calls_with_its_error(make_client, monkeypatch):
    client = make_client()
    future = client.call_async(GOAL, timeout=60)

    def refuse(*args: Any, **kwargs: Any) -> Node:
        raise MemoryError("for the test")

    with monkeypatch.context() as patch:
        patch.setattr(own_node, "Node", refuse)
        error = future.exception(30)
    assert error is not None
    assert "for the test" in f"{error} {error.__cause__}"
    with pytest.raises(ClientClosedError, match="make a new client"):
        client.server_is_ready()
    assert not make_client().server_is_ready()  # a new node was made, on a new thread


def test_the_switch_leaves_one_node(make_client, monkeypatch):
    monkeypatch.setenv(SWITCH, "0")
    client = make_client()
    assert runtime_of(client).run(lambda: runtime_of(client).node_replacement._looks) == 0
    assert tries(client) == 0


REPLACED = """
import threading, rclpy
from actionkit import Client, Timeouts
from test_msgs.action import Fibonacci
rclpy.init()
node = rclpy.create_node("users")
client = Client(Fibonacci, "fibonacci", node=node, timeouts=Timeouts(server=60))
assert client.wait_for_server(60)
runtime = client._session.connection.runtime
runtime.run(runtime.node_replacement.replace_node)
assert runtime.is_apart
grown_old = threading.Timer(2.0, print, ["old"], {"flush": True})
client.call({"order": 1}, on_feedback=lambda feedback: grown_old.start())
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.long
def test_a_goal_of_a_node_apart_ends_with_the_users_context(number, action_server, run_script):
    """After a standstill our node may be in a context of ours (C2.5, C5.4)."""
    server = action_server("never_finishes")
    script = run_script(REPLACED)
    assert script.line() == "old"
    script.process.send_signal(number)
    code, _, err = script.finish()
    assert code == (-number if number is signal.SIGINT else 1), err
    assert "died" not in err
    assert len(server.wait_for("canceled")) == 1
