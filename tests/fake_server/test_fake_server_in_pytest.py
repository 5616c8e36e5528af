"""The fixture `fake_server` in pytests of its users: beside pytest-xdist, under pytest-asyncio."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from actionkit.servers import Server

PLAIN = """
import pytest
from test_msgs.action import Fibonacci
from actionkit import Client

@pytest.mark.parametrize("number", range(4))
def test_each_has_its_own(fake_server, number):
    server = fake_server(Fibonacci, "fibonacci", result={"sequence": [number]})
    with Client(Fibonacci, "fibonacci") as client:
        assert list(client.call({"order": number}, timeout=30.0).sequence) == [number]
    assert [goal.order for goal in server.goals] == [number]
"""
ASYNCIO = """
import asyncio
import pytest
from test_msgs.action import Fibonacci
from actionkit import Client

async def test_results(fake_server):
    server = fake_server(Fibonacci, "fibonacci", result={"sequence": [5]})
    async with Client(Fibonacci, "fibonacci") as client:
        futures = [client.call_async({"order": n}, timeout=30.0) for n in (1, 2)]
        both = await asyncio.gather(*futures)
    assert [list(result.sequence) for result in both] == [[5], [5]]
    assert [goal.order for goal in server.goals] == [1, 2]

async def test_cancelling_a_task(fake_server):
    server = fake_server(Fibonacci, "fibonacci", end="never")
    async with Client(Fibonacci, "fibonacci") as client:
        async def mission():
            await client.call_async({}, timeout=30.0)
        task = asyncio.create_task(mission())
        await asyncio.to_thread(server.wait_for, "executing")
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
    server.wait_for("canceled")
"""
RAISING = """
import pytest
from test_msgs.action import Fibonacci
from actionkit import Client, GoalAbortedError

def check(goal):
    assert goal.order == 7, "the wrong goal came"

@pytest.fixture
def client(fake_server):
    fake_server(Fibonacci, "fibonacci", result=check)
    with Client(Fibonacci, "fibonacci") as client:
        yield client

def test_it_is_an_error_of_the_test(client):
    with pytest.raises(GoalAbortedError):
        client.call({"order": 6}, timeout=30.0)

def test_nothing_is_left_of_it(client):
    client.call({"order": 7}, timeout=30.0)
"""

BESIDE_A_ROBOT = """
import os
import unittest
import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from test_msgs.action import Fibonacci
from actionkit import Client
from actionkit.testing import FakeServer, isolated_domain

ROBOT = int(os.environ["ROS_DOMAIN_ID"])
OTHERS = [5]

def initialised():
    rclpy.init()
    node = Node("under_test")
    yield node
    node.destroy_node()
    rclpy.shutdown()

@pytest.fixture
def node():
    yield from initialised()

@pytest.fixture
def node_in_domain(ros_domain):
    yield from initialised()

@pytest.fixture
def node_of_own_context():
    context = Context()
    context.init(domain_id=ROBOT)
    node = Node("under_test", context=context)
    yield node
    node.destroy_node()
    context.shutdown()

@pytest.fixture(scope="class")
def early_client():
    with Client(Fibonacci, "pick") as client:
        yield client

@pytest.fixture(scope="class")
def reserved():
    with isolated_domain() as domain:
        rclpy.init(domain_id=domain)
        yield domain
        rclpy.shutdown()

def call(fake_server, **how):
    fake_server(Fibonacci, "pick", result={"sequence": OTHERS})
    with Client(Fibonacci, "pick", **how) as client:
        assert list(client.call({"order": 3}, timeout=30.0).sequence) == OTHERS

def test_error_node_first(node, fake_server):
    call(fake_server, node=node)

def test_error_own_context(node_of_own_context, fake_server):
    call(fake_server, node=node_of_own_context)

class TestErrorClient:
    def test_error_client_first(self, early_client, fake_server):
        fake_server(Fibonacci, "pick", result={"sequence": OTHERS})
        early_client.call({"order": 3}, timeout=30.0)

@pytest.mark.usefixtures("action_server")
class TestErrorClass(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rclpy.init()

    @classmethod
    def tearDownClass(cls):
        rclpy.shutdown()

    def test_error_class(self):
        with Client(Fibonacci, "pick") as client:
            client.call({"order": 3}, timeout=30.0)

@pytest.mark.parametrize("again", range(2))
def test_domain_first(node_in_domain, fake_server, again):
    call(fake_server, node=node_in_domain)

class TestReserved:
    def test_whole_class(self, reserved, fake_server, ros_domain):
        assert ros_domain == reserved
        call(fake_server)

def test_refused_later(fake_server, node_of_own_context, monkeypatch):
    refused = {"match": f"but this would go to domain {ROBOT}, where a real robot may be"}
    with pytest.raises(RuntimeError, **refused):
        Client(Fibonacci, "pick", node=node_of_own_context)
    with pytest.raises(RuntimeError, **refused):
        FakeServer(Fibonacci, "pick", domain_id=ROBOT).start()
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ROBOT))
    with pytest.raises(RuntimeError, **refused):
        Client(Fibonacci, "pick")
    rclpy.init()
    try:
        with pytest.raises(RuntimeError, **refused):
            Client(Fibonacci, "pick")
    finally:
        rclpy.shutdown()

def test_without_the_fixtures(node):
    with pytest.raises(RuntimeError, match=f"up in domain {ROBOT}"), isolated_domain():
        pass
"""


def run_pytest(folder: Path, source: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    (folder / "test_users.py").write_text(source)
    (folder / "pytest.ini").write_text("[pytest]\n")
    if "no:asyncio" not in arguments:
        arguments += ("-o", "asyncio_default_fixture_loop_scope=function")
    command = [sys.executable, "-m", "pytest", "-q", "-W", "error", "-p", "no:cacheprovider"]
    ignored = ["-W", "ignore:module 'sre_:DeprecationWarning"]  # lark, which rclpy imports
    # Options for the run of these tests are none for that of a user's.
    env = {name: value for name, value in os.environ.items() if name != "PYTEST_ADDOPTS"}
    return subprocess.run(
        [*command, *ignored, *arguments],
        cwd=folder,
        env=env,
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )


@pytest.mark.long
def test_beside_xdist_and_what_a_function_raises_is_an_error_of_the_test(tmp_path: Path) -> None:
    done = run_pytest(tmp_path, PLAIN + RAISING, "-n", "2", "-p", "no:asyncio")
    assert "6 passed, 1 error" in done.stdout, done.stdout + done.stderr
    assert "ERROR at teardown of test_it_is_an_error_of_the_test" in done.stdout
    assert "AssertionError: the wrong goal came" in done.stdout
    assert 'assert goal.order == 7, "the wrong goal came"' in done.stdout


def test_under_asyncio(tmp_path: Path) -> None:
    """In its mode `auto`; the tests in docs/testing.md run in its mode `strict`."""
    done = run_pytest(tmp_path, ASYNCIO, "--asyncio-mode=auto", "-p", "no:xdist")
    assert "2 passed" in done.stdout, done.stdout + done.stderr


def test_no_test_moves_a_robot(action_server: Callable[..., Server], tmp_path: Path) -> None:
    """Contexts that were initialised before the test had its domain stay in that of the robot."""
    robot = action_server("fibonacci", action_name="pick")
    done = run_pytest(tmp_path, BESIDE_A_ROBOT, "-p", "no:asyncio", "-p", "no:xdist")
    robot.sync()
    assert [event for event in robot.events if event.event == "accepted"] == []
    told = re.findall(r"^ERROR .*::test_error_(\w+)", done.stdout, re.MULTILINE)
    assert sorted(told) == ["class", "client_first", "node_first", "own_context"], done.stdout
    assert "5 passed, 4 errors" in done.stdout, done.stdout
    assert done.stdout.count("as in `def node(ros_domain): rclpy.init()`") >= 4
