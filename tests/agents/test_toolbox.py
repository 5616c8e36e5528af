"""Calls of actions: how each ending is told, and that nothing runs on that was given up."""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import Callable
from typing import Any

import anyio
import jsonschema
import pytest

from actionkit.agents import ApprovalRequest, Progress, Toolbox, ToolResult
from actionkit.agents._progress import _percent
from actionkit.testing import isolated_domain
from actionkit.testing.plugin import ActionServerFactory
from tests.agents.conftest import BOUND, FIBONACCI, FakeHold, seen
from tests.waiting import until_in_loop

Make = Callable[..., Toolbox]


def told(toolbox: Toolbox, result: ToolResult) -> dict[str, Any]:
    """Return the value, checked against the schema of its tool."""
    value = dict(result.value)
    tool = next(tool for tool in toolbox.tools if tool.name == value["tool"])
    jsonschema.validate(value, tool.output_schema)
    assert result.is_error == (value["error"] is not None)
    goals = all_goals(toolbox)
    jsonschema.validate(goals, toolbox.tools[-1].output_schema)
    return value


def all_goals(toolbox: Toolbox) -> dict[str, Any]:
    return {"tool": "goals", "status": "ok", "goals": list(toolbox.goals()), "error": None}


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
    assert server.count("accepted") == 1
    assert progress
    assert "sequence" in progress[-1].message
    assert progress[-1].feedback_count > 1


@pytest.mark.parametrize(
    ("server", "options", "timeout", "status", "may_run", "retry"),
    [
        ("aborts", {}, 20.0, "aborted", False, False),
        ("guarded", {}, 20.0, "rejected", False, False),
        ("never_finishes", {}, 1.0, "timed_out", False, False),
        ("cancels_itself", {}, 20.0, "canceled", False, False),
        ("vanishes", {}, 60.0, "lost", True, False),
        ("silent", {}, 1.0, "timed_out", True, False),
        (None, {}, 0.5, "no_server", False, True),
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
            assert value["attempts"] == (0 if server is None else 1)
            assert (value["goal_id"] is None) == (server is None)
            (goal,) = toolbox.goals()
            assert goal["status"] == status

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
            assert server.count("accepted") == 1
            server.release()
            await seen(server, "succeeded")
            await until_in_loop(lambda: not toolbox.goals()[0]["may_still_run"])
            assert toolbox.goals()[0]["status"] == "succeeded"
            again = told(toolbox, await toolbox.call("fib", {"order": 3}))
            assert again["status"] == "succeeded"

    asyncio.run(main())


# --- giving up ---------------------------------------------------------------------------------


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
            for turns in [*range(12), 20, 40]:
                task = asyncio.create_task(toolbox.call("fib", {"order": 90}))
                for _ in range(turns):
                    await asyncio.sleep(0)
                if turns > 5:
                    await asyncio.sleep(turns / 4000)
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


# --- a human -----------------------------------------------------------------------------------


def test_a_hold_refuses_and_cancels(
    make_toolbox: Make, action_server: ActionServerFactory, hold: FakeHold
) -> None:
    server = action_server("fibonacci", period=0.05)

    async def main() -> None:
        async with make_toolbox({"fib": FIBONACCI}) as toolbox:
            hold.is_known = False
            value = told(toolbox, await toolbox.call("fib", {"order": 90}))
            assert value["error"]["type"] == "hold_unknown"
            assert value["error"]["retry"]
            hold.is_known = True
            running = asyncio.create_task(toolbox.call("fib", {"order": 90}))
            await seen(server, "accepted")
            hold.stop()
            value = told(toolbox, await running)
            assert value["status"] == "canceled"
            assert "ann@desk" in value["error"]["message"]
            value = told(toolbox, await toolbox.call("fib", {"order": 90}))
            assert (value["status"], value["error"]["type"]) == ("refused", "held")
            hold.reason = None
            assert (await toolbox.call("fib", {"order": 2})).value["status"] == "succeeded"

    asyncio.run(main())
    assert server.count("accepted") == 2


def test_a_hold_between_any_two_steps_keeps_the_goal_back(
    make_toolbox: Make, action_server: ActionServerFactory, hold: FakeHold
) -> None:
    server = action_server("fibonacci")

    async def main() -> int:
        async with make_toolbox({"fib": FIBONACCI}) as toolbox:
            for look in range(1, 10):
                hold.asked, hold.stop_when_asked, hold.reason = 0, look, None
                value = told(toolbox, await toolbox.call("fib", {"order": 1}))
                if value["status"] == "succeeded":
                    return look - 1
                assert value["error"]["type"] == "held"
                assert server.count("goal_received") == 0
        return 0

    looks = asyncio.run(main())
    assert looks >= 3  # before the question, after it, and right before the goal is sent


def test_a_hold_reaches_a_goal_that_waits_for_its_server(
    make_toolbox: Make, action_server: ActionServerFactory, hold: FakeHold
) -> None:
    async def main() -> Any:
        async with make_toolbox({"fib": FIBONACCI}) as toolbox:
            waiting = asyncio.create_task(toolbox.call("fib", {"order": 90}))
            await until_in_loop(toolbox.goals)
            hold.stop()
            value = told(toolbox, await waiting)
            assert (value["status"], value["may_still_run"]) == ("canceled", False)
            return await asyncio.to_thread(action_server, "fibonacci")

    server = asyncio.run(main())
    assert server.count("goal_received") == 0


def test_approval(make_toolbox: Make, action_server: ActionServerFactory, hold: FakeHold) -> None:
    server = action_server("fibonacci")
    asked: list[ApprovalRequest] = []
    tool = {**FIBONACCI, "confirm": "always", "fields": {"order": {"maximum": 5}}}

    async def main() -> None:
        async with make_toolbox({"fib": tool}) as toolbox:

            async def yes(request: ApprovalRequest) -> bool:
                asked.append(request)
                return True

            async def no(request: ApprovalRequest) -> bool:
                return False

            async def yes_but_stopped(request: ApprovalRequest) -> bool:
                hold.stop()
                return True

            async def yes_but_cancelled(request: ApprovalRequest) -> bool:
                await toolbox.cancel_all()
                return True

            async def raises(request: ApprovalRequest) -> bool:
                raise ConnectionError("the human has gone")

            async def refused(arguments: Any, approve: Any) -> str:
                result = await toolbox.call("fib", arguments, approve=approve)
                assert result.value["status"] == "refused"
                return str(told(toolbox, result)["error"]["type"])

            assert await refused({"order": 1}, None) == "nobody_to_ask"
            assert await refused({"order": 1}, no) == "not_approved"
            assert await refused({"order": 6}, yes) == "invalid_arguments"
            assert asked == []
            assert await refused({"order": 1}, yes_but_cancelled) == "cancelled"
            assert await refused({"order": 1}, yes_but_stopped) == "held"
            hold.reason = None
            with pytest.raises(ConnectionError):
                await toolbox.call("fib", {"order": 1}, approve=raises)
            assert server.count("goal_received") == 0
            value = told(toolbox, await toolbox.call("fib", {"order": 1}, approve=yes))
            assert value["status"] == "succeeded"

    asyncio.run(main())
    (request,) = asked
    assert (request.tool, request.arguments) == ("fib", {"order": 1})
    assert '"order": 1' in request.text


def test_an_answer_that_crosses_with_giving_up_sends_nothing(
    make_toolbox: Make, action_server: ActionServerFactory
) -> None:
    server = action_server("fibonacci")
    tool = {**FIBONACCI, "confirm": "always"}

    async def main() -> None:
        async with make_toolbox({"fib": tool}) as toolbox:
            asked = asyncio.Event()

            async def approve(request: ApprovalRequest) -> bool:
                asked.set()
                try:
                    await asyncio.Event().wait()
                except asyncio.CancelledError:
                    return True  # as `asyncio.wait_for` may do before Python 3.12
                return False

            call = asyncio.create_task(toolbox.call("fib", {"order": 1}, approve=approve))
            await asked.wait()
            call.cancel()
            await asyncio.wait([call])
            assert call.cancelled()
            assert toolbox.goals() == ()

    asyncio.run(main())
    assert server.count("goal_received") == 0


def test_waiting_for_approval_counts_no_goal(
    make_toolbox: Make, action_server: ActionServerFactory
) -> None:
    server = action_server("fibonacci", period=0.05)
    tool = {**FIBONACCI, "confirm": "always"}

    async def main() -> None:
        async with make_toolbox({"fib": tool}) as toolbox:
            answer: asyncio.Future[bool] = asyncio.get_running_loop().create_future()
            asked = asyncio.Event()

            async def slow(request: ApprovalRequest) -> bool:
                asked.set()
                return await answer

            async def yes(request: ApprovalRequest) -> bool:
                return True

            waiting = asyncio.create_task(toolbox.call("fib", {"order": 1}, approve=slow))
            await asked.wait()
            assert toolbox.goals() == ()
            running = asyncio.create_task(toolbox.call("fib", {"order": 90}, approve=yes))
            await seen(server, "accepted")
            answer.set_result(True)
            value = told(toolbox, await waiting)  # the limit is looked at again
            assert value["error"]["type"] == "too_many_goals"
            running.cancel()

    asyncio.run(main())
    assert server.count("accepted") == 1


# --- progress ----------------------------------------------------------------------------------


def test_progress_comes_also_while_nothing_changes(
    make_toolbox: Make, action_server: ActionServerFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("actionkit.agents._progress._EVERY", 0.02)
    action_server("fibonacci", feedback=0, gate=1)
    seen_so_far: list[Progress] = []

    async def main() -> None:
        async with make_toolbox({"fib": FIBONACCI}) as toolbox:
            enough = asyncio.Event()

            async def on_progress(progress: Progress) -> None:
                seen_so_far.append(progress)
                if len(seen_so_far) == 3:
                    enough.set()

            call = asyncio.create_task(toolbox.call("fib", {"order": 90}, on_progress=on_progress))
            await asyncio.wait_for(enough.wait(), BOUND)
            call.cancel()
            await asyncio.wait([call])

    asyncio.run(main())
    elapsed = [progress.elapsed for progress in seen_so_far]
    assert elapsed == sorted(elapsed)


def test_progress_that_raises_harms_nobody(
    make_toolbox: Make, action_server: ActionServerFactory, caplog: pytest.LogCaptureFixture
) -> None:
    action_server("fibonacci", period=0.01)

    def on_progress(progress: Progress) -> None:
        raise ZeroDivisionError

    async def main() -> None:
        async with make_toolbox({"fib": FIBONACCI}) as toolbox:
            value = told(toolbox, await toolbox.call("fib", {"order": 50}, on_progress=on_progress))
            assert value["status"] == "succeeded"

    asyncio.run(main())
    assert caplog.text.count("on_progress raised") == 1


@pytest.mark.parametrize(
    ("feedback", "percent"),
    [
        ({"percent": 40}, 40.0),
        ({"state": {"percent_complete": 140.0}}, 100.0),
        ({"percent": "NaN"}, None),
        ({"percent": True, "left": 3}, None),
    ],
)
def test_percent(feedback: dict[str, Any], percent: float | None) -> None:
    assert _percent(feedback) == percent


# --- its end -----------------------------------------------------------------------------------

LEFT_OPEN = """
import asyncio, sys
from actionkit.agents import Toolbox
FIBONACCI = {"action": "fibonacci", "type": "test_msgs/action/Fibonacci"}
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


# --- what else ---------------------------------------------------------------------------------


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


def test_another_domain_than_the_environments(
    action_server: ActionServerFactory,
    hold: FakeHold,
    ros_domain: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    action_server("fibonacci")

    async def main() -> None:
        async with Toolbox.from_config({"tools": {"fib": FIBONACCI}}, domain_id=ros_domain) as box:
            assert box.domain_id == ros_domain
            assert (await box.call("fib", {"order": 1})).value["status"] == "succeeded"

    with isolated_domain() as other:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(other))
        asyncio.run(main())


def test_the_limit_of_goals_holds_also_for_calls_at_the_same_moment(
    make_toolbox: Make, action_server: ActionServerFactory
) -> None:
    server = action_server("fibonacci", gate=1)

    async def main() -> None:
        async with make_toolbox({"fib": {**FIBONACCI, "concurrent": 2}}) as toolbox:
            calls = [asyncio.create_task(toolbox.call("fib", {"order": 1})) for _ in range(6)]
            await seen(server, "accepted", 2)
            server.release()
            statuses = [(await call).value["status"] for call in calls]
            assert sorted(statuses) == ["refused"] * 4 + ["succeeded"] * 2

    asyncio.run(main())
    assert server.count("goal_received") == 2


def test_formats_of_model_apis(make_toolbox: Make) -> None:
    toolbox = make_toolbox({"fib": {**FIBONACCI, "description": "Counts."}})
    assert [tool.name for tool in toolbox.tools] == ["fib", "goals"]
    schema = toolbox.tools[0].input_schema
    assert toolbox.openai_tools()[0] == {
        "type": "function",
        "function": {"name": "fib", "description": "Counts.", "parameters": schema},
    }
    assert toolbox.anthropic_tools()[0] == {
        "name": "fib",
        "description": "Counts.",
        "input_schema": schema,
    }
    assert json.loads(json.dumps(toolbox.openai_tools())) == toolbox.openai_tools()
