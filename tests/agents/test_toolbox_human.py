"""A human's answers to the calls of a toolbox: stop, and yes or no."""

from __future__ import annotations

import asyncio
from functools import partial
from typing import Any

import pytest
from test_msgs.action import Fibonacci

from actionkit import Client, Verdict
from actionkit.agents import ApprovalRequest
from actionkit.agents._tool_calls import clients
from actionkit.testing.plugin import ActionServerFactory
from tests.agents.conftest import FIBONACCI, FakeHold, Make, seen, told
from tests.waiting import until_in_loop


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
    server.sync()
    assert server.count("accepted") == 2


@pytest.mark.long
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
                server.sync()
                assert server.count("goal_received") == 0
        return 0

    looks = asyncio.run(main())
    assert looks >= 3  # before the question, after it, and right before the goal is sent


@pytest.mark.long
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


@pytest.mark.long
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

            async def almost_yes(request: ApprovalRequest) -> Any:
                return "yes"  # nothing but True is an approval

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
            assert await refused({"order": 1}, almost_yes) == "not_approved"
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


@pytest.mark.long
def test_no_human_is_asked_while_another_program_has_a_goal(
    make_toolbox: Make, action_server: ActionServerFactory
) -> None:
    server = action_server("fibonacci", period=0.05)
    asked: list[ApprovalRequest] = []

    async def approve(request: ApprovalRequest) -> bool:
        asked.append(request)
        return True

    async def main() -> None:
        confirmed = {**FIBONACCI, "confirm": "always"}
        async with (
            make_toolbox({"fib": FIBONACCI}) as other,
            make_toolbox({"fib": confirmed}) as one,
        ):
            calling = asyncio.create_task(other.call("fib", {"order": 90}))
            await seen(server, "accepted")
            value = told(one, await one.call("fib", {"order": 3}, approve=approve))
            assert value["error"]["type"] == "too_many_goals"
            assert not asked
            calling.cancel()
            await asyncio.wait([calling])
            assert told(one, await one.call("fib", {"order": 3}, approve=approve))["error"] is None
            assert len(asked) == 1

    asyncio.run(main())


def test_a_goal_that_others_sent_while_the_stop_was_not_known_counts(
    make_toolbox: Make,
    action_server: ActionServerFactory,
    hold: FakeHold,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The process stood still while a human was asked; the goals are looked for after that."""
    server = action_server("fibonacci", gate=1)

    async def main() -> None:
        async with (
            Client(Fibonacci, "/fibonacci") as program,
            make_toolbox({"fib": {**FIBONACCI, "confirm": "always"}}) as toolbox,
        ):
            sent = []

            async def approve(request: ApprovalRequest) -> bool:
                hold.is_known = False
                return True

            async def known(timeout: float) -> bool:
                sent.append(program.call_async({"order": 1}, timeout=60.0))
                await seen(server, "accepted")
                hold.is_known = True
                return True

            monkeypatch.setattr(hold, "until_known", known)
            value = told(toolbox, await toolbox.call("fib", {"order": 1}, approve=approve))
            assert value["error"]["type"] == "too_many_goals"
            server.release()
            await sent[0]

    asyncio.run(main())
    server.sync()
    assert server.count("goal_received") == 1


@pytest.mark.long
@pytest.mark.parametrize(("unknown_after", "error"), [(1, None), (100, "hold_unknown")])
def test_a_call_waits_again_where_a_look_for_goals_made_the_stop_unknown(
    make_toolbox: Make,
    action_server: ActionServerFactory,
    hold: FakeHold,
    monkeypatch: pytest.MonkeyPatch,
    unknown_after: int,
    error: str | None,
) -> None:
    """A look takes a second or more; another agent may come into sight meanwhile."""
    server = action_server("fibonacci")
    looks = 0

    def look(*_: object) -> list[Any]:
        nonlocal looks
        looks += 1
        hold.is_known = looks > unknown_after
        return []

    async def known(timeout: float) -> bool:
        hold.is_known = True
        return True

    monkeypatch.setattr("actionkit._ros.others_goals.watch.goals_in_flight", look)
    monkeypatch.setattr(hold, "until_known", known)

    async def main() -> None:
        async with make_toolbox({"fib": FIBONACCI}) as toolbox:
            value = told(toolbox, await toolbox.call("fib", {"order": 1}))
            assert (value["error"] or {}).get("type") == error

    asyncio.run(main())
    server.sync()
    assert server.count("goal_received") == (error is None)


@pytest.mark.parametrize("free", [True, False])
def test_a_failed_goal_is_sent_again_only_if_surely_nobody_has_stopped_the_robot(
    make_toolbox: Make,
    action_server: ActionServerFactory,
    hold: FakeHold,
    monkeypatch: pytest.MonkeyPatch,
    free: bool,
) -> None:
    server = action_server("aborts")
    transient = partial(clients.client_in_domain, classify=lambda outcome: Verdict.TRANSIENT)
    monkeypatch.setattr(clients, "client_in_domain", transient)
    hold.surely_free = free

    async def main() -> dict[str, Any]:
        async with make_toolbox({"fib": FIBONACCI}) as toolbox:
            value: dict[str, Any] = told(toolbox, await toolbox.call("fib", {"order": 1}))
            return value

    error = asyncio.run(main())["error"]
    server.sync()
    assert server.count("goal_received") == (3 if free else 1)
    if not free:
        assert error["type"] == "cancelled"
        assert "not sent again: it was not known any more" in error["message"]
