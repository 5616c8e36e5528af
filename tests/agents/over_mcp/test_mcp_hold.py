"""A human stops the robot while agents drive it over MCP."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Iterator
from contextlib import AsyncExitStack
from typing import Any

import mcp.types as t
import pytest

from tests import forked
from tests.agents.over_mcp import page
from tests.agents.over_mcp.lab import PATIENCE, WAYS, Agent, HttpServing, Robot, Watch, agent
from tests.conftest import without_noise
from tests.holding import end_keepers


@pytest.fixture(scope="module")
def robot(robot: Robot) -> Robot:
    """Let processes listen for holds as long as they do for users: that is tested here."""
    robot.holds_soon_known = False
    # Each of the four agents has a goal of the same action.
    robot.file.write_text(robot.file.read_text().replace("concurrent = 2", "concurrent = 4"))
    return robot


@pytest.fixture
def human(robot: Robot) -> Iterator[None]:
    """Leave no hold behind."""
    yield
    end_keepers(robot.domain)


async def stop(robot: Robot, *words: str) -> str:
    """Be the human; return what they read."""
    command = [sys.executable, "-m", "actionkit", "stop", *words, "--domain-id", str(robot.domain)]

    def run() -> str:
        done = forked.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
        assert done.returncode == 0, done
        return without_noise(done.stdout)

    return await asyncio.to_thread(run)


@pytest.mark.usefixtures("human")
def test_a_human_stops_the_robot(robot: Robot, http: HttpServing) -> None:
    patrolling = robot.server("never_finishes")
    counting = robot.server("fibonacci")

    async def scenario() -> None:
        async with AsyncExitStack() as stack:
            agents = [await stack.enter_async_context(agent(robot, way, http)) for way in WAYS]
            by_way = list(zip(WAYS, agents, strict=True))
            watch = Watch(patrolling)
            calls = []
            ids: dict[int, str] = {}
            for number, (_, connected) in enumerate(by_way):
                calls.append(asyncio.ensure_future(connected.told("patrol", {})))
                await watch.until("executing", number + 1)
                ids[number] = watch.received[-1]
            said = await stop(robot)
            assert "/never_finishes" in said
            patrolling.sync()
            for number, (way, _) in enumerate(by_way):
                (end,) = {
                    e.event
                    for e in watch.events
                    if e.goal_id == ids[number] and e.event in ("canceled", "succeeded", "aborted")
                }
                fault = "`actionkit stop` while a goal runs"
                page.record(page.HELD, fault, way, f"a goal, {end}", await calls[number])

            for way, connected in by_way:
                fault = "the next call, under the hold"
                await tried(fault, way, connected)
            for way in WAYS:
                fault = "a call of an agent that starts under the hold"
                async with agent(robot, way, http) as late:
                    await tried(fault, way, late)
            assert (await stop(robot, "--release")).startswith("Released")
            for way, connected in by_way:
                await tried("a call after `actionkit stop --release`", way, connected)

    async def tried(fault: str, way: object, connected: Agent) -> None:
        watch = Watch(counting)
        told = await connected.told("count", {"order": 2})
        page.record(page.HELD, fault, way, await watch.summary(), told)

    asyncio.run(scenario())


@pytest.mark.usefixtures("human")
def test_an_approval_does_not_outlive_a_stop(robot: Robot) -> None:
    """Where the question goes to the client and comes back; the human is asked anew."""
    counting = robot.server("fibonacci")
    asked = []

    async def human(ctx: Any, params: Any) -> t.ElicitResult:
        asked.append(params)
        if len(asked) > 1:
            return t.ElicitResult(action="decline")
        await stop(robot)
        await stop(robot, "--release")
        return t.ElicitResult(action="accept", content={"approve": True})

    async def scenario() -> None:
        async with agent(robot, WAYS[1], elicitation_callback=human) as connected:
            watch = Watch(counting)
            assert await connected.told("ask", {"order": 2}) == "`refused`, no retry"
            assert await watch.summary() == "nothing"

    asyncio.run(scenario())
    assert len(asked) == 2
