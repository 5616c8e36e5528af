"""Two processes serve one robot: limits hold for the robot, not for each process."""

from __future__ import annotations

import asyncio
import signal
from typing import Any

import pytest

from tests.agents.over_mcp.lab import WAYS, Agent, Robot, Watch, agent, words

STDIO, MODERN_STDIO, _, _ = WAYS


async def of_others(connected: Agent) -> list[dict[str, Any]]:
    result = await connected.client.call_tool("goals", {})
    return [goal for goal in result.structured_content["goals"] if not goal["sent_here"]]


def test_a_goal_of_another_process_counts_and_is_told_of(robot: Robot) -> None:
    patrolling = robot.server("never_finishes")

    async def scenario() -> None:
        watch = Watch(patrolling)
        async with agent(robot, STDIO) as second:
            async with agent(robot, MODERN_STDIO) as first:
                calling = asyncio.ensure_future(first.call("patrol", {}))
                await watch.until("executing")
                (goal,) = watch.received
                # One goal at a time, and the other process has one.
                result = await second.call("hurry", {})
                assert words(result) == "`refused`, retry"
                assert result.structured_content["error"]["type"] == "too_many_goals"
                message = result.structured_content["error"]["message"]
                assert f"{goal} (of another program)" in message
                (told,) = await of_others(second)
                assert (told["goal_id"], told["status"]) == (goal, "running")
                assert told["may_still_run"]
                # It is none of its own, so it is left alone here.
                assert await of_others(first) == []

                # And a process that starts now knows of it. Two at a time are allowed here.
                async with agent(robot, STDIO) as third:
                    assert words(await third.call("hurry", {})) == "`refused`, retry"
                    assert [one["goal_id"] for one in await of_others(third)] == [goal]
                    more = asyncio.ensure_future(third.call("patrol", {}))
                    await watch.until("executing", 2)
                    assert words(await third.call("patrol", {})) == "`refused`, retry"
                    more.cancel()
                    await asyncio.wait([more])
                    await watch.until("canceled")
                assert patrolling.running() == {goal}

                # Killed, it leaves nothing behind.
                first.serving.signal(signal.SIGKILL)
                await asyncio.wait([calling])
                await watch.until("canceled", 2)
            assert await of_others(second) == []
        assert len(watch.received) == 2

    asyncio.run(scenario())


@pytest.mark.long
def test_goals_that_have_ended_do_not_count(robot: Robot) -> None:
    counting = robot.server("fibonacci", period=0.02)

    async def scenario() -> None:
        async with agent(robot, STDIO) as first, agent(robot, STDIO) as second:
            watch = Watch(counting)
            for one in (first, second, first, second, second):
                result = await one.call("count", {"order": 3})
                assert words(result) == "`succeeded`", result.structured_content
            assert not [one for one in await of_others(first) if one["tool"] == "count"]
        assert await watch.summary() == "; ".join(["a goal, succeeded"] * 5)

    asyncio.run(scenario())
