"""Programs that are stopped for a while, as by a debugger or `docker pause` (C5.4).

Meanwhile the server drops them. When they go on, they believe that the server is gone, or it does
not know all of their entities any more.
"""

from __future__ import annotations

import signal
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

from actionkit._ros.workarounds.standstill import FOUND_WITHIN
from tests.conftest import NEVER, runs_nothing

_SHORT_LEASE = Path(__file__).parent / "short_lease.xml"
_AGES = (0.5, 1.5, 3.0)
"""Of goals, in seconds, when their programs are stopped. After 1 s a client subscribes to the
status: what it has made just before the stop is what servers may not find again."""
_CLIENTS = ("new", "old", "old, of a node")
_PERIOD = 0.1
_REMAINING = 5.0
"""Seconds that the goals take after that."""
_PROGRAM = """
import sys
import rclpy
from actionkit import Client
from test_msgs.action import Fibonacci

kind, order = sys.argv[1], int(sys.argv[2])
node = None
if kind.endswith("of a node"):
    rclpy.init()
    node = rclpy.create_node("users")
client = Client(Fibonacci, "fibonacci", node=node)
if kind.startswith("old"):
    client.call({"order": 0})
print("ready", flush=True)
sys.stdin.readline()
future = client.call_async({"order": order})
next(iter(future.feedback()))
print("running", flush=True)
error = future.exception(60)
print("ended as", type(error).__name__, flush=True)
for _ in range(2):
    client.call({"order": 0}, timeout=20)
with Client(Fibonacci, "fibonacci", node=node) as another:
    another.call({"order": 0}, timeout=20)
client.close()
with Client(Fibonacci, "fibonacci", node=node) as another:
    another.call({"order": 0}, timeout=20)
"""
_CALLS_AFTERWARDS = 4
_BUSY_SERVER = """
import logging, sys
logging.basicConfig(stream=sys.stdout, format="%(message)s")
from actionkit import Client, Timeouts
from test_msgs.action import Fibonacci

client = Client(Fibonacci, "fibonacci", timeouts=Timeouts(accept=60.0))
running = client.call_async({"order": 1})
sys.stdin.readline()
waiting = client.call_async({"order": 1})
print("sent", flush=True)
running.result(60)
waiting.result(60)
"""
_TOLD_WITHIN = 3.5 + FOUND_WITHIN + 3.0
"""Seconds after a standstill: the questions, a new node, and what a busy machine takes."""


@contextmanager
def stopped(programs, seconds):
    """Stop programs for so long; what is in the `with` statement happens meanwhile."""
    for program in programs:
        program.process.send_signal(signal.SIGSTOP)
    until = time.monotonic() + seconds
    yield
    wait_until(until)
    for program in programs:
        program.process.send_signal(signal.SIGCONT)


def wait_until(at):
    NEVER.wait(max(0.0, at - time.monotonic()))


def tell(program):
    """Let a program go on that waits for that."""
    program.process.stdin.write("go\n")
    program.process.stdin.flush()


@pytest.mark.parametrize(
    ("seconds", "profile", "ages"),
    [
        pytest.param(5.5, _SHORT_LEASE, _AGES[1:2], id="short lease"),
        pytest.param(25.0, None, _AGES, id="usual lease", marks=pytest.mark.long),
    ],
)
def test_goals_go_on_when_their_programs_were_stopped(
    seconds, profile, ages, action_server, run_script, monkeypatch
):
    if profile:
        monkeypatch.setenv("FASTRTPS_DEFAULT_PROFILES_FILE", str(profile))
    server = action_server("countdown", period=_PERIOD)
    order = str(int((max(ages) + seconds + _REMAINING) / _PERIOD))
    started = [
        (age, run_script(_PROGRAM, client, order))
        for age in sorted(ages, reverse=True)
        for client in _CLIENTS
    ]
    programs = [program for _, program in started]
    for program in programs:
        assert program.line() == "ready"
    stop_at = time.monotonic() + max(ages)
    for age, program in started:
        wait_until(stop_at - age)
        tell(program)
    for program in programs:
        assert program.line() == "running"
    wait_until(stop_at)
    with stopped(programs, seconds):
        pass
    ends = [(program.line(), program.finish(60)) for program in programs]
    assert [(end, code) for end, (code, _, _) in ends] == [("ended as NoneType", 0)] * len(ends), (
        ends
    )
    assert runs_nothing(server)
    server.sync()
    calls = len(programs) * (1 + _CALLS_AFTERWARDS) + 2 * len(ages)  # old clients call before
    assert server.count("executing") == calls


@pytest.mark.parametrize("back", [pytest.param(False, marks=pytest.mark.long), True])
def test_a_server_that_was_killed_meanwhile_is_lost(back, action_server, run_script, monkeypatch):
    monkeypatch.setenv("FASTRTPS_DEFAULT_PROFILES_FILE", str(_SHORT_LEASE))
    server = action_server("countdown", period=_PERIOD)
    program = run_script(_PROGRAM, "old", "600")
    assert program.line() == "ready"
    tell(program)
    assert program.line() == "running"
    with stopped([program], 5.5):
        server.kill()
        if back:
            server.restart()
    went_on = time.monotonic()
    assert program.line() == "ended as ServerLostError"
    assert time.monotonic() - went_on < _TOLD_WITHIN
    if not back:
        server.restart()
    code, out, err = program.finish(60)
    assert code == 0, (out, err)
    assert server.count("executing") == 2 + _CALLS_AFTERWARDS


@pytest.mark.long
def test_a_server_that_was_busy_all_the_time_has_lost_nothing(
    action_server, run_script, monkeypatch
):
    """It cannot be told from one that does not find us any more, so the node is replaced."""
    monkeypatch.setenv("FASTRTPS_DEFAULT_PROFILES_FILE", str(_SHORT_LEASE))
    server = action_server("blocking", gate=1)
    program = run_script(_BUSY_SERVER)
    server.wait_for("executing")
    tell(program)
    assert program.line() == "sent"
    NEVER.wait(1.5)
    with stopped([program], 5.5):
        pass
    while "replaces its node" not in (line := program.line()):
        assert line, program.finish()
    server.release(2)
    code, out, err = program.finish(60)
    assert code == 0, (out, err)
    server.sync()
    assert server.count("executing") == 2


@pytest.mark.long
def test_a_participant_of_our_own_keeps_the_names_and_the_end_of_the_users_context(
    action_server, run_script
):
    """As after a standstill, if servers do not find the user's participant any more."""
    server = action_server("never_finishes", action_name="another_name")
    program = run_script(
        """
import rclpy
from actionkit import Client
from actionkit._ros.communication import runtimes
from test_msgs.action import Fibonacci

rclpy.init(args=["--ros-args", "-r", "fibonacci:=another_name"])
runtimes._registry.unheard.add(rclpy.get_default_context())
client = Client(Fibonacci, "fibonacci")
future = client.call_async({"order": 1})
input()
rclpy.shutdown()
print(future.outcome(20).status, flush=True)
"""
    )
    server.wait_for("executing")
    tell(program)
    assert program.line() == "CANCELED"
    assert runs_nothing(server)
    assert program.finish() == (0, "", "")
