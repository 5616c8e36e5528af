"""Clients of the same process find a fake server at once: it was waited for before (C9.1)."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
import rclpy
from rclpy.action import get_action_names_and_types
from test_msgs.action import Fibonacci, NestedMessage

from actionkit import ActionTypeMismatchError, Client
from actionkit._ros.servers_in_sight.readiness import _HEAD_START
from actionkit._ros.tools.presence import Presence
from actionkit.testing import FakeServer, _fake_server, isolated_domain

ROUNDS = 5


@contextmanager
def initialised(wanted: bool) -> Iterator[None]:
    """With a context of the user, which clients use, or without."""
    if wanted:
        rclpy.init()
    try:
        yield
    finally:
        rclpy.try_shutdown()


@pytest.mark.parametrize("init", [False, True])
def test_a_new_client_sees_the_server_at_once(ros_domain: int, init: bool) -> None:
    taken = []
    for _ in range(ROUNDS):  # in each one, all nodes of the last one have left the graph
        with initialised(init), FakeServer(Fibonacci, "fibonacci"):
            began = time.monotonic()
            with Client(Fibonacci, "fibonacci") as client:
                connection = client._session.connection
                assert connection.runtime.run(connection.actions) == {
                    "/fibonacci": ("test_msgs/action/Fibonacci",)
                }
                assert client.wait_for_server(30.0)
                taken.append(time.monotonic() - began)
    # Not so long as a client waits before it sends to a server that may not have found it. On a
    # busy machine not every round is so quick; without the server's help none is.
    assert min(taken) < _HEAD_START, taken


@pytest.mark.long
@pytest.mark.parametrize("init", [False, True])
def test_so_does_a_client_that_was_there_before(ros_domain: int, init: bool) -> None:
    taken = []
    for _ in range(ROUNDS):
        with (
            initialised(init),
            Client(Fibonacci, "fibonacci") as client,
            FakeServer(Fibonacci, "fibonacci"),
        ):
            began = time.monotonic()
            assert client.wait_for_server(30.0)
            taken.append(time.monotonic() - began)
    assert min(taken) < _HEAD_START, taken


@pytest.mark.long
def test_a_node_of_the_users_sees_it_at_once(ros_domain: int) -> None:
    for _ in range(ROUNDS):
        with initialised(True):
            node = rclpy.create_node("users")
            with FakeServer(Fibonacci, "fibonacci"):
                assert dict(get_action_names_and_types(node)).keys() == {"/fibonacci"}
            node.destroy_node()


def test_a_short_timeout_is_enough(fake_server: Any, make_client: Any) -> None:
    fake_server(Fibonacci, "fibonacci", result={"sequence": [1]})
    assert list(make_client().call({}, timeout=0.5).sequence) == [1]


def test_nothing_is_left_when_it_stops(ros_domain: int, own_threads: Callable[[], Any]) -> None:
    threads = set(threading.enumerate())
    server = FakeServer(Fibonacci, "fibonacci").start()
    assert own_threads() == ["actionkit"]
    server.stop()
    assert set(threading.enumerate()) <= threads


def test_clients_of_another_type_are_told_as_before(ros_domain: int) -> None:
    with Client(NestedMessage, "fibonacci") as earlier, FakeServer(Fibonacci, "fibonacci"):
        for client in (earlier, Client(NestedMessage, "fibonacci")):
            with client, pytest.raises(ActionTypeMismatchError, match="test_msgs/action/Fibon"):
                client.call({}, timeout=20.0)


def test_it_goes_on_where_nobody_sees_it(
    ros_domain: int, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(Presence, "see", lambda *_: False)
    with FakeServer(Fibonacci, "fibonacci") as server:
        assert server.running() == set()
    assert "clients in this process had not found it after 5 s" in caplog.text


def test_it_waits_for_no_client_elsewhere(
    ros_domain: int, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(_fake_server, "_IN_VIEW_WITHIN", 0.0)
    with isolated_domain() as other:
        with FakeServer(Fibonacci, "fibonacci", domain_id=other):
            pass
        with initialised(True), FakeServer(Fibonacci, "fibonacci", domain_id=other):
            pass
    monkeypatch.setenv("ROS_DOMAIN_ID", "none")
    with FakeServer(Fibonacci, "fibonacci", domain_id=ros_domain):
        pass
    assert caplog.text == ""
