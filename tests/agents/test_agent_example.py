"""The example of an agent: it plans around a failure, and a human's stop ends it.

With `ACTIONKIT_WRITE_AGENT=1` in the environment the transcript in docs/agents.md is written.
"""

from __future__ import annotations

import asyncio
import importlib.util
import os
import re
import sys
from pathlib import Path
from typing import Any

import pytest

from actionkit.agents import Toolbox
from actionkit.testing.plugin import ActionServerFactory
from tests.agents.conftest import FakeHold, seen

DOCS = Path(__file__).parents[2] / "docs"
EXAMPLE = DOCS / "examples" / "agent.py"
WRITING = os.environ.get("ACTIONKIT_WRITE_AGENT") == "1"
SECTION = re.compile(r"(<!-- transcript -->\n```text\n)(.*?)(```\n)", re.S)
BATTERY = """
import rclpy
from sensor_msgs.msg import BatteryState
rclpy.init()
node = rclpy.create_node("battery")
publisher = node.create_publisher(BatteryState, "/battery_state", 10)
node.create_timer(0.1, lambda: publisher.publish(BatteryState(voltage=12.5)))
print("ready", flush=True)
rclpy.spin(node)
"""


def example() -> Any:
    spec = importlib.util.spec_from_file_location("agent_example", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look there
    spec.loader.exec_module(module)
    return module


@pytest.mark.long
def test_the_agent(action_server: ActionServerFactory, hold: FakeHold, run_script: Any) -> None:
    agent = example()
    left = action_server("error_code", action_name="left_aisle", codes="102")
    right = action_server("navigate", action_name="right_aisle", rate=20.0)
    assert run_script(BATTERY).line() == "ready"
    said: list[str] = []

    async def main() -> Any:
        async with Toolbox.from_file(agent.ROBOT) as toolbox:
            running = asyncio.create_task(agent.run(toolbox, agent.scripted_model(), said.append))
            await seen(right, "accepted", 2)
            hold.stop("a human (ann@desk) has stopped the robot")
            return await running

    results = asyncio.run(main())
    assert [result["status"] for result in results] == [
        "received",
        "aborted",
        "refused",
        "succeeded",
        "canceled",
        "ok",
        "refused",
    ]
    assert not any(goal["may_still_run"] for goal in results[5]["goals"])
    for server in (left, right):
        server.sync()
    assert (left.count("goal_received"), right.count("goal_received")) == (1, 2)
    ids = re.compile(r"[0-9a-f]{8}-[0-9a-f-]{27}")
    text = ids.sub("3f1c…", re.sub(r"\d+ feedbacks", "41 feedbacks", "\n".join(said) + "\n"))
    text = re.sub(r"\d+\.\d+ (m?s)\b", r"0.1 \1", text)
    page = DOCS / "agents.md"
    if WRITING:
        page.write_text(SECTION.sub(lambda m: m[1] + text + m[3], page.read_text()))
    found = SECTION.search(page.read_text())
    assert found is not None
    assert found[2] == text


def test_the_configuration_on_the_page_is_right(tmp_path: Path) -> None:
    blocks = re.findall(r"```toml\n(.*?)```", (DOCS / "agents.md").read_text(), re.S)
    _, every_key = blocks  # the first one is run by tests/docs/test_pages.py
    path = tmp_path / "robot.toml"
    path.write_text(every_key)
    toolbox = Toolbox.from_file(path)
    assert [tool.name for tool in toolbox.tools] == ["count", "battery", "goals"]
