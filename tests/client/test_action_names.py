"""An action's names, and so the robot that moves, are those of rclpy's `ActionClient` (C1.2)."""

from __future__ import annotations

import itertools
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import astuple, dataclass

import pytest
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from test_msgs.action import Fibonacci, NestedMessage

from actionkit import Client
from actionkit._ros.rclpy_private.native import RCLError
from actionkit._ros.rclpy_private.release import is_kilted_or_later
from actionkit.testing import isolated_domain
from tests import forked
from tests.client.test_node import in_use

SERVICES, TOPICS = ("send_goal", "get_result", "cancel_goal"), ("feedback", "status")
ROBOTS = ("arm", "left", "left/arm", "right/arm", "ns/arm", "a/b/arm")
ROBOTS += ("planner/arm", "ns/planner/arm", "renamed/arm")
"""Each has an action server, which answers with its number."""
SERVERS = """
import sys, threading, os
import rclpy
from rclpy.action import ActionServer
from test_msgs.action import Fibonacci

def serve(name, number):
    def execute(goal):
        goal.succeed()
        return Fibonacci.Result(sequence=[number])
    return ActionServer(node, Fibonacci, name, execute)

threading.Thread(target=lambda: (sys.stdin.read(), os._exit(0)), daemon=True).start()
rclpy.init(args=[], domain_id=int(sys.argv[1]))
node = rclpy.create_node("robots")
servers = [serve(name, number) for number, name in enumerate(sys.argv[2:])]
print(flush=True)
rclpy.spin(node)
"""


def hidden(source: str, target: str, ends: tuple[str, ...] = SERVICES + TOPICS) -> list[str]:
    """Return the arguments that send an action's hidden names elsewhere."""
    pairs = (("-r", f"{source}/_action/{end}:={target}/_action/{end}") for end in ends)
    return [argument for pair in pairs for argument in pair]


def rule(*rules: str) -> list[str]:
    return [argument for rule in rules for argument in ("-r", rule)]


@dataclass(frozen=True)
class Case:
    """How a user's node gets its rules.

    Attributes:
        process: The ROS arguments of the process.
        init: Those that `rclpy.init()` is given; `None` gives it none, and it takes those.
        node: `Node(cli_args=...)`.
        name: The name that the action's client is given.
        namespace: `Node(namespace=...)`.
        takes_global: `Node(use_global_arguments=...)`.
        differs: What rclpy does, and what ActionKit does on purpose. Kilted's rclpy heeds rules
            for the whole name, so there only `ONLY_GOALS` differs.
    """

    process: list[str]
    init: list[str] | None = None
    node: list[str] | None = None
    name: str = "arm"
    namespace: str | None = None
    takes_global: bool = True
    differs: tuple[str, str] | None = None


LEFT, RIGHT = hidden("arm", "left/arm"), hidden("arm", "right/arm")
ONLY_GOALS = ("IndexError", "ResultLostError")
"""One server executes the goal and the other is asked for the result: rclpy gives an empty one."""
DEFAULT = {
    "namespace of the node": Case([], namespace="ns"),
    "hidden": Case(LEFT),
    "hidden, namespace of the node": Case(hidden("arm", "/left/arm"), namespace="ns"),
    "hidden, of a process that the node does not heed": Case(LEFT, takes_global=False),
    "hidden, init with others": Case(LEFT, init=RIGHT),
    "hidden, the node's before the process'": Case(LEFT, node=RIGHT),
    "hidden, a chain": Case(hidden("/arm", "/left/arm") + hidden("/left/arm", "/right/arm")),
    "hidden, only the services": Case(hidden("arm", "left/arm", SERVICES)),
    "hidden and whole": Case(rule("arm:=left/arm") + RIGHT),
    "whole": Case(rule("arm:=left"), differs=("arm", "left")),
}
LONG = {
    "plain": Case([]),
    "nested namespace of the node": Case([], namespace="/a/b"),
    "root as the namespace of the node": Case([], namespace="/"),
    "namespace": Case(rule("__ns:=/ns")),
    "namespace before that of the node": Case(rule("__ns:=/ns"), namespace="/a/b"),
    "namespace by init": Case([], init=rule("__ns:=/ns")),
    "namespace by init, another one of the process": Case(
        rule("__ns:=/a/b"), init=rule("__ns:=/ns")
    ),
    "namespace by a rule for this node": Case(rule("planner:__ns:=/ns", "other:__ns:=/a/b")),
    "namespace by two rules": Case(rule("__ns:=/a/b", "planner:__ns:=/ns")),
    "namespace by the node's arguments": Case([], node=rule("__ns:=/ns")),
    "private name of a renamed node": Case(rule("__node:=renamed"), name="~/arm"),
    "private name": Case([], name="~/arm"),
    "private name in a namespace": Case([], name="~/arm", namespace="ns"),
    "{node}": Case([], name="{node}/arm"),
    "{ns}": Case([], name="{ns}/arm", namespace="ns"),
    "{ns} in the root": Case([], name="{ns}/arm"),
    "absolute name": Case([], name="/arm", namespace="ns"),
    "namespace that the node does not heed": Case(rule("__ns:=/ns"), takes_global=False),
    "hidden, for this node": Case(hidden("planner:arm", "left/arm")),
    "hidden, the node's": Case([], node=LEFT),
    "hidden, init": Case([], init=LEFT),
    "hidden, of a process that init does not heed": Case(LEFT, init=[]),
    "hidden, the node's undo the process'": Case(LEFT, node=hidden("arm", "arm")),
    "hidden, for another node": Case(hidden("other:arm", "left/arm")),
    "hidden, two rules": Case(LEFT + RIGHT),
    "hidden, for this node and for all": Case(hidden("planner:arm", "left/arm") + RIGHT),
    "hidden, for all and for this node": Case(RIGHT + hidden("planner:arm", "left/arm")),
    "hidden, relative target": Case(hidden("/arm", "arm"), name="/arm", namespace="left"),
    "hidden, private source": Case(hidden("~/arm", "/left/arm"), name="~/arm"),
    "hidden, private target": Case(hidden("arm", "~/arm")),
    "hidden, absolute source": Case(hidden("/ns/arm", "/left/arm"), namespace="ns"),
    "hidden, by kind": Case(
        hidden("rosservice://arm", "left/arm", SERVICES)
        + hidden("rostopic://arm", "left/arm", TOPICS)
    ),
    "hidden, by the wrong kind": Case(
        hidden("rostopic://arm", "left/arm", SERVICES)
        + hidden("rosservice://arm", "left/arm", TOPICS)
    ),
    "hidden, only the goal service": Case(
        hidden("arm", "left/arm", ("send_goal",)), differs=ONLY_GOALS
    ),
    "hidden, only the feedback": Case(hidden("arm", "left/arm", ("feedback",))),
    "whole, of topics": Case(rule("rostopic://arm:=left"), differs=("arm", "left")),
    "whole, of services": Case(rule("rosservice://arm:=left")),
    "hidden before whole": Case(RIGHT + rule("arm:=left/arm")),
    "whole, then hidden": Case(
        rule("arm:=left/arm") + hidden("left/arm", "right/arm"), differs=("arm", "right/arm")
    ),
    "whole, of each kind": Case(
        rule("rosservice://arm:=right/arm", "rostopic://arm:=left/arm"), differs=("arm", "left/arm")
    ),
    "*": Case(rule("*/_action/send_goal:=/left/arm/_action/send_goal")),
    "**": Case(rule(r"**/_action/send_goal:=/left/\1/_action/send_goal")),
}


@pytest.fixture(scope="module")
def robots() -> Iterator[int]:
    """Start the servers, and return their domain."""
    with isolated_domain() as domain:
        command = [sys.executable, "-c", SERVERS, str(domain), *(f"/{name}" for name in ROBOTS)]
        pipe = subprocess.PIPE
        with forked.Popen(command, stdin=pipe, stdout=pipe) as process:
            assert process.stdout is not None
            assert process.stdout.readline()
            yield domain


@contextmanager
def planner(case: Case, domain: int) -> Iterator[Node]:
    """Make the user's node in a context of its own."""

    def arguments(given: list[str] | None) -> list[str] | None:
        return None if given is None else ["program", "--ros-args", *given]

    context = Context()
    context.init(arguments(case.init), domain_id=domain)
    node = Node(
        "planner",
        context=context,
        namespace=case.namespace,
        cli_args=arguments(case.node),
        use_global_arguments=case.takes_global,
        start_parameter_services=False,
    )
    with in_use(node):
        yield node


def rclpys_names(node: Node, name: str) -> set[str] | type[Exception]:
    """Return the five names that rclpy's client calls."""
    own = node.get_name(), node.get_namespace()
    try:
        client = ActionClient(node, Fibonacci, name)
    except ValueError as error:
        return type(error)
    called = node.get_client_names_and_types_by_node(*own)
    called += node.get_subscriber_names_and_types_by_node(*own)
    client.destroy()
    return {name for name, _ in called if "/_action/" in name}


def our_names(node: Node, name: str) -> set[str] | type[Exception]:
    try:
        with Client(Fibonacci, name, node=node) as client:
            assert not [*node.clients, *node.subscriptions]  # nothing is added to the user's node
            called = client._session.connection.names
            assert client.action_name == called.send_goal.removesuffix("/_action/send_goal")
            return {*astuple(called)} - {called.action}
    except ValueError as error:
        return type(error)


def rclpys_robot(node: Node, name: str) -> str:
    """Return which robot moves, or the error."""
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    client = ActionClient(node, Fibonacci, name)
    try:
        while not client.server_is_ready():
            executor.spin_once(0.01)
        goal = client.send_goal_async(Fibonacci.Goal())
        executor.spin_until_future_complete(goal)
        result = goal.result().get_result_async()
        executor.spin_until_future_complete(result)
        return ROBOTS[result.result().result.sequence[0]]
    except IndexError as error:
        return type(error).__name__
    finally:
        executor.remove_node(node)
        client.destroy()


def our_robot(node: Node, name: str) -> str:
    with Client(Fibonacci, name, node=node) as client:
        outcome = client.call_async({}, timeout=30.0).outcome()
        if outcome.result is None:
            return type(outcome.error).__name__
        return ROBOTS[outcome.result.sequence[0]]


@pytest.mark.parametrize(
    "case",
    [
        *(pytest.param(case, id=name) for name, case in DEFAULT.items()),
        *(pytest.param(case, id=name, marks=pytest.mark.long) for name, case in LONG.items()),
    ],
)
def test_the_robot_that_rclpy_would_move(case, robots, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["program", "--ros-args", *case.process])
    monkeypatch.setenv("ROS_DOMAIN_ID", str(robots))
    try:
        with monkeypatch.context() as alone:  # no earlier node is taken for this one
            alone.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
            with planner(case, robots) as node:
                rclpys, ours = rclpys_names(node, case.name), our_names(node, case.name)
    except RCLError:  # rclpy refuses the arguments, and so do we
        with pytest.raises(ValueError, match="Wildcard"):
            Client(Fibonacci, case.name)
        return
    differs = None if is_kilted_or_later() and case.differs != ONLY_GOALS else case.differs
    assert (ours == rclpys) == (differs in (None, ONLY_GOALS))
    if isinstance(rclpys, type):
        return
    with planner(case, robots) as node:
        robot = rclpys_robot(node, case.name), our_robot(node, case.name)
    assert robot == differs or (differs is None and robot[0] == robot[1])


def test_one_name_and_two_types_on_nodes_with_rules_are_two_actions(ros_domain):
    with planner(Case([], init=[]), ros_domain) as left:
        right = Node("right", context=left.context, cli_args=["--ros-args", *RIGHT])
        with (
            Client(Fibonacci, "arm", node=left) as one,
            Client(NestedMessage, "arm", node=right) as two,
        ):
            assert (one.action_name, two.action_name) == ("/arm", "/right/arm")
        right.destroy_node()


LONG_NAME = "a" * 227
"""Only the longest of its five names is too long."""
REFUSED = ("", "/", "a//b", "arm/", "arm!", "a b", "1arm", "{robot}/arm", LONG_NAME)


def test_a_refused_name_is_told(ros_domain):
    with planner(Case([], init=[]), ros_domain) as node:
        for name, given in itertools.product(REFUSED, (node, None)):
            with pytest.raises(ValueError, match=" is not a valid ROS name: ") as caught:
                Client(Fibonacci, name, node=given)
            assert str(caught.value).startswith(f"action_name={name!r}")
            assert ("/_action/cancel_goal" in str(caught.value)) == (name == LONG_NAME)
    for name in ("~/arm", "{node}/arm"):
        with pytest.raises(ValueError, match=re.escape(f"{name!r} is a name below a node, and")):
            Client(Fibonacci, name)


@pytest.mark.long
def test_a_program_that_met_a_refused_name_ends_as_it_would(run_script):
    script = run_script(
        "from actionkit import Client\n"
        "from test_msgs.action import Fibonacci\n"
        f"for name in {REFUSED}:\n"
        "    try:\n"
        "        Client(Fibonacci, name)\n"
        "    except ValueError:\n"
        "        print(name)\n",
    )
    assert script.finish() == (0, "\n".join((*REFUSED, "")), "")


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["\udcff"], "not UTF-8"),
        (["--ros-args", "--params-file", "/not/there.yaml"], "/not/there.yaml"),
        (["--ros-args", "--unknown"], "--unknown"),
        (["--ros-args", "-r", "a:=b:=c"], "a:=b:=c"),
    ],
)
def test_arguments_that_ros_refuses_count_only_where_they_are_used(
    arguments, reason, ros_domain, monkeypatch
):
    monkeypatch.setattr(sys, "argv", ["program", *arguments])
    with planner(Case([], init=[]), ros_domain) as node, Client(Fibonacci, "arm", node=node):
        pass
    with pytest.raises(ValueError, match=re.escape(reason)) as caught:
        Client(Fibonacci, "arm")
    assert f"sys.argv={sys.argv!r}" in str(caught.value)
    assert "rclpy.init(args=" in str(caught.value)  # the remedy


@pytest.mark.long
def test_a_node_that_cannot_be_used_is_told(ros_domain):
    with planner(Case([], init=[]), ros_domain) as node:
        node.destroy_node()
        with pytest.raises(ValueError, match=r"node=.* was destroyed: give one that is in use"):
            Client(Fibonacci, "arm", node=node)
        other = Node("planner", context=node.context)
        other.context.shutdown()
        with pytest.raises(ValueError, match=r"context of node=.* was shut down: give"):
            Client(Fibonacci, "arm", node=other)
        other.destroy_node()
