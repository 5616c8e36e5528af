"""The fixture `fake_server` in pytests of its users: beside pytest-xdist, under pytest-asyncio."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

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
