"""The missions of the documentation run, as a tree and with asyncio, and do the same.

With ACTIONKIT_WRITE_PICTURES=1 in the environment the pictures of the tree, and of the log of its
goals, are written into docs/pictures/.
"""

from __future__ import annotations

import asyncio
import importlib.util
import os
import re
import sys
from pathlib import Path
from typing import Any

import py_trees
import pytest
from click.testing import CliRunner
from test_msgs.action import Fibonacci, NestedMessage

from actionkit import Client, Timeouts, read_json_lines
from actionkit.cli._app import app
from tests import forked
from tests.conftest import without_noise

DOCS = Path(__file__).parents[2] / "docs"
PICTURES = DOCS / "pictures"
WRITING = os.environ.get("ACTIONKIT_WRITE_PICTURES") == "1"

STORY = [
    ("/navigate", "cancelled"),  # the battery is low
    ("/dock", "ok"),
    ("/navigate", "ok"),
    ("/pick", "GoalAbortedError"),
    ("/pick", "ok"),
    ("/navigate", "ok"),
    ("/dock", "ok"),
]


def imported(name: str) -> Any:
    """Return an example as a module."""
    spec = importlib.util.spec_from_file_location(name, DOCS / "examples" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    return example


def story(log: Path) -> list[tuple[str, str]]:
    """Return the calls of a log, in the order of their begin, with how each ended."""
    calls = list(read_json_lines(log).calls().values())
    calls.sort(key=lambda lines: min(line.event.monotonic for line in lines if line.event))
    return [
        (lines[0].action_name, line.data["outcome"])
        for lines in calls
        for line in lines
        if line.kind == "outcome"
    ]


@pytest.mark.parametrize("name", ["mission_tree", "mission_asyncio"])
@pytest.mark.long
def test_the_mission(name: str, ros_domain: int, tmp_path: Path) -> None:
    log = tmp_path / "mission.jsonl"
    command = [sys.executable, str(DOCS / "examples" / f"{name}.py"), str(log)]
    ran = forked.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert ran.returncode == 0, ran.stderr
    assert without_noise(ran.stderr) == ""
    assert ran.stdout.rstrip().endswith("mission SUCCESS")
    assert story(log) == STORY
    if WRITING and name == "mission_tree":
        (PICTURES / "mission.jsonl").write_text(log.read_text())
        draw(PICTURES / "mission.svg")


@pytest.mark.parametrize("confirmed", [True, False])
def test_the_mission_sends_nothing_beside_a_robot_that_stops_slowly(
    confirmed: bool, action_server: Any
) -> None:
    nested = "test_msgs/action/NestedMessage"
    driving = action_server("slow_cancel", action_name="navigate", action_type=nested, gate=1)
    docking = action_server("fibonacci", action_name="dock", period=0.05)
    example = imported("mission_asyncio")
    stopping = Timeouts(cancel=20.0 if confirmed else 0.3)

    async def mission() -> None:
        async with (
            Client(NestedMessage, "navigate", timeouts=stopping) as navigate,
            Client(Fibonacci, "dock") as dock,
        ):
            robot = example.Robot(navigate, None, dock)
            task = asyncio.create_task(robot.mission())
            await asyncio.to_thread(driving.wait_for, "executing")
            robot.battery_low.set()
            await asyncio.to_thread(driving.wait_for, "cancel_accepted")
            if confirmed:
                driving.release()
                await asyncio.to_thread(docking.wait_for, "accepted")
                task.cancel()
                await asyncio.wait([task])
            else:
                with pytest.raises(RuntimeError, match="may still be running"):
                    await task
                driving.release()

    asyncio.run(mission())
    (stopped,) = driving.wait_for("canceled")
    docking.sync()
    docked = [event.monotonic for event in docking.events if event.event == "accepted"]
    assert len(docked) == confirmed
    assert all(stopped.monotonic < at for at in docked)


def draw(svg: Path) -> None:
    ran = CliRunner().invoke(app, ["timeline", str(PICTURES / "mission.jsonl"), "--svg", str(svg)])
    assert ran.exit_code == 0, ran.output


def test_the_picture_of_the_goals_is_of_the_log_beside_it(tmp_path: Path) -> None:
    draw(tmp_path / "again.svg")
    assert (tmp_path / "again.svg").read_text() == (PICTURES / "mission.svg").read_text()
    assert story(PICTURES / "mission.jsonl") == STORY


def test_the_picture_of_the_tree_is_that_of_the_example(ros_domain: int) -> None:
    example = imported("mission_tree")
    with (
        Client(NestedMessage, "navigate") as navigate,
        Client(Fibonacci, "pick") as pick,
        Client(Fibonacci, "dock") as dock,
    ):
        root = example.mission(navigate, pick, dock)
        drawn = py_trees.display.dot_tree(root).to_string()
        text = py_trees.display.ascii_tree(root)
        for leaf in root.iterate():
            leaf.shutdown()
    if WRITING:
        (PICTURES / "mission_tree.dot").write_text(drawn)
    assert (PICTURES / "mission_tree.dot").read_text() == drawn
    assert text.strip() in (DOCS / "behaviour-trees.md").read_text()


def blocks(page: str) -> list[str]:
    """Return the Python code of a page, block by block."""
    return re.findall(r"^```python\n(.*?)^```$", (DOCS / page).read_text(), re.M | re.S)


def test_the_snippets_of_the_page(action_server: Any) -> None:
    first, test = blocks("behaviour-trees.md")
    server = action_server("fibonacci")
    here: dict[str, Any] = {}
    exec(first, here)
    assert here["root"].status is py_trees.common.Status.SUCCESS
    server.wait_for("succeeded", count=2)
    exec(test, here)
    here["test_the_dock_that_aborts"](action_server)


def test_the_snippets_of_the_other_page_are_in_its_example() -> None:
    example = (DOCS / "examples" / "mission_asyncio.py").read_text()
    lines = {line.strip() for line in example.splitlines()}
    for block in blocks("mission-asyncio.md"):
        for line in block.splitlines():
            assert line.strip() in lines, line
