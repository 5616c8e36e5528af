"""Calls of actions: the result for each ending, and that given-up goals are cancelled."""

from __future__ import annotations

import asyncio
import json
import sys
import threading
from typing import Any

import pytest
import rclpy
from test_msgs.action import Fibonacci

from actionkit import Client
from actionkit.agents import Progress, Toolbox
from actionkit.agents._mcp.process import goals_left
from actionkit.agents._tool_calls.clients import Clients
from actionkit.agents._tool_calls.goals import Goals
from actionkit.testing import isolated_domain
from actionkit.testing.plugin import ActionServerFactory
from tests.agents.conftest import FIBONACCI, FakeHold, Make, seen, told
from tests.waiting import until_in_loop

# --- each ending -------------------------------------------------------------------------------


def test_a_goal_that_succeeds(make_toolbox: Make, action_server: ActionServerFactory) -> None:
    server = action_server("fibonacci", period=0.02)
    progress: list[Progress] = []

    async def main() -> None:
        async with make_toolbox({"fib": FIBONACCI}) as toolbox:
            value = told(
                toolbox, await toolbox.call("fib", {"order": 30.0}, on_progress=progress.append)
            )
            assert (value["status"], value["error"]) == ("succeeded", None)
            assert value["result"]["sequence"][:5] == [0, 1, 1, 2, 3]
            assert (value["may_still_run"], value["attempts"]) == (False, 1)
            (goal,) = toolbox.goals(value["goal_id"])
            assert (goal["status"], goal["may_still_run"]) == ("succeeded", False)
        after = await toolbox.call("fib", {"order": 1})
        assert after.value["error"]["type"] == "closed"

    asyncio.run(main())
    server.sync()
    assert server.count("accepted") == 1
    assert progress
    assert "sequence" in progress[-1].message
    assert progress[-1].feedback_count > 1


@pytest.mark.parametrize(
    ("server", "options", "timeout", "status", "may_run", "retry"),
    [
        ("vanishes", {}, 60.0, "lost", True, False),
        ("aborts", {}, 20.0, "aborted", False, False),
        ("guarded", {}, 20.0, "rejected", False, False),
        ("never_finishes", {}, 1.0, "timed_out", False, False),
        ("cancels_itself", {}, 20.0, "canceled", False, False),
        ("wrong_type", {}, 20.0, "failed", False, False),
        (None, {}, 0.5, "no_server", False, True),
        ("silent", {}, 1.0, "timed_out", True, False),
    ],
)
def test_how_goals_fail(
    make_toolbox: Make,
    action_server: ActionServerFactory,
    server: str | None,
    options: dict[str, Any],
    timeout: float,
    status: str,
    may_run: bool,
    retry: bool,
) -> None:
    if server is not None:
        action_server(server, **options)

    async def main() -> None:
        async with make_toolbox({"fib": {**FIBONACCI, "timeout": timeout}}) as toolbox:
            order = 1000 if server == "guarded" else 5
            value = told(toolbox, await toolbox.call("fib", {"order": order}))
            assert value["status"] == status, value
            assert value["may_still_run"] is may_run
            assert value["error"]["retry"] is retry
            assert value["error"]["message"]
            assert value["error"]["advice"]
            sent = server not in (None, "wrong_type")
            assert value["attempts"] == int(sent)
            assert (value["goal_id"] is None) == (not sent)
            (goal,) = toolbox.goals()
            assert goal["status"] == status
            assert (goal["goal_id"], goal["may_still_run"]) == (value["goal_id"], may_run)

    asyncio.run(main())


@pytest.mark.parametrize("given_up", [False, True])
def test_what_waits_for_a_server_does_not_run(make_toolbox: Make, given_up: bool) -> None:
    async def main() -> None:
        async with make_toolbox({"fib": {**FIBONACCI, "timeout": 2.0}}) as toolbox:
            calling = asyncio.create_task(toolbox.call("fib", {"order": 5}))
            await until_in_loop(lambda: toolbox.goals() != (), "a call")
            (goal,) = toolbox.goals()
            assert (goal["status"], goal["may_still_run"], goal["goal_id"]) == (
                ("running", False, None)
            )
            assert goals_left(toolbox, None) == []
            if given_up:
                calling.cancel()
            await asyncio.wait([calling])
            (goal,) = toolbox.goals()
            status = "canceled" if given_up else "no_server"
            assert (goal["status"], goal["may_still_run"], goal["goal_id"]) == (status, False, None)
            assert "may still be running" not in str(goal["error"])

    asyncio.run(main())


def test_a_goal_that_cannot_be_cancelled_is_not_sent_beside(
    make_toolbox: Make, action_server: ActionServerFactory
) -> None:
    server = action_server("refuses_cancel", gate=1)

    async def main() -> None:
        async with make_toolbox({"fib": {**FIBONACCI, "timeout": 1.0}}) as toolbox:
            value = told(toolbox, await toolbox.call("fib", {"order": 3}))
            assert (value["status"], value["cancel"]) == ("timed_out", "refused")
            assert value["may_still_run"]
            refused = told(toolbox, await toolbox.call("fib", {"order": 3}))
            assert refused["error"]["type"] == "too_many_goals"
            assert value["goal_id"] in refused["error"]["message"]
            server.sync()
            assert server.count("accepted") == 1
            server.release()
            await seen(server, "succeeded")
            await until_in_loop(lambda: toolbox.goals()[0]["status"] == "succeeded")
            assert not toolbox.goals()[0]["may_still_run"]
            again = told(toolbox, await toolbox.call("fib", {"order": 3}))
            assert again["status"] == "succeeded"

    asyncio.run(main())


@pytest.mark.long
def test_the_tools_of_one_action_share_its_limit(
    make_toolbox: Make, action_server: ActionServerFactory
) -> None:
    server = action_server("fibonacci", period=0.05)

    async def main() -> None:
        other = {**FIBONACCI, "action": "/fibonacci", "concurrent": 2}
        async with make_toolbox({"fib": FIBONACCI, "other": other}) as toolbox:
            calling = asyncio.create_task(toolbox.call("other", {"order": 90}))
            await seen(server, "accepted")
            refused = told(toolbox, await toolbox.call("fib", {"order": 3}))
            assert refused["error"]["type"] == "too_many_goals"
            assert told(toolbox, await toolbox.call("other", {"order": 3}))["error"] is None
            calling.cancel()
            await asyncio.wait([calling])
            assert told(toolbox, await toolbox.call("fib", {"order": 3}))["error"] is None

    asyncio.run(main())
    server.sync()
    assert server.count("goal_received") == 3


def test_the_limit_counts_where_the_goals_are_sent(
    make_toolbox: Make, action_server: ActionServerFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The names of a process with ROS arguments are those that its clients use."""
    server = action_server("fibonacci", gate=1, action_name="robot1/fibonacci")
    other = action_server("fibonacci", gate=1, action_name="fibonacci")
    monkeypatch.setattr(sys, "argv", ["agent", "--ros-args", "-r", "__ns:=/robot1"])

    async def main() -> None:
        async with Client(Fibonacci, "/robot1/fibonacci") as program:
            goal = program.call_async({"order": 1}, timeout=60.0)
            await seen(server, "accepted")
            async with make_toolbox({"fib": {**FIBONACCI, "action": "fibonacci"}}) as toolbox:
                refused = told(toolbox, await toolbox.call("fib", {"order": 1}))
                assert refused["error"]["type"] == "too_many_goals"
                assert str(goal.goal_id) in refused["error"]["message"]
                (listed,) = (await toolbox.call("goals")).value["goals"]
                assert listed["goal_id"] == str(goal.goal_id)
            server.release()
            await goal

    asyncio.run(main())
    for one, count in ((server, 1), (other, 0)):
        one.sync()
        assert one.count("goal_received") == count


def test_a_toolbox_stays_in_its_first_domain(
    hold: FakeHold, ros_domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else it would look for the goals of others where its clients are not."""
    clients = Clients(None, Goals())

    async def domains() -> list[int | None]:
        first = await clients.read(lambda domain, stopped: domain)
        monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain + 1))
        return [first, await clients.read(lambda domain, stopped: domain)]

    try:
        assert asyncio.run(domains()) == [ros_domain, ros_domain]
    finally:
        clients.close()


def test_nothing_is_sent_where_the_goals_of_others_cannot_be_looked_for(
    make_toolbox: Make, action_server: ActionServerFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    server = action_server("fibonacci")

    def broken(*_: Any) -> Any:
        raise OSError("for the test")

    async def main() -> None:
        async with make_toolbox({"fib": FIBONACCI}) as toolbox:
            with monkeypatch.context() as patch:
                patch.setattr("actionkit._ros.others_goals.watch.goals_in_flight", broken)
                refused = told(toolbox, await toolbox.call("fib", {"order": 1}))
                assert (refused["status"], refused["error"]["type"]) == ("refused", "failed")
            assert (await toolbox.call("fib", {"order": 1})).value["status"] == "succeeded"

    asyncio.run(main())
    server.sync()
    assert server.count("goal_received") == 1


# --- what else ---------------------------------------------------------------------------------


@pytest.mark.long
def test_what_does_not_exist_is_refused(make_toolbox: Make, action_server: Any) -> None:
    action_server("wrong_type")

    async def main() -> None:
        async with make_toolbox({"fib": {**FIBONACCI, "timeout": 20.0}}) as toolbox:
            unknown = (await toolbox.call("x" * 1_000_000, {})).value
            assert unknown["error"]["type"] == "unknown_tool"
            assert len(str(unknown)) < 1000
            assert (await toolbox.call("fib", [1])).is_error  # type: ignore[arg-type]
            assert (await toolbox.call(3)).is_error  # type: ignore[arg-type]
            wrong = told(toolbox, await toolbox.call("fib", {"order": 1}))
            assert wrong["status"] in ("failed", "no_server")
            assert (await toolbox.call("goals", {"goal_id": "x"})).is_error
            assert (await toolbox.call("goals", {"id": "x"})).is_error
            assert not (await toolbox.call("goals")).is_error

    asyncio.run(main())


@pytest.mark.long
def test_the_event_loop_is_never_held(
    make_toolbox: Make, action_server: ActionServerFactory
) -> None:
    action_server("fibonacci", period=0.05)
    latest: list[float] = []

    async def main() -> None:
        loop = asyncio.get_running_loop()

        async def tick() -> None:
            while True:
                before = loop.time()
                await asyncio.sleep(0.01)
                latest.append(loop.time() - before)

        async with make_toolbox({"fib": FIBONACCI}) as toolbox:
            ticking = asyncio.create_task(tick())
            await toolbox.call("fib", {"order": 10})
            threads = {thread.name for thread in threading.enumerate()}
            assert not any(name.startswith("asyncio_") for name in threads)
            ticking.cancel()

    asyncio.run(main())
    assert len(latest) > 10


@pytest.mark.long
def test_two_calls_that_are_the_same_are_two_goals(
    make_toolbox: Make, action_server: ActionServerFactory
) -> None:
    server = action_server("fibonacci", period=0.05)

    async def main() -> None:
        async with make_toolbox({"fib": {**FIBONACCI, "concurrent": 2}}) as toolbox:
            calls = [asyncio.create_task(toolbox.call("fib", {"order": 90})) for _ in range(2)]
            await seen(server, "accepted", 2)
            told_of = {goal["goal_id"] for goal in toolbox.goals()}
            assert {e.goal_id for e in server.events if e.event == "accepted"} == told_of
            calls[0].cancel()
            await asyncio.wait(calls[:1])
            assert sorted(goal["status"] for goal in toolbox.goals()) == ["canceled", "running"]
            calls[1].cancel()
            await asyncio.wait(calls)

    asyncio.run(main())
    assert server.count("goal_received") == 2


@pytest.mark.long
@pytest.mark.parametrize("elsewhere", ["the environment", "rclpy.init()"])
def test_its_domain_is_not_that_of(
    elsewhere: str,
    action_server: ActionServerFactory,
    hold: FakeHold,
    ros_domain: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    server = action_server("fibonacci")
    # The toolbox is told its domain only where the environment names another one.
    told = ros_domain if elsewhere == "the environment" else None

    async def main(other: int) -> None:
        async with Toolbox.from_config({"tools": {"fib": FIBONACCI}}, domain_id=told) as box:
            assert box.domain_id == ros_domain
            if told is None:
                rclpy.init(args=[], domain_id=other)
            assert (await box.call("fib", {"order": 1})).value["status"] == "succeeded"
            # The context of others does not end what the toolbox does.
            rclpy.try_shutdown()
            assert (await box.call("fib", {"order": 1})).value["status"] == "succeeded"

    with isolated_domain() as other:
        if told is not None:
            monkeypatch.setenv("ROS_DOMAIN_ID", str(other))
        asyncio.run(main(other))
    server.wait_for("succeeded", count=2)


@pytest.mark.long
def test_a_client_that_cannot_go_on_is_replaced(
    make_toolbox: Make, action_server: ActionServerFactory, caplog: pytest.LogCaptureFixture
) -> None:
    server = action_server("fibonacci")

    def die() -> None:
        raise SystemExit("for the test")  # what no handler of ours catches

    async def main() -> None:
        async with make_toolbox({"fib": FIBONACCI}) as toolbox:
            assert (await toolbox.call("fib", {"order": 1})).value["status"] == "succeeded"
            (client,) = toolbox._clients._clients.values()
            runtime = client._session.connection.runtime
            runtime.call_soon(die)
            runtime.join(20)
            assert client.closed
            assert (await toolbox.call("fib", {"order": 1})).value["status"] == "succeeded"

    asyncio.run(main())
    server.wait_for("succeeded", count=2)
    assert "died" in caplog.text


@pytest.mark.long
def test_the_limit_of_goals_holds_also_for_calls_at_the_same_moment(
    make_toolbox: Make, action_server: ActionServerFactory
) -> None:
    server = action_server("fibonacci", gate=1)

    async def main() -> None:
        async with make_toolbox({"fib": {**FIBONACCI, "concurrent": 2}}) as toolbox:
            calls = [asyncio.create_task(toolbox.call("fib", {"order": 1})) for _ in range(6)]
            ended = asyncio.as_completed(calls)
            # The goals run until four calls are refused: the looks of some take longer.
            assert [(await next(ended)).value["status"] for _ in range(4)] == ["refused"] * 4
            await seen(server, "accepted", 2)
            server.release()
            assert [(await call).value["status"] for call in ended] == ["succeeded"] * 2

    asyncio.run(main())
    assert server.count("goal_received") == 2


def test_formats_of_model_apis(make_toolbox: Make) -> None:
    toolbox = make_toolbox({"fib": {**FIBONACCI, "description": "Counts."}})
    assert [tool.name for tool in toolbox.tools] == ["fib", "goals"]
    schema, told = toolbox.tools[0].input_schema, toolbox.tools[0].description
    assert toolbox.openai_tools()[0] == {
        "type": "function",
        "function": {"name": "fib", "description": told, "parameters": schema},
    }
    assert toolbox.anthropic_tools()[0] == {
        "name": "fib",
        "description": told,
        "input_schema": schema,
    }
    assert json.loads(json.dumps(toolbox.openai_tools())) == toolbox.openai_tools()
