"""The reader of topics on the communication thread, and the look for goals that uses it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from action_msgs.msg import GoalStatus, GoalStatusArray
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import String

from actionkit._ros.communication import runtimes
from actionkit._ros.others_goals import topic as topics
from actionkit._ros.others_goals import watch
from actionkit._ros.others_goals.topic import Reading, TopicReader, latest
from actionkit._ros.others_goals.watch import goals_in_flight
from actionkit._ros.rclpy_private.native import RCLError
from actionkit._ros.rclpy_private.wait_set import MessageSource
from actionkit.testing import isolated_domain
from tests.waiting import until

STRING = "std_msgs/msg/String"
KEPT = QoSProfile(
    depth=3,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
LOSSY = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
ACCEPTED, EXECUTING, CANCELING, SUCCEEDED, ABORTED = 1, 2, 3, 4, 6


@pytest.fixture
def robot(ros_domain: int) -> Iterator[Node]:
    """Return a node of another participant."""
    context = Context()
    context.init(None, domain_id=ros_domain)
    node = Node("robot", context=context, use_global_arguments=False)
    yield node
    node.destroy_node()
    context.shutdown()


@pytest.fixture
def domain(ros_domain: int, robot: Node) -> Iterator[int]:
    """Return the domain, in which we have a node that has found the robot's."""
    user = object()
    runtime = runtimes.acquire(ros_domain, user)
    until(lambda: "robot" in runtime.node.get_node_names())
    yield ros_domain
    runtimes.release(runtime, user)
    runtime.join_if_stopping(20.0)


def read(domain: int, topic: str, timeout: float = 20.0, max_age: float | None = None) -> Reading:
    return latest(domain, topic, STRING, String, timeout, max_age, lambda: False)


class Later:
    """Calls a function on another thread."""

    def __init__(self, function: Callable[[], Any]) -> None:
        self._function = function
        self.result: Any = None
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        try:
            self.result = self._function()
        except Exception as error:  # noqa: BLE001  for the test to look at
            self.result = error

    def end(self, bound: float = 20.0) -> Any:
        self._thread.join(bound)
        assert not self._thread.is_alive()
        return self.result


def test_each_publisher_is_read_as_it_offers(domain: int, robot: Node) -> None:
    # To ask both for the least would miss what is kept; to ask both for the most would miss what
    # is lossy.
    kept, lossy = (robot.create_publisher(String, "mixed", qos) for qos in (KEPT, LOSSY))
    kept.publish(String(data="kept"))
    reading = read(domain, "mixed")
    assert (reading.message.data, reading.publishers, reading.other_types) == ("kept", 2, ())
    robot.destroy_publisher(kept)
    waiting = Later(lambda: read(domain, "mixed"))
    until(lambda: lossy.get_subscription_count() > 0)
    lossy.publish(String(data="lossy"))
    assert waiting.end().message.data == "lossy"
    until(lambda: lossy.get_subscription_count() == 0)  # it is subscribed to only while asked


def test_the_newest_is_returned_unless_it_is_too_old(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each publisher keeps a message of its own, and they come in any order."""
    second = 1_000_000_000

    class Two:
        publishers, keeps, other_types = 2, True, frozenset[str]()

        def __init__(self, *_: object) -> None:
            pass

        def arriving(self, stopped: object) -> Iterator[list[topics.Stamped]]:
            now = time.time_ns()
            yield [(now - ago * second, f"{ago} s ago".encode()) for ago in (20, 10, 30)]

        def close(self) -> None:
            pass

    monkeypatch.setattr(topics, "TopicReader", Two)
    monkeypatch.setattr(topics, "deserialize_message", lambda message, cls: message.decode())
    newest = read(0, "kept")
    assert newest.message == "10 s ago"
    assert newest.age is not None
    assert newest.age >= 10
    assert read(0, "kept", max_age=15.0).message == "10 s ago"
    assert read(0, "kept", max_age=5.0) == Reading(None, None, 2, ())


def test_one_that_keeps_its_messages_and_goes_on_ends_the_reading(domain: int, robot: Node) -> None:
    publisher = robot.create_publisher(String, "busy", KEPT)
    over = threading.Event()

    def go_on() -> None:
        while not over.wait(0.02):
            publisher.publish(String(data="x"))

    going = Later(go_on)
    began = time.monotonic()
    assert read(domain, "busy", timeout=60.0).message.data == "x"
    assert time.monotonic() - began < 20.0
    over.set()
    going.end()


def test_nothing_is_taken_or_decoded_on_the_communication_thread(
    domain: int, robot: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    threads: list[threading.Thread] = []

    decoded = 0

    def deserialize(raw: bytes, cls: Any) -> Any:
        nonlocal decoded
        decoded += 1
        threads.append(threading.current_thread())
        return deserialize_message(raw, cls)

    def take_stamped(source: MessageSource, most: int) -> list[tuple[int, bytes]]:
        threads.append(threading.current_thread())
        return taken(source, most)

    deserialize_message, taken = topics.deserialize_message, MessageSource.take_stamped
    monkeypatch.setattr(MessageSource, "take_stamped", take_stamped)
    monkeypatch.setattr(topics, "deserialize_message", deserialize)
    publisher = robot.create_publisher(String, "some", KEPT)
    for text in ("first", "second", "latest"):
        publisher.publish(String(data=text))
    assert read(domain, "some").message.data == "latest"
    assert set(threads) == {threading.current_thread()}
    assert decoded == 1


def test_another_domain_than_the_environments(
    domain: int, robot: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot.create_publisher(String, "some", KEPT).publish(String(data="here"))
    with isolated_domain() as other:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(other))
        assert read(domain, "some").message.data == "here"


def entry(number: int, code: int, stamp: int = 0) -> GoalStatus:
    """Return what a server tells of a goal; the stamp is its own, of the goal's acceptance."""
    status = GoalStatus(status=code)
    status.goal_info.stamp.nanosec = stamp
    status.goal_info.goal_id.uuid = [number] * 16
    return status


@pytest.fixture
def servers(robot: Node) -> list[Any]:
    """Return what two servers on one name tell of goals with, as others offer it."""
    qos = (KEPT, QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    return [robot.create_publisher(GoalStatusArray, "/a/_action/status", one) for one in qos]


def in_flight(domain: int) -> list[tuple[str, str]]:
    found = goals_in_flight(domain, "/a/_action/status", lambda: False)
    return sorted((goal.goal_id[:2], goal.state) for goal in found)


def test_the_goals_of_all_servers_on_a_name(domain: int, servers: list[Any]) -> None:
    one, two = servers
    one.publish(GoalStatusArray(status_list=[entry(1, EXECUTING), entry(2, SUCCEEDED)]))
    two.publish(GoalStatusArray(status_list=[entry(3, ACCEPTED)]))
    assert in_flight(domain) == [("01", "EXECUTING"), ("03", "ACCEPTED")]
    # What was published last counts, whichever comes first.
    two.publish(GoalStatusArray(status_list=[entry(1, SUCCEEDED), entry(3, EXECUTING)]))
    assert in_flight(domain) == [("03", "EXECUTING")]
    one.publish(GoalStatusArray(status_list=[entry(1, EXECUTING)]))
    assert in_flight(domain) == [("01", "EXECUTING"), ("03", "EXECUTING")]
    # With stamps, what has ended on one of them runs on the other, whoever tells last.
    two.publish(GoalStatusArray(status_list=[entry(1, SUCCEEDED, stamp=2), entry(3, EXECUTING)]))
    assert in_flight(domain) == [("01", "EXECUTING"), ("03", "EXECUTING")]
    one.publish(GoalStatusArray(status_list=[entry(1, CANCELING)]))
    assert in_flight(domain) == [("01", "CANCELING"), ("03", "EXECUTING")]
    one.publish(GoalStatusArray(status_list=[entry(1, ABORTED)]))
    assert in_flight(domain) == [("03", "EXECUTING")]


def test_each_of_several_servers_has_time_to_tell(
    domain: int, servers: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What has ended on the one that told first may run on another."""
    monkeypatch.setattr(watch, "SETTLE", 0.0)
    one, two = servers
    one.publish(GoalStatusArray(status_list=[entry(1, SUCCEEDED)]))
    looking = Later(lambda: in_flight(domain))
    until(lambda: two.get_subscription_count() > 0)
    two.publish(GoalStatusArray(status_list=[entry(1, EXECUTING)]))
    assert looking.end() == [("01", "EXECUTING")]


def test_at_the_end_of_its_time_a_look_returns_what_has_come(
    domain: int, servers: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(watch, "FIRST", 60.0)
    one, _ = servers
    one.publish(GoalStatusArray(status_list=[entry(1, EXECUTING)]))
    at_once = watch.goals_seen(domain, "/a/_action/status", lambda: False, time.monotonic() + 4.0)
    assert [goal.state for goal in at_once] == ["EXECUTING"]


def test_servers_that_keep_nothing_are_heard(domain: int, robot: Node) -> None:
    lossy = robot.create_publisher(GoalStatusArray, "/a/_action/status", LOSSY)
    looking = Later(lambda: in_flight(domain))
    until(lambda: lossy.get_subscription_count() > 0)
    lossy.publish(GoalStatusArray(status_list=[entry(1, EXECUTING)]))
    assert looking.end() == [("01", "EXECUTING")]


@pytest.mark.long
def test_a_look_that_fails_is_no_look(
    domain: int, servers: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else goals of others would not count."""
    runtime = runtimes.acquire(domain, runtimes)
    try:
        with monkeypatch.context() as patch:
            broken = lambda topic: 1 / 0  # noqa: E731
            patch.setattr(runtime.node, "get_publishers_info_by_topic", broken)
            with pytest.raises(ZeroDivisionError):
                in_flight(domain)
        # No server has told of a goal, so that it takes a second.
        looking = Later(lambda: in_flight(domain))
        until(lambda: servers[0].get_subscription_count() > 0)
        runtime.call_soon(die)
        assert "was stopped" in str(looking.end())
    finally:
        runtimes.release(runtime, runtimes)
    assert in_flight(domain) == []


def die() -> None:
    raise SystemExit("for the test")  # what no handler of ours catches


def test_the_first_look_is_over_before_its_result_counts(
    domain: int, servers: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A communication thread that is busy does not mean that there is no server."""
    servers[0].publish(GoalStatusArray(status_list=[entry(1, EXECUTING)]))
    monkeypatch.setattr(watch, "DISCOVERY", 0.0)
    runtime = runtimes.acquire(domain, runtimes)
    busy = threading.Event()
    runtime.call_soon(lambda: (busy.wait(1.0), None)[1])
    assert in_flight(domain) == [("01", "EXECUTING")]
    runtimes.release(runtime, runtimes)


@pytest.mark.parametrize("how", ["stopped", "ROS was shut down"])
def test_a_reading_ends_when_it_is_stopped(domain: int, robot: Node, how: str) -> None:
    quiet = robot.create_publisher(String, "quiet", 10)
    stop = threading.Event()
    reading = Later(lambda: latest(domain, "quiet", STRING, String, 600.0, None, stop.is_set))
    until(lambda: quiet.get_subscription_count() > 0)
    runtime = runtimes.acquire(domain, runtimes)
    if how == "stopped":
        stop.set()
    else:
        runtime.context.try_shutdown()
    assert isinstance(reading.end(), (RuntimeError, RCLError))
    until(lambda: quiet.get_subscription_count() == 0)
    runtimes.release(runtime, runtimes)


@pytest.mark.parametrize("error", [KeyboardInterrupt, RCLError])
def test_a_reader_that_cannot_begin_says_so_and_leaves_nothing(
    domain: int, error: type[BaseException]
) -> None:
    runtime = runtimes.acquire(domain, runtimes)
    users = len(runtime._users)

    def fail(_: Node) -> None:
        raise error("for the test")

    with pytest.raises(error):
        TopicReader(domain, "quiet", STRING, String, on_look=fail)
    assert runtime.run(lambda: len(runtime._users)) == users
    runtimes.release(runtime, runtimes)
