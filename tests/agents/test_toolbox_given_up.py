"""Given-up calls, and toolboxes that end: their goals are cancelled."""

from __future__ import annotations

import asyncio
from typing import Any

import anyio
import pytest

from actionkit.testing.plugin import ActionServerFactory
from tests.agents.conftest import BOUND, FIBONACCI, FakeHold, Make, seen, told


@pytest.mark.parametrize("scope", ["task", "anyio"])
def test_cancelling_the_task_cancels_the_goal_and_waits(
    make_toolbox: Make, action_server: ActionServerFactory, scope: str
) -> None:
    server = action_server("fibonacci", period=0.05)

    async def main() -> None:
        async with make_toolbox({"fib": FIBONACCI}) as toolbox:
            for _ in range(3):  # the limit of goals at a time is free again
                number = server.count("accepted") + 1
                if scope == "task":
                    task = asyncio.create_task(toolbox.call("fib", {"order": 90}))
                    await seen(server, "accepted", number)
                    task.cancel()
                    with pytest.raises(asyncio.CancelledError):
                        await task
                else:
                    async with anyio.create_task_group() as group:
                        group.start_soon(toolbox.call, "fib", {"order": 90})
                        await seen(server, "accepted", number)
                        group.cancel_scope.cancel()
                goal = toolbox.goals()[0]
                assert (goal["status"], goal["may_still_run"]) == ("canceled", False)
                assert goal["why_cancelled"] == "its caller gave up"
                await seen(server, "canceled", number)

    asyncio.run(main())


def test_a_task_cancelled_at_any_moment_leaves_nothing_running(
    make_toolbox: Make, action_server: ActionServerFactory
) -> None:
    server = action_server("fibonacci", period=0.2)

    async def main() -> None:
        async with make_toolbox({"fib": FIBONACCI}) as toolbox:
            told(toolbox, await toolbox.call("fib", {"order": 1}))
            for turns in [*range(12), 20, 40, 100, 200, 400, 800]:
                task = asyncio.create_task(toolbox.call("fib", {"order": 90}))
                for _ in range(turns):
                    await asyncio.sleep(0)
                task.cancel()
                with pytest.raises(asyncio.CancelledError):
                    await task
                assert not any(goal["may_still_run"] for goal in toolbox.goals())
            last = told(toolbox, await toolbox.call("fib", {"order": 1}))
            assert last["status"] == "succeeded"
            for event in server.events:
                if event.event == "accepted":
                    await asyncio.to_thread(ended, server, event.goal_id)

    asyncio.run(main())


def ended(server: Any, goal_id: str) -> None:
    if goal_id in server.running():
        server.wait_for("canceled", goal_id=goal_id, timeout=BOUND)


@pytest.mark.long
def test_cancelling_all_and_closing_end_what_runs(
    make_toolbox: Make, action_server: ActionServerFactory
) -> None:
    server = action_server("fibonacci", period=0.05)

    async def main() -> None:
        toolbox = make_toolbox({"fib": {**FIBONACCI, "concurrent": 3}})
        calls = [asyncio.create_task(toolbox.call("fib", {"order": 90})) for _ in range(3)]
        await seen(server, "accepted", 3)
        one_more = told(toolbox, await toolbox.call("fib", {"order": 1}))
        assert one_more["error"]["type"] == "too_many_goals"
        reports = await toolbox.cancel_all()
        assert [report["status"] for report in reports] == ["canceled"] * 3
        for call in calls:
            value = told(toolbox, await call)
            assert (value["status"], value["cancel"]) == ("canceled", "confirmed")
        last = asyncio.create_task(toolbox.call("fib", {"order": 90}))
        await seen(server, "accepted", 4)
        await toolbox.aclose()
        value = told(toolbox, await last)
        assert (value["status"], value["may_still_run"]) == ("canceled", False)
        await seen(server, "canceled", 4)

    asyncio.run(main())


LEFT_OPEN = """
import asyncio, sys
from actionkit.agents import Toolbox
FIBONACCI = {
    "action": "fibonacci",
    "type": "test_msgs/action/Fibonacci",
    "fields": {"order": {"minimum": 0, "maximum": 1000}},
}
toolbox = Toolbox.from_config({
    "tools": {"fib": FIBONACCI},
    "topics": {"text": {"topic": "text", "type": "std_msgs/msg/String"}},
})
async def main():
    await toolbox.__aenter__()
    reading = asyncio.create_task(toolbox.call("text"))
    asyncio.create_task(toolbox.call("fib", {"order": 90}))
    print("ready", flush=True)
    await asyncio.to_thread(sys.stdin.readline)
asyncio.run(main())
"""


@pytest.mark.long
def test_a_program_that_ends_without_closing_leaves_no_goal_running(
    action_server: ActionServerFactory, run_script: Any
) -> None:
    server = action_server("fibonacci", period=0.1)
    script = run_script(LEFT_OPEN)
    assert script.line() == "ready"
    server.wait_for("accepted", timeout=BOUND)
    script.process.stdin.write("\n")
    script.process.stdin.flush()
    assert script.finish(BOUND) == (0, "", "")
    server.wait_for("canceled")
    assert server.running() == set()


def test_closing_while_it_is_not_known_whether_a_human_holds(
    make_toolbox: Make, hold: FakeHold, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def main() -> None:
        async with make_toolbox({"fib": FIBONACCI}) as toolbox:

            async def closed_meanwhile(timeout: float) -> bool:
                await toolbox.aclose()
                return False

            monkeypatch.setattr(hold, "until_known", closed_meanwhile)
            hold.is_known = False
            value = told(toolbox, await toolbox.call("fib", {"order": 1}))
            assert value["error"]["type"] == "closed"

    asyncio.run(main())
