"""`actionkit stop`, beside goals and agents of other processes. Contract C10.4."""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from test_msgs.action import Fibonacci

from actionkit import Client, GoalFuture, GoalState, servers
from actionkit._ros.holds import view
from actionkit._ros.holds.ours import new_hold
from actionkit._ros.holds.state import HoldState
from actionkit.agents._tool_calls.hold import HoldListener
from actionkit.cli._shared.exits import Exit
from actionkit.servers import Server
from tests import forked
from tests.cli.conftest import World
from tests.holding import AGENT, end_keepers, keepers, known
from tests.waiting import until

LONG = 30.0


@pytest.fixture
def world(empty_world: World) -> Iterator[World]:
    """A domain for each test: what stops everything must not find another test's goals."""
    yield empty_world
    end_keepers(empty_world.domain)


@pytest.fixture
def goals(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Callable[[str, int], list[GoalFuture[Any, Any]]]]:
    """Send goals to servers of the world, which nobody waits for in the end."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(world.domain))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    sent: list[GoalFuture[Any, Any]] = []
    with ExitStack() as stack:

        def send(name: str, count: int) -> list[GoalFuture[Any, Any]]:
            client = stack.enter_context(Client(Fibonacci, name, on_close="abandon"))
            assert client.wait_for_server(LONG)
            futures = [client.call_async(Fibonacci.Goal(order=900)) for _ in range(count)]
            sent.extend(futures)
            return futures

        yield send
    for future in sent:
        future.outcome(LONG)  # else each is complained of that nobody asks


@pytest.fixture
def agent(world: World, monkeypatch: pytest.MonkeyPatch) -> Iterator[HoldListener]:
    monkeypatch.setattr(view, "SETTLE", 0.5)  # nobody holds the domain before the test
    listener = HoldListener(world.domain)
    assert known(listener, LONG)
    yield listener
    listener.close()


def numbers(text: str) -> dict[str, list[str]]:
    """Return the columns of numbers of a table, by the action."""
    rows = [line.split() for line in text.splitlines() if line.startswith("/")]
    return {row[0]: row[-5:] for row in rows if len(row) == 7}


def one_of_ten(world: World, number: int) -> Server:
    server = servers.start("never_finishes", action_name=f"n{number}", domain_id=world.domain)
    return world.stack.enter_context(server)


def test_the_goals_of_three_servers(
    world: World, agent: HoldListener, goals: Callable[..., list[GoalFuture[Any, Any]]]
) -> None:
    assert agent.why_held() is None
    three = [one_of_ten(world, number) for number in (10, 11, 12)]
    sent = [future for number in (10, 11, 12) for future in goals(f"n{number}", 2)]
    for server in three:
        server.wait_for("accepted", count=2, timeout=LONG)
    done = world.run_apart("stop", "--timeout", "9")
    assert done.code == Exit.OK, done
    rows = numbers(done.out)
    for number, server in zip((10, 11, 12), three, strict=True):
        assert rows[f"/n{number}"] == ["2", "2", "-", "-", "-"]
        server.sync()
        assert not server.running()
    for future in sent:
        assert future.outcome(LONG).status is GoalState.CANCELED
    assert "A human has stopped the robot" in (agent.why_held() or "")
    assert world.run_apart("stop", "--release").code == Exit.OK
    assert agent.why_held() is None


def test_a_server_that_stands_still_is_out_of_sight_and_its_client_is_not(
    world: World, goals: Callable[..., list[GoalFuture[Any, Any]]]
) -> None:
    server, still = one_of_ten(world, 14), one_of_ten(world, 15)
    goals("n14", 1)
    goals("n15", 1)
    for each in (server, still):
        each.wait_for("accepted", timeout=LONG)
    still.pause()
    done = world.run_apart("stop", "--timeout", "9")
    assert done.code == Exit.CANCEL_UNKNOWN, done
    assert numbers(done.out)["/n14"] == ["1", "1", "-", "-", "-"]
    assert "/n15: no server answered. GOALS MAY STILL BE RUNNING." in done.out
    cancel = world.run_apart("cancel", "n15", "--all", "--server-timeout", "4")
    assert cancel.code == Exit.CANCEL_UNKNOWN
    assert "If its server hangs, GOALS MAY STILL BE RUNNING." in cancel.err
    still.resume()
    assert world.run_apart("stop", "--timeout", "9").code == Exit.OK
    assert world.run_apart("stop", "--release").code == Exit.OK


def test_goals_are_cancelled_even_if_nothing_can_be_told(
    world: World, goals: Callable[..., list[GoalFuture[Any, Any]]]
) -> None:
    """The terminal was closed."""
    server = one_of_ten(world, 13)
    goals("n13", 1)
    server.wait_for("accepted", timeout=LONG)
    command = [sys.executable, "-m", "actionkit", "stop", "--timeout", "9"]
    with open("/dev/full", "w") as full:
        forked.run(
            command, stdout=full, stderr=full, env=world.environment, timeout=LONG, check=False
        )
    server.sync()
    assert server.count("canceled") == 1


def test_a_hold_that_is_in_no_file_is_told_of(world: World) -> None:
    done = world.run_apart("stop", "--json", ACTIONKIT_HOLD_DIR="/proc")  # not even root writes
    assert done.code == Exit.FAILED, done
    told = json.loads(done.out.splitlines()[-1])
    (keeper,) = keepers(world.domain)
    assert (told["held"], told["kept_by"]) == (True, keeper)
    assert told["unwritten"].startswith("/proc: ")
    words = " ".join(done.err.split())
    assert f"The hold is not in a file on this computer ({told['unwritten']})." in words
    assert f"it lasts only while process {keeper}" in words


FULL = """
from actionkit._ros.holds.files import HoldFiles
def write(*_):
    raise OSError(28, "No space left on device")
HoldFiles.write = write
"""


@pytest.mark.long
def test_a_release_that_is_in_no_file_is_told_of(
    world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ACTIONKIT_HOLD_DIR", str(tmp_path))
    view.HoldFiles(world.domain).write(HoldState({(hold := new_hold()).hold_id: hold}))
    done = world.run_apart("stop", "--release", before=FULL)
    assert done.code == Exit.FAILED, done
    told = f"A file on this computer still has the hold ({tmp_path}: No space left on device)."
    assert told in " ".join(done.err.split())
    assert world.run_apart("stop", "--release").code == Exit.OK


@pytest.mark.long
def test_fifty_goals_of_ten_servers_and_those_that_do_not_stop(
    world: World, agent: HoldListener, goals: Callable[..., list[GoalFuture[Any, Any]]]
) -> None:
    assert agent.why_held() is None
    with ThreadPoolExecutor(4) as starting:
        many = list(starting.map(partial(one_of_ten, world), range(10)))
    hard = [
        world.server("refuses_cancel"),
        world.server("slow_cancel", gate=1),
        world.server("blocking", gate=1),
    ]
    watching = world.start("watch", "refuses_cancel", "--json")
    watching.until('"kind":"servers"')
    sent = [future for number in range(10) for future in goals(f"n{number}", 5)]
    for name, count in (("refuses_cancel", 5), ("slow_cancel", 1), ("blocking", 1)):
        goals(name, count)
    for server, count in [*((server, 5) for server in many), (hard[0], 5), (hard[1], 1)]:
        server.wait_for("accepted", count=count, timeout=LONG)
    hard[2].wait_for("executing", timeout=LONG)

    done = world.run_apart("stop", "--timeout", "9")
    assert done.code == Exit.CANCEL_REFUSED, done
    rows = numbers(done.out)
    for number, server in enumerate(many):
        assert rows[f"/n{number}"] == ["5", "5", "-", "-", "-"]
        server.sync()
        assert not server.running()
    # rclpy's servers skip the goal after each that they refuse.
    assert rows["/refuses_cancel"] == ["5", "-", "-", "5", "-"]
    assert rows["/slow_cancel"] == ["1", "-", "-", "-", "1"]
    assert done.out.count("IT IS STILL RUNNING") == 5
    assert "/blocking: no server answered. GOALS MAY STILL BE RUNNING." in done.out
    assert "Agents are held until `actionkit stop --release`; 1 in sight obey." in done.out
    for future in sent:
        assert future.outcome(LONG).status is GoalState.CANCELED
    assert "A human has stopped the robot" in (agent.why_held() or "")
    watching.until('"held":true')

    # Whoever starts later is held, too, by the process that was left behind...
    told = json.loads(world.run_apart("stop", "--status", "--json").out)
    assert told["held"] is True
    (keeper,) = keepers(world.domain)
    assert any(
        f"keeper of {told['holds'][0]['by']} (process {keeper})" == k for k in told["kept_by"]
    )
    assert "a file on this computer" in told["kept_by"]
    assert os.getsid(keeper) == keeper, "ends with the terminal"
    # ... and where that is killed, by the agents that know of it.
    os.kill(keeper, signal.SIGKILL)
    status = world.run_apart("stop", "--status", ACTIONKIT_HOLD_DIR="/nowhere")
    assert status.code == Exit.HELD
    assert "agent of" in status.out
    assert "file" not in status.out

    released = world.run_apart("stop", "--release")
    assert (released.code, released.err) == (Exit.OK, "")
    assert released.out.startswith("Released: the hold of ")
    assert agent.why_held() is None
    watching.until('"held":false')
    watching.signal(signal.SIGINT)
    watching.finish()
    status = world.run_apart("stop", "--status")
    assert (status.code, status.out, status.err) == (Exit.OK, "Not held.\n", "")
    hard[1].release()
    hard[2].release()


@pytest.mark.long
def test_two_terminals_and_one_release(world: World, agent: HoldListener) -> None:
    both = [world.start("stop", "--timeout", "6") for _ in range(2)]
    codes = [stop.finish() for stop in both]
    assert codes == [Exit.NO_SERVER] * 2, [stop.text for stop in both]
    assert "No action server is in sight" in both[0].text
    assert agent.why_held()
    # Both are of one human: the process of the newer one is enough.
    until(lambda: len(keepers(world.domain)) == 1)
    assert agent.why_held()
    assert world.run_apart("stop", "--release").code == Exit.OK
    assert agent.why_held() is None
    until(lambda: not keepers(world.domain))
    assert world.run_apart("stop", "--release").out == "There was no hold.\n"


@pytest.mark.long
def test_named_actions_are_stopped_without_a_hold(
    world: World, agent: HoldListener, goals: Callable[..., list[GoalFuture[Any, Any]]]
) -> None:
    server = world.server("never_finishes")
    (future,) = goals("never_finishes", 1)
    server.wait_for("executing")
    done = world.run_apart("stop", "never_finishes", "/nowhere", "--json")
    assert done.code == Exit.NO_SERVER
    assert "Action '/nowhere' has no server in sight." in done.err
    assert "Agents are not held" in done.err
    lines = [json.loads(line) for line in done.out.splitlines()]
    assert [(line["kind"], line["action_name"]) for line in lines] == [
        ("cancel", "/never_finishes"), ("stop", "/never_finishes"), ("stop", "/nowhere"),
    ]  # fmt: skip
    assert (lines[0]["goal_id"], lines[0]["cancel"]) == (str(future.goal_id), "CONFIRMED")
    assert lines[1]["goals"] == 1
    assert future.outcome(LONG).status is GoalState.CANCELED
    assert agent.why_held() is None
    assert not keepers(world.domain)


FLOOD = """
import rclpy
from rclpy.action import ActionClient
from test_msgs.action import Fibonacci
rclpy.init()
node = rclpy.create_node("flood")
client = ActionClient(node, Fibonacci, "never_finishes")
client.wait_for_server()
accepted = []
def send():
    client.send_goal_async(Fibonacci.Goal(order=900)).add_done_callback(accepted.append)
node.create_timer(1 / 60, send)
while len(accepted) < 60:
    rclpy.spin_once(node)
print("flooding", flush=True)
rclpy.spin(node)
"""
"""Sends 60 goals a second, as a program that knows nothing of ActionKit."""


def test_a_stop_keeps_its_time_while_another_program_goes_on_sending_goals(
    world: World, agent: HoldListener
) -> None:
    assert agent.why_held() is None
    server = world.server("never_finishes")
    flood = world.start(before=FLOOD)
    flood.until("flooding")
    server.sync()
    running = server.running()
    began = time.monotonic()
    stop = world.start("stop", "--timeout", "3", "--json")
    stop.until("Stopping everything")
    entered = time.monotonic()
    # On a busy machine more: ten times what the start of a fork takes there.
    slack = 2 + 10 * (entered - began)
    stop.until("Agents are held.")
    assert time.monotonic() - began < 2 + slack
    assert agent.why_held()
    stop.finish()
    assert time.monotonic() - entered < 3 + 1 + slack, stop.text
    server.sync()
    canceled = {event.goal_id for event in server.events if event.event == "canceled"}
    told = [json.loads(line) for line in stop.text.splitlines() if line[:1] == "{"]
    fates = {line["goal_id"]: line["cancel"] for line in told if line["kind"] == "cancel"}
    assert running <= set(fates)
    assert {goal for goal, fate in fates.items() if fate == "CONFIRMED"} <= canceled
    assert set(fates.values()) <= {"CONFIRMED", "UNKNOWN"}
    assert len(canceled) > len(running), "goals that came later were left alone"
    assert (told[-1]["held"], len(told[-1]["told"]), told[-1]["late"]) == (True, 1, [])


HUNG_AGENT = (
    """
from test_msgs.action import Fibonacci
from actionkit import Client
client = Client(Fibonacci, "never_finishes", on_close="abandon")
client.call_async(Fibonacci.Goal(order=900))
"""
    + AGENT
)


def test_an_agent_that_hangs_and_ctrl_c(world: World, agent: HoldListener) -> None:
    server = world.server("never_finishes")
    hung = world.start(before=HUNG_AGENT + "\nsys.exit()", stdin=-1)
    assert hung.process.stdin is not None
    hung.until("known True")
    server.wait_for("executing")
    os.kill(hung.process.pid, signal.SIGSTOP)
    stop = world.start("stop", "--timeout", "40")
    stop.until("Stopping everything")
    until(lambda: not server.running())
    # It is waiting for the agent that is stopped, or still looking for servers.
    stop.signal(signal.SIGINT)
    assert stop.finish() == Exit.INTERRUPTED
    assert "The hold stays." in stop.text
    assert "/never_finishes" in stop.text
    assert agent.why_held()
    assert len(keepers(world.domain)) == 1
    os.kill(hung.process.pid, signal.SIGCONT)
    print("known\nnow", file=hung.process.stdin, flush=True)
    hung.until("True")
    hung.until("A human has stopped the robot")
    assert world.run_apart("stop", "--release").code == Exit.OK
    hung.process.stdin.close()
    hung.process.stdin = None
    hung.finish()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--release", "--status"), "not both"),
        (("/a", "--release"), "not both"),
        (("/a", "--status"), "not both"),
        (("--domain-id", "233"), "0<=x<=232"),
        (("--timeout", "-1"), "zero or more"),
        (("not a name",), "not a valid ROS name"),
    ],
)
def test_wrong_usage_stops_nothing(
    words: tuple[str, ...], told: str, ros_domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    from click.testing import CliRunner

    from actionkit.cli.cancel_and_stop import stop

    # What belongs to the process would stay with the tests that come next.
    monkeypatch.setattr(stop, "use_udp_only", lambda: None)
    monkeypatch.setattr(stop.signal, "signal", lambda *_: None)
    result = CliRunner().invoke(stop.command, list(words))
    assert result.exit_code == Exit.USAGE
    assert told in " ".join(result.output.split())
