"""`node=`: its context, and calls from inside its callbacks (C1.1, C1.2)."""

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
from test_msgs.msg import Empty as EmptyMessage
from test_msgs.srv import Empty

from actionkit import Client, ClientClosedError
from actionkit._ros.communication import own_node, runtimes
from actionkit._ros.sending import connection
from actionkit._ros.workarounds.listener_hang import stop_listening
from actionkit.testing import EventLog
from tests.conftest import all_is_logged, until_shutdown
from tests.waiting import until


@contextmanager
def user_node(domain: int, *args: str, namespace: str = "") -> Iterator[Node]:
    context = Context()
    context.init(["--ros-args", *args] if args else [], domain_id=domain)
    with in_use(Node("users", context=context, namespace=namespace)) as node:
        yield node


@contextmanager
def in_use(node: Node) -> Iterator[Node]:
    """Destroy a node at the end, and shut down its context."""
    try:
        yield node
    finally:
        with suppress(InvalidHandle):  # the test has destroyed it
            stop_listening(node)
            node.destroy_node()
        node.context.try_shutdown()


class OtherNode:
    """A node that is no `Node`, as rclpy's AsyncNode."""

    def __init__(self, node: Node) -> None:
        self.context, self.handle = node.context, node.handle
        self.get_fully_qualified_name = node.get_fully_qualified_name
        self.resolve_service_name = node.resolve_service_name
        self.resolve_topic_name = node.resolve_topic_name


def test_a_node_of_another_kind_will_do(action_server, ros_domain):
    action_server("fibonacci", action_name="/robot/fibonacci")
    with (
        user_node(ros_domain, namespace="robot") as node,
        Client(Fibonacci, "fibonacci", node=OtherNode(node)) as client,
    ):
        assert len(client.call({"order": 3}, timeout=20).sequence) == 4


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


@pytest.mark.parametrize("spin", ["single", "rclpy.spin", "multi"])
@pytest.mark.parametrize("where", ["timer", "thread", "service"])
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


def test_our_node_is_in_the_context_of_the_users(ros_domain):
    with (
        user_node(ros_domain) as one,
        user_node(ros_domain) as two,
        Client(Fibonacci, "fibonacci", node=one) as first,
        Client(Fibonacci, "fibonacci", node=two) as second,
        Client(Fibonacci, "fibonacci", node=one) as third,
    ):
        runtimes = [client._session.connection.runtime for client in (first, second, third)]
        assert [runtime.context for runtime in runtimes] == [one.context, two.context, one.context]
        assert runtimes[0] is runtimes[2]
        for client in (first, second, third):
            client.close()
        # The user's nodes go on: what listens for their discovery was left alone.
        assert one.context.ok()
        two.create_publisher(EmptyMessage, "news", 1)
        until(lambda: one.count_publishers("/news"), bound=10.0)


def test_only_the_last_node_of_a_context_stops_listening(ros_domain, monkeypatch):
    """Else the user's nodes would discover nobody any more; and Fast DDS may hang (see there)."""
    stopped: list[str] = []
    monkeypatch.setattr(own_node, "stop_listening", lambda node: stopped.append(node.get_name()))
    with user_node(ros_domain) as users:
        for is_last in (False, True):
            with Client(Fibonacci, "fibonacci", node=users) as client:
                runtime = client._session.connection.runtime
                name = runtime.node.get_name()
                if is_last:
                    users.destroy_node()
            runtime.join(20)
            # A runtime of an earlier test may end just now, too.
            assert stopped.count(name) == is_last


@pytest.mark.parametrize(
    ("where", "name"),
    [(runtimes, "acquire"), (runtimes.Runtime, "expect_more"), (connection, "Link")],
)
def test_a_context_that_is_shut_down_while_a_client_is_made(
    where, name, ros_domain, monkeypatch, caplog
):
    step = getattr(where, name)
    with user_node(ros_domain) as node:

        def after_shutdown(*args: object) -> object:
            node.context.shutdown()
            return step(*args)

        monkeypatch.setattr(where, name, after_shutdown)
        with pytest.raises(ValueError, match="was shut down while the client was made: make it"):
            Client(Fibonacci, "fibonacci", node=node)
    assert all_is_logged()
    assert not caplog.records  # the communication thread has not died


def test_a_context_that_is_shut_down_when_a_client_is_just_made(ros_domain, monkeypatch, caplog):
    step = connection.Link
    with user_node(ros_domain) as node:

        def before_shutdown(*args: object) -> object:
            link = step(*args)
            node.context.shutdown()
            return link

        monkeypatch.setattr(connection, "Link", before_shutdown)
        client = Client(Fibonacci, "fibonacci", node=node)
        with client, pytest.raises(ClientClosedError, match="context of its client's node was"):
            client.call({"order": 1})
    assert all_is_logged()
    assert not caplog.records  # the communication thread has not died: all was made before


def test_the_domain_is_that_of_the_nodes_context(action_server, ros_domain, monkeypatch):
    action_server("fibonacci")
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain % 100 + 101))
    with user_node(ros_domain) as node, Client(Fibonacci, "fibonacci", node=node) as client:
        assert client.call({"order": 2}, 10)


ONE_PARTICIPANT = """
<profiles xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <participant profile_name="fixed" is_default_profile="true">
    <rtps><prefix>72.61.73.70.66.61.72.6d.74.65.73.74</prefix></rtps>
  </participant>
</profiles>
"""


@pytest.mark.long
def test_a_profile_that_allows_one_participant(action_server, run_script, tmp_path, monkeypatch):
    """A second one in the process would have the same id; Fast DDS refuses it, and crashes."""
    action_server("fibonacci")
    profile = tmp_path / "profile.xml"
    profile.write_text(ONE_PARTICIPANT, "utf-8")
    monkeypatch.setenv("FASTRTPS_DEFAULT_PROFILES_FILE", str(profile))
    script = run_script(
        "import rclpy\n"
        "from actionkit import Client\n"
        "from test_msgs.action import Fibonacci\n"
        "rclpy.init()\n"
        "node = rclpy.create_node('planner')\n"
        "with Client(Fibonacci, 'fibonacci', node=node) as client:\n"
        "    print(client.call({'order': 1}, 10).sequence)\n"
        "node.destroy_node()\n"
        "rclpy.shutdown()\n"
    )
    assert script.finish() == (0, "array('i', [0, 1])\n", "")


@pytest.mark.long
def test_without_a_node_the_arguments_of_init_count_then_those_of_the_process(
    action_server, run_script
):
    action_server("fibonacci", action_name="/robot/fibonacci")
    script = run_script(
        "import rclpy\n"
        "from actionkit import Client\n"
        "from test_msgs.action import Fibonacci\n"
        "rclpy.init(args=['--ros-args', '-r', '__ns:=/ns'])\n"
        "print(Client(Fibonacci, 'fib').action_name)\n"
        "rclpy.shutdown()\n"
        "with Client(Fibonacci, 'fib') as client:\n"
        "    print(client.action_name, client.call({'order': 1}, 10).sequence)\n",
        *("--ros-args", "-r", "__ns:=/robot", "-r", "fib:=fibonacci", "-r", "__node:=mine"),
    )
    code, out, err = script.finish()
    assert (code, err) == (0, "")
    assert out.startswith("/ns/fib\n/robot/fibonacci array")
