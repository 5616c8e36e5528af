"""`actionkit attach`: following the goal of another program (C1.16)."""

from __future__ import annotations

import json
import signal
import uuid
from collections.abc import Iterator
from typing import Any

import pytest
from test_msgs.action import Fibonacci

from actionkit import Client, GoalFuture, Timeouts
from actionkit.cli._shared.exits import Exit
from actionkit.servers import Server
from tests.cli.conftest import World

LONG = 30.0


@pytest.fixture
def server(world: World) -> Server:
    return world.server("fibonacci", period=0.1)


@pytest.fixture
def theirs(
    world: World, server: Server, monkeypatch: pytest.MonkeyPatch
) -> Iterator[GoalFuture[Any, Any]]:
    """A goal of another program, which takes ten seconds."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(world.domain))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with Client(Fibonacci, "fibonacci", timeouts=Timeouts(server=LONG)) as client:
        future = client.call_async({"order": 100})
        server.wait_for("executing", goal_id=str(future.goal_id))
        yield future


def test_it_shows_feedback_and_the_result(
    world: World, server: Server, theirs: GoalFuture[Any, Any]
) -> None:
    following = world.start("attach", "/fibonacci", str(theirs.goal_id), "--json")
    following.until('"FEEDBACK"')
    theirs.cancel()
    assert following.finish() == Exit.CANCELED
    lines = [json.loads(line) for line in following.text.splitlines()]
    states = [line["state"] for line in lines if line["state"] != "FEEDBACK"]
    assert states[:2] == ["ACCEPTED", "EXECUTING"]
    assert states[-2:] == ["CANCELED", "CANCELED"]
    assert {line["goal_id"] for line in lines} == {str(theirs.goal_id)}


def test_ctrl_c_lets_the_goal_run(
    world: World, server: Server, theirs: GoalFuture[Any, Any]
) -> None:
    following = world.start("attach", "fibonacci", str(theirs.goal_id))
    following.until("Feedback:")
    following.signal(signal.SIGINT)
    following.until("Detaching; the goal goes on (Ctrl-C; once more cancels it)")
    assert following.finish() == Exit.INTERRUPTED
    assert f"Detached from goal {theirs.goal_id}, which runs on." in following.text
    assert str(theirs.goal_id) in server.running()


@pytest.mark.parametrize("option", [(), ("--cancel-on-interrupt",)])
def test_a_second_one_or_the_option_cancels_it(
    option: tuple[str, ...], world: World, server: Server, theirs: GoalFuture[Any, Any]
) -> None:
    following = world.start("attach", "fibonacci", str(theirs.goal_id), *option)
    following.until("Feedback:")
    following.signal(signal.SIGINT)
    if not option:
        following.until("Detaching")
        # One press of Ctrl-C may come as two signals, so the second is heard only a moment later.
        goal = str(theirs.goal_id)
        steps = [e for e in server.events if (e.event, e.goal_id) == ("feedback", goal)]
        server.wait_for("feedback", goal_id=goal, count=len(steps) + 3)
        following.signal(signal.SIGINT)
    assert following.finish() == Exit.INTERRUPTED
    assert "Goal canceled: CONFIRMED" in following.text
    server.wait_for("canceled", goal_id=str(theirs.goal_id))


@pytest.mark.parametrize("how", ["output closed", "SIGTERM", "Ctrl-C, then SIGTERM"])
def test_only_ctrl_c_cancels_it(
    how: str, world: World, server: Server, theirs: GoalFuture[Any, Any]
) -> None:
    following = world.start("attach", "fibonacci", str(theirs.goal_id))
    following.until("Feedback:")
    if how.startswith("Ctrl-C"):
        following.signal(signal.SIGINT)
        following.until("Detaching")
    if how == "output closed":
        assert following.process.stdout is not None
        following.process.stdout.close()
    else:
        following.signal(signal.SIGTERM)
    code = following.process.wait(LONG)
    assert code in (Exit.OUTPUT_CLOSED, Exit.TERMINATED, Exit.INTERRUPTED)
    server.sync()
    assert str(theirs.goal_id) in server.running()
    asked = [e.goal_id for e in server.events if e.event == "cancel_accepted"]
    assert str(theirs.goal_id) not in asked


def test_an_id_that_nobody_knows(world: World, server: Server) -> None:
    done = world.run("attach", "/fibonacci", str(uuid.uuid4()))
    assert done.code == Exit.NO_SUCH_GOAL
    assert "No server of action '/fibonacci' knows goal" in done.err
    wrong = world.run("attach", "/fibonacci", "7")
    assert (wrong.code, "'7' is not a goal id" in wrong.err) == (Exit.USAGE, True)
