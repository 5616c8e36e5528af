"""`actionkit watch` without a NAME: the goals of all actions, beside real clients and servers."""

from __future__ import annotations

import json
import re
import signal
import time
from pathlib import Path
from typing import Any

import pytest
from test_msgs.action import Fibonacci

from actionkit import Client
from actionkit.cli._shared.exits import Exit
from actionkit.servers import start
from tests.cli.conftest import FIBONACCI, Running, World
from tests.conftest import NEVER

NO_TYPES = "import sys; sys.modules['test_msgs'] = None"
"""So that no package of an action's type can be imported."""


def events(text: str) -> list[dict[str, Any]]:
    """Return the lines of JSON about goals."""
    lines = [json.loads(line) for line in text.splitlines() if line.startswith("{")]
    return [line for line in lines if line["kind"] == "event"]


def end(watching: Running) -> str:
    """Press Ctrl-C; return all that was written."""
    watching.signal(signal.SIGINT)
    assert watching.finish() == Exit.INTERRUPTED
    return watching.text


def test_each_change_is_a_line_also_of_an_action_that_comes_later(world: World) -> None:
    watching = world.start("watch")
    watching.until("Watching the goals of all actions")
    world.server("fibonacci")
    watching.until("servers of /fibonacci: /reference_server")
    world.server("countdown")
    watching.until("servers of /countdown: /reference_server")
    for name in ("fibonacci", "countdown"):
        assert world.run("call", name, FIBONACCI, "{order: 1}").code == Exit.OK
        watching.until("SUCCEEDED")
        assert re.search(
            rf"  /{name}  [\w-]{{36}}  SUCCEEDED  [\d.]+ s after its acceptance, was EXECUTING",
            watching.text,
        )
    end(watching)


def test_the_lines_of_json_and_the_log_are_those_of_a_log_file(
    world: World, tmp_path: Path
) -> None:
    world.server("fibonacci")
    log = tmp_path / "goals.jsonl"
    watching = world.start("watch", "--json", "--log", str(log))
    watching.until('"action_name":"/fibonacci"')
    assert world.run("call", "fibonacci", FIBONACCI, "{order: 1}").code == Exit.OK
    watching.until('"state":"SUCCEEDED"')
    told = events(end(watching))
    assert told[-1]["action_name"] == "/fibonacci"
    assert told[-1]["action_type"] == FIBONACCI
    assert "server" not in told[-1]
    logged = events(log.read_text("utf-8"))
    assert [(one["call_id"], one["state"]) for one in logged] == [
        (one["call_id"], one["state"]) for one in told
    ]
    drawn = world.run("timeline", str(log))
    assert (drawn.code, drawn.err) == (Exit.OK, "")
    assert f"goal {told[-1]['goal_id']}" in drawn.out


def test_feedback_comes_once_a_second_at_most(world: World) -> None:
    world.server("countdown", period=0.02)
    watching = world.start("watch", "--json", "--feedback")
    watching.until('"action_name":"/countdown"')
    call = world.start("call", "countdown", FIBONACCI, "{order: 75}")
    watching.until('"state":"SUCCEEDED"')
    assert call.finish() == Exit.OK
    shown = [one for one in events(end(watching)) if one["state"] == "FEEDBACK"]
    assert 1 <= len(shown) <= 1 + (shown[-1]["wall"] - shown[0]["wall"])
    assert shown[0]["feedback"]["sequence"][-1] == 0


def test_an_action_whose_type_is_not_here_is_named_and_watched(world: World) -> None:
    world.server("fibonacci")
    watching = world.start("watch", "--feedback", before=NO_TYPES)
    watching.until(f"No feedback of /fibonacci: {FIBONACCI}: the package 'test_msgs' is not")
    assert world.run("call", "fibonacci", FIBONACCI, "{order: 1}").code == Exit.OK
    watching.until("SUCCEEDED")
    assert end(watching).count("No feedback of /fibonacci") == 1


def test_a_goal_of_two_servers_is_two_goals(empty_world: World) -> None:
    server = empty_world.server("twins", gate=1)
    watching = empty_world.start("watch", "--json")
    watching.until('","/reference_server')  # both
    call = empty_world.start("call", "twins", FIBONACCI, "{order: 1}")
    call.until("Goal accepted")
    watching.until('"server":1')
    watching.until('"server":2')
    server.release(2)
    watching.until('"state":"SUCCEEDED"')
    watching.until('"state":"SUCCEEDED"')
    call.finish()
    done = [one for one in events(end(watching)) if one["state"] == "SUCCEEDED"]
    assert {one["server"] for one in done} == {1, 2}
    assert len({one["call_id"] for one in done}) == 2
    assert len({one["goal_id"] for one in done}) == 1


def test_once_shows_the_goals_of_all_actions(world: World) -> None:
    for name in ("fibonacci", "countdown"):
        world.server(name)
        assert world.run("call", name, FIBONACCI, "{order: 1}").code == Exit.OK
    for _ in range(5):  # a busy machine loses packets of discovery
        shown = world.run("watch", "--once")
        assert shown.code == Exit.OK
        found = set(re.findall(r"  (/\w+)  [\w-]{36}  SUCCEEDED  accepted", shown.out))
        if {"/fibonacci", "/countdown"} <= found:
            return
    raise AssertionError(shown.out)


@pytest.mark.long
def test_once_says_if_there_is_nothing(empty_world: World) -> None:
    nobody = empty_world.run("watch", "--once")
    assert (nobody.code, nobody.out) == (Exit.NO_SERVER, "")
    assert nobody.err == "Error: No action has a server in sight.\n"
    empty_world.server("fibonacci")
    idle = empty_world.run("watch", "--once")
    assert (idle.code, idle.out) == (Exit.OK, "No goals: no server remembers any.\n")


@pytest.mark.heavy
@pytest.mark.parametrize("actions", [1, 10])
def test_no_end_is_lost_at_a_hundred_goals_a_second(
    empty_world: World, actions: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = [f"busy_{number}" for number in range(actions)]
    for name in names:
        empty_world.stack.enter_context(
            start("fibonacci", action_name=name, domain_id=empty_world.domain, feedback=0)
        )
    watching = empty_world.start("watch", "--json")
    for _ in names:
        watching.until('"kind":"servers"')
    goals, futures = 300, []
    for name in ("ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE"):
        monkeypatch.setenv(name, empty_world.environment[name])
    clients = [empty_world.stack.enter_context(Client(Fibonacci, name)) for name in names]
    for client in clients:
        assert client.wait_for_server(30.0)
    began = time.monotonic()
    for number in range(goals):
        futures.append(clients[number % actions].call_async({"order": 1}, timeout=60.0))
        NEVER.wait(max(0.0, began + number / 100 - time.monotonic()))
    sent = {str(future.goal_id) for future in futures if future.outcome(60.0).ok}
    assert len(sent) == goals
    ended: set[str] = set()
    while ended != sent:
        watching.until('"state":"SUCCEEDED"')
        ended.add(events(watching.text)[-1]["goal_id"])
    end(watching)
