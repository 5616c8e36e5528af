"""docs/mcp.md shows a real session."""

from __future__ import annotations

import asyncio
import json
import re
from pathlib import Path
from typing import Any

import mcp.types as t
import pytest

from tests.agents.over_mcp.lab import WAYS, Robot, Watch, agent
from tests.tables import WRITING

PAGE = Path(__file__).parents[3] / "docs" / "mcp.md"
BLOCK = re.compile(r"(<!-- session -->\n```text\n)(.*?)(```\n<!-- end -->)", re.S)


@pytest.mark.long
def test_the_session_in_the_documentation(robot: Robot) -> None:
    robot.server("fibonacci", period=0.1)
    patrolling = robot.server("never_finishes")
    lines: list[str] = []
    known: dict[str, str] = {}

    def show(value: Any) -> str:
        """JSON in a few lines, without what is empty and what differs from run to run."""
        text = json.dumps(value, indent=1)
        text = re.sub(r'"[0-9a-f]{8}-[0-9a-f-]{27}"', lambda id_: name(id_[0]), text)
        text = re.sub(r'("elapsed"|"ended_ago"): [\d.]+', r"\1: ...", text)
        text = re.sub(r"\[\s+([-\d,\s]*?)\s+\]", lambda m: "[" + " ".join(m[1].split()) + "]", text)
        return re.sub(r"^", "  ", text, flags=re.M)

    def name(goal_id: str) -> str:
        return known.setdefault(goal_id, f'"<id of goal {len(known) + 1}>"')

    async def human(ctx: Any, params: t.ElicitRequestFormParams) -> t.ElicitResult:
        lines.append("the human is asked:\n" + re.sub(r"^", "  ", params.message, flags=re.M))
        lines.append("the human declines")
        return t.ElicitResult(action="decline")

    async def scenario() -> None:
        async with agent(robot, WAYS[1], elicitation_callback=human) as connected:
            lines.append(f"connected by stdio, protocol {connected.client.protocol_version}")
            for tool in (await connected.client.list_tools()).tools:
                if tool.name in ("count", "ask", "patrol", "goals"):
                    lines.append(f"tool {tool.name}: {tool.description}")

            async def call(tool: str, arguments: dict[str, Any]) -> None:
                lines.append(f"call {tool} {json.dumps(arguments)}")
                result = await connected.call(tool, arguments)
                if connected.progress:
                    lines.append(f"progress: {connected.progress[0][1]}")
                    connected.progress.clear()
                value = dict(result.structured_content)
                if "goals" in value:
                    value["goals"] = [without_nothing(goal) for goal in value["goals"]]
                is_error = " (isError)" if result.is_error else ""
                lines.append(f"result{is_error}:\n" + show(without_nothing(value)))

            await call("count", {"order": 5})
            await call("count", {"order": 5000})
            await call("ask", {"order": 3})
            watch = Watch(patrolling)
            lines.append("call patrol {}")
            calling = asyncio.ensure_future(connected.call("patrol", {}))
            await watch.until("executing")
            calling.cancel()
            lines.append("the client cancels the request, which is never answered")
            await asyncio.wait([calling])
            connected.progress.clear()
            await connected.goals()  # waits until it is over
            await call("goals", {})
        lines.append("the client closes standard input; the process ends")

    asyncio.run(scenario())
    text = "\n".join(lines) + "\n"
    page = PAGE.read_text("utf-8")
    if WRITING:
        PAGE.write_text(BLOCK.sub(lambda m: m[1] + text + m[3], page), "utf-8")
    else:
        found = BLOCK.search(page)
        assert found is not None
        assert stable(found[2]) == stable(text)


def stable(text: str) -> str:
    """Return it without feedback, of which some may be lost on a machine with other work."""
    text = re.sub(r'^progress:.*\n|^ *"feedback_count":.*\n', "", text, flags=re.M)
    return re.sub(r'^ *"feedback": \{.*?\n *\},?\n', "", text, flags=re.M | re.S)


def without_nothing(value: dict[str, Any]) -> dict[str, Any]:
    return {key: one for key, one in value.items() if one is not None}
