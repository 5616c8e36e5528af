"""`node=`: names as that node's, and calls from inside its callbacks (C1.1, C1.2)."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import pytest
import rclpy
from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from test_msgs.action import Fibonacci
from test_msgs.srv import Empty

from actionkit import Client
from actionkit._ros.discovery import stop_listening
from actionkit.testing import EventLog
from tests.conftest import until_shutdown


@contextmanager
def user_node(domain: int, *args: str, namespace: str = "") -> Iterator[Node]:
    context = Context()
    context.init(["--ros-args", *args] if args else [], domain_id=domain)
    node = Node("users", context=context, namespace=namespace)
    try:
        yield node
    finally:
        with suppress(InvalidHandle):  # the test has destroyed it
            stop_listening(node)
            node.destroy_node()
        context.try_shutdown()


@contextmanager
def spinning(node: Node, kind: str) -> Iterator[threading.Thread]:
    """Spin the node in a thread, in one of the ways that users have."""
    if kind == "rclpy.spin":
        executor = SingleThreadedExecutor(context=node.context)
        target, args = rclpy.spin, (node, executor)
    else:
        cls = {"single": SingleThreadedExecutor, "multi": MultiThreadedExecutor}[kind]
        executor = cls(context=node.context)
        executor.add_node(node)
        target, args = executor.spin, ()

    def spin() -> None:
        with until_shutdown():
            target(*args)

    thread = threading.Thread(target=spin)
    thread.start()
    try:
        yield thread
    finally:
        node.context.try_shutdown()
        thread.join(10)
        assert not thread.is_alive()


@pytest.mark.parametrize("spin", ["single", "multi", "rclpy.spin"])
@pytest.mark.parametrize("where", ["timer", "service", "thread"])
def test_calls_from_callbacks_and_threads(spin, where, action_server, ros_domain):
    action_server("fibonacci", action_name="/robot/fibonacci", period=0.01)
    log: EventLog = EventLog()
    with (
        user_node(ros_domain, namespace="/robot") as node,
        Client(Fibonacci, "fibonacci", node=node) as client,
    ):

        def call() -> None:
            feedback: EventLog = EventLog()
            log((client.call({"order": 5}, 10, on_feedback=feedback), len(feedback)))

        if where == "timer":
            timer = node.create_timer(0.01, lambda: (timer.cancel(), call()))
        elif where == "service":

            def serve(request: object, response: object) -> object:
                call()
                return response

            node.create_service(Empty, "call_it", serve)
        with spinning(node, spin):
            if where == "thread":
                call()
            elif where == "service":
                with user_node(ros_domain) as asker:
                    asks = asker.create_client(Empty, "/robot/call_it")
                    assert asks.wait_for_service(10)
                    future = asks.call_async(Empty.Request())
                    executor = SingleThreadedExecutor(context=asker.context)
                    executor.add_node(asker)
                    executor.spin_until_future_complete(future, 10)
                    assert future.done()
            ((result, feedbacks),) = log.wait_for(1, timeout=10)
            # The user's node is still spun by his executor alone.
            ticks: EventLog = EventLog()
            node.create_timer(0.01, lambda: ticks(1))
            ticks.wait_for(3)
    assert list(result.sequence) == [0, 1, 1, 2, 3, 5]
    assert feedbacks > 0


def test_names_resolve_as_the_nodes_would(action_server, ros_domain):
    for args, namespace, name, full in [
        ((), "", "fib", "/fib"),
        ((), "/ns", "fib", "/ns/fib"),
        ((), "/ns", "/fib", "/fib"),
        ((), "/ns", "~/fib", "/ns/users/fib"),
        (("-r", "fib:=/moved/fib"), "/ns", "fib", "/moved/fib"),
        (("-r", "__ns:=/other"), "/ns", "fib", "/other/fib"),
        (("-r", "__node:=renamed"), "/ns", "~/fib", "/ns/renamed/fib"),
    ]:
        with (
            user_node(ros_domain, *args, namespace=namespace) as node,
            Client(Fibonacci, name, node=node) as client,
        ):
            assert client.action_name == full
            # Nothing was added to the user's node.
            assert list(node.clients) == list(node.subscriptions) == []


def test_a_remapped_name_reaches_its_server(action_server, ros_domain):
    server = action_server("fibonacci", action_name="/moved/fib")
    with (
        user_node(ros_domain, "-r", "fib:=/moved/fib", namespace="/ns") as node,
        Client(Fibonacci, "fib", node=node) as client,
    ):
        assert client.call({"order": 2}, 10)
    assert len(server.wait_for("succeeded")) == 1


def test_the_domain_is_that_of_the_nodes_context(action_server, ros_domain, monkeypatch):
    action_server("fibonacci")
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain % 100 + 101))
    with user_node(ros_domain) as node, Client(Fibonacci, "fibonacci", node=node) as client:
        assert client.call({"order": 2}, 10)


def test_the_arguments_of_the_process_count_without_a_node(action_server, run_script):
    action_server("fibonacci", action_name="/robot/fibonacci")
    script = run_script(
        "from actionkit import Client\n"
        "from test_msgs.action import Fibonacci\n"
        "with Client(Fibonacci, 'fib') as client:\n"
        "    print(client.action_name, client.call({'order': 1}, 10).sequence)\n",
        *("--ros-args", "-r", "__ns:=/robot", "-r", "fib:=fibonacci", "-r", "__node:=mine"),
    )
    code, out, err = script.finish()
    assert (code, err) == (0, "")
    assert out.startswith("/robot/fibonacci array")
