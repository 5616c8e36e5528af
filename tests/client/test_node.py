"""`node=`: names as that node's, and calls from inside its callbacks (C1.1, C1.2)."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import pytest
import rclpy
from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from test_msgs.action import Fibonacci, NestedMessage
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


FIVE = ("send_goal", "get_result", "cancel_goal", "feedback", "status")


def rules(source: str, target: str) -> list[str]:
    """Return the arguments that send an action's hidden names elsewhere."""
    pairs = (("-r", f"{source}/_action/{end}:={target}/_action/{end}") for end in FIVE)
    return [argument for pair in pairs for argument in pair]


@pytest.mark.parametrize(
    ("of_context", "of_node", "full"),
    [
        (rules("arm", "left/arm"), None, "/ns/left/arm"),
        (rules("users:arm", "/left"), None, "/left"),
        (rules("other:arm", "/left"), None, "/ns/arm"),
        ([], rules("arm", "/left"), "/left"),
        (rules("arm", "/left"), rules("arm", "/right"), "/right"),
        (rules("arm", "/left"), rules("arm", "arm"), "/ns/arm"),
        (rules("/ns/arm", "/left") + rules("/left", "/right"), None, "/left"),
        (["-r", "arm:=/left", *rules("arm", "/right")], None, "/right"),
        (["-r", "arm:=/left"], None, "/left"),
    ],
)
def test_the_nodes_rules_for_the_five_names_count(of_context, of_node, full, ros_domain):
    cli = ["--ros-args", *of_node] if of_node else None
    with user_node(ros_domain, *of_context) as other:
        node = Node("users", context=other.context, namespace="/ns", cli_args=cli)
        with Client(Fibonacci, "arm", node=node) as client:
            assert client.action_name == full
            assert {c.srv_name for c in client._session.port.runtime.node.clients} == {
                f"{full}/_action/{end}" for end in FIVE[:3]
            }
        node.destroy_node()


def test_rules_of_the_process_that_the_node_does_not_have_do_not_count(action_server, run_script):
    server = action_server("fibonacci", action_name="/arm")
    script = run_script(
        "import rclpy\n"
        "from actionkit import Client\n"
        "from test_msgs.action import Fibonacci\n"
        "rclpy.init(args=[])\n"
        "with Client(Fibonacci, 'arm', node=rclpy.create_node('planner')) as client:\n"
        "    print(client.action_name, client.call({'order': 1}, 10).sequence)\n",
        *("--ros-args", *rules("arm", "/left")),
    )
    assert script.finish()[:2] == (0, "/arm array('i', [0, 1])\n")
    assert len(server.wait_for("succeeded")) == 1


def test_one_name_and_two_types_on_nodes_with_rules_are_two_actions(ros_domain):
    with user_node(ros_domain) as left:
        arguments = ["--ros-args", *rules("arm", "/right")]
        right = Node("right", context=left.context, cli_args=arguments)
        with (
            Client(Fibonacci, "arm", node=left) as one,
            Client(NestedMessage, "arm", node=right) as two,
        ):
            assert (one.action_name, two.action_name) == ("/arm", "/right")
        right.destroy_node()


@pytest.mark.parametrize("name", ["a//b", "arm!", "a b", "a" * 227, "~/arm", "{node}/arm"])
def test_a_refused_name_without_a_node_ends_nothing_else(name, run_script):
    script = run_script(
        "from actionkit import Client\n"
        "from test_msgs.action import Fibonacci\n"
        "try:\n"
        f"    Client(Fibonacci, {name!r})\n"
        "except ValueError as error:\n"
        "    print(error)\n",
    )
    code, output, errors = script.finish()
    assert (code, errors) == (0, "")
    assert output.startswith(f"action_name={name!r} is ")


def test_our_node_is_in_the_context_of_the_users(ros_domain):
    with (
        user_node(ros_domain) as one,
        user_node(ros_domain) as two,
        Client(Fibonacci, "fibonacci", node=one) as first,
        Client(Fibonacci, "fibonacci", node=two) as second,
        Client(Fibonacci, "fibonacci", node=one) as third,
    ):
        runtimes = [client._session.port.runtime for client in (first, second, third)]
        assert [runtime.context for runtime in runtimes] == [one.context, two.context, one.context]
        assert runtimes[0] is runtimes[2]
        for client in (first, second, third):
            client.close()
        # The user's nodes go on: what listens for their discovery was left alone.
        assert one.context.ok()
        other = Node("other", context=two.context)
        assert_sees(one, other)
        other.destroy_node()


def assert_sees(node: Node, other: Node) -> None:
    until = time.monotonic() + 10
    while other.get_name() not in node.get_node_names():
        assert time.monotonic() < until
        time.sleep(0.02)


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
