"""`actionkit list`, `info`, `watch` and `serve`, beside real clients and servers. Contract C6.3."""

from __future__ import annotations

import json
import re
import signal
from pathlib import Path
from typing import Any

import pytest

from actionkit.cli._shared.exits import Exit
from tests.cli.conftest import FIBONACCI, NESTED, World
from tests.player import player


def seen(world: World, count: int) -> dict[str, dict[str, Any]]:
    """Return what `list` shows, as soon as it is so many actions."""
    told: dict[str, dict[str, Any]] = {}
    for _ in range(5):  # a busy machine loses packets of discovery
        done = world.run("list", "--json")
        assert (done.code, done.err) == (Exit.OK, "")
        told = {record["name"]: record for record in map(json.loads, done.out.splitlines())}
        assert list(told) == sorted(told)
        if len(told) == count:
            break
    return told


def test_list_and_info_know_servers_and_clients(world: World) -> None:
    world.server("fibonacci")
    world.server("navigate")
    waiting = world.start("call", "/elsewhere", FIBONACCI, "--server-timeout", "60")
    waiting.until("Waiting for")

    told = seen(world, 3)
    assert told["/elsewhere"]["types"] == [FIBONACCI]
    assert told["/navigate"]["types"] == [NESTED]
    assert told["/elsewhere"]["servers"] == []
    assert len(told["/elsewhere"]["clients"]) == 1
    assert told["/elsewhere"]["clients"][0].startswith("/actionkit_")
    assert told["/fibonacci"]["servers"][0].startswith("/reference_server")
    assert told["/fibonacci"]["clients"] == []

    shown = world.run("info", "fibonacci", "-t", "--wait", "1")
    assert (shown.code, shown.err) == (Exit.OK, "")
    assert re.fullmatch(
        r"Action: /fibonacci\nAction clients: 0\nAction servers: 1\n"
        rf"    /reference_server\w+ \[{FIBONACCI}\]\n",
        shown.out,
    )
    nobody = world.run("info", "/fibonaci", "--count")
    assert nobody.code == Exit.NO_SERVER
    assert nobody.out == "Action: /fibonaci\nAction clients: 0\nAction servers: 0\n"
    assert "Did you mean /fibonacci?" in nobody.err
    # Right after discovery, which says nothing of how many are in sight by then.
    listed = world.run("list", "-t", "--wait", "1").out.splitlines()
    assert listed
    assert set(listed) <= {f"{name} [{told[name]['types'][0]}]" for name in told}
    assert int(world.run("list", "-c", "--wait", "1").out) in (1, 2, 3)
    waiting.signal(signal.SIGINT)
    assert waiting.finish() == Exit.INTERRUPTED
    assert "NOT_NEEDED" in waiting.text


@pytest.mark.long
def test_watch_sees_the_goals_of_others_and_their_end(world: World, tmp_path: Path) -> None:
    server = world.server("fibonacci", gate=1)
    watching = world.start("watch", "fibonacci", "--json")
    watching.until('"kind":"servers"')
    call = world.start("call", "fibonacci", FIBONACCI, "{order: 3}")
    call.until("Goal accepted")
    watching.until('"state":"EXECUTING"')

    now = world.run("watch", "fibonacci", "--once")
    assert now.code == Exit.OK
    assert re.search(r"[\w-]{36}  EXECUTING  accepted [\d.]+ s ago", now.out)

    server.release()
    assert call.finish() == Exit.OK
    watching.until('"state":"SUCCEEDED"')
    server.command("hold")
    server.wait_for("held")
    left = world.start("call", "fibonacci", FIBONACCI, "{order: 3}", "--timeout", "30")
    left.until("Goal accepted")
    watching.until('"state":"EXECUTING"')
    server.interrupt()
    watching.until('"state":"LOST"')
    watching.signal(signal.SIGINT)
    assert watching.finish() == Exit.INTERRUPTED

    records = [json.loads(line) for line in watching.text.splitlines() if line.startswith("{")]
    goals = [record for record in records if record["kind"] == "event"]
    goal = re.search(r"with ID: ([\w-]{36})\n", call.text)
    assert goal
    states = [record["state"] for record in goals if record["goal_id"] == goal[1]]
    assert states[-2:] == ["EXECUTING", "SUCCEEDED"]
    assert goals[-1]["detail"] in ("was EXECUTING", "was CANCELING")
    assert all(0 <= record["elapsed_ms"] < 120_000 for record in goals)
    assert {record["action_type"] for record in goals} == {FIBONACCI}
    assert left.finish() in (Exit.SERVER_LOST, Exit.RESULT_LOST, Exit.ABORTED), left.text

    log = tmp_path / "goals.jsonl"
    log.write_text("\n".join(line for line in watching.text.splitlines() if line[:1] == "{"))
    drawn = world.run("timeline", str(log), "--svg", str(tmp_path / "goals.svg"))
    assert (drawn.code, drawn.err) == (Exit.OK, "")
    assert f"goal {goal[1]}" in drawn.out
    assert "=> SUCCEEDED after " in drawn.out


def test_a_player_of_feedback_is_not_a_server(empty_world: World) -> None:
    with player(empty_world.environment):
        assert "/fibonacci" not in empty_world.run("list", "--wait", "1").out
        nobody = empty_world.run("info", "/fibonacci", "--wait", "1")
        assert nobody.code == Exit.NO_SERVER
        assert nobody.out == "Action: /fibonacci\nAction clients: 0\nAction servers: 0\n"
        assert "Only its feedback is published, by /player." in nobody.err


@pytest.mark.long
def test_watch_ends_when_asked_to(empty_world: World) -> None:
    nobody = empty_world.run("watch", "/fibonacci", "--once", "--server-timeout", "0.5")
    assert (nobody.code, nobody.out) == (Exit.NO_SERVER, "")
    assert "'/fibonacci' has no server in sight" in nobody.err
    assert empty_world.run("watch", "/fibonacci", "--for", "0.2").code == Exit.OK
    deserted = empty_world.start("watch", "/fibonacci")
    deserted.until("Watching")
    assert deserted.process.stdout is not None
    deserted.process.stdout.close()
    assert deserted.process.wait(20) == Exit.OUTPUT_CLOSED
    empty_world.server("fibonacci")
    idle = empty_world.run("watch", "/fibonacci", "--once")
    assert idle.code == Exit.OK
    assert idle.out.startswith("No goal is known: no status has come from the server. ")
    idle = empty_world.run("cancel", "/fibonacci")
    assert idle.code == Exit.OK
    assert idle.out.startswith("No goal is known: no status has come from the server. ")


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_serve_serves_until_it_is_told_to_stop(empty_world: World, number: signal.Signals) -> None:
    serving = empty_world.start("serve", "fibonacci", "--action", "/numbers", "--option", "gate=0")
    serving.until("ready")
    done = empty_world.run("call", "/numbers", FIBONACCI, "{order: 4}")
    assert done.code == Exit.OK, done.err
    assert "sequence: [0, 1, 1, 2, 3]" in done.out
    serving.until("succeeded")
    serving.signal(number)
    assert serving.finish() == Exit.OK


@pytest.mark.long
def test_serve_knows_its_servers_and_their_options(empty_world: World) -> None:
    listed = empty_world.run_apart("serve", "--list")
    assert listed.code == Exit.OK
    assert "\nnavigate " in listed.out
    for words in (
        ("nobody",),
        ("fibonacci", "--option", "nothing=1"),
        ("fibonacci", "--option", "nothing"),
        ("fibonacci", "--action", "not a name"),
        (),
    ):
        wrong = empty_world.run_apart("serve", *words)
        assert (wrong.code, wrong.out) == (Exit.USAGE, ""), words
        assert wrong.err.startswith("Usage: actionkit serve "), wrong.err
        assert "\nError: " in wrong.err
