"""Calls over MCP that fail or are refused: in both eras, over both transports."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

import anyio
import mcp.types as t
import pytest
from mcp.shared.exceptions import MCPError

from tests.agents.over_mcp import page
from tests.agents.over_mcp.lab import (
    Agent,
    Robot,
    Watch,
    Way,
    agent,
    each_way,
    words,
)

Connect = Callable[..., Any]


@pytest.fixture
def connect(robot: Robot, way: Way, request: pytest.FixtureRequest) -> Connect:
    """Connects an agent of the test's way."""

    @asynccontextmanager
    async def connecting(**options: Any) -> AsyncIterator[Agent]:
        http = request.getfixturevalue("http") if way.transport == "HTTP" else None
        async with agent(robot, way, http, **options) as connected:
            yield connected

    return connecting


async def what_goals_tells(connected: Agent) -> str:
    """What the tool `goals` tells of the latest."""
    latest = (await connected.goals())[0]
    return f"no answer; then `{latest['status']}`" + (
        ", may still run" if latest["may_still_run"] else ""
    )


@each_way
def test_calls_that_come_to_nothing(robot: Robot, way: Way, connect: Connect) -> None:
    counting = robot.server("fibonacci", period=0.02)
    patrolling = robot.server("never_finishes")
    scripted = robot.server("scripted", script=[[{"feedback": 1}, {"abort": [7]}], ["reject"]] * 4)

    async def scenario() -> None:
        async with connect() as connected:
            # What the SDK's client refuses by itself would tell nothing of the server.
            listed = await connected.client.list_tools()
            assert [tool.name for tool in listed.tools][:2] == ["count", "ask"]

            watch = Watch(patrolling)
            with anyio.CancelScope() as scope:

                async def cancel() -> None:
                    await watch.until("executing")
                    scope.cancel()

                async with anyio.create_task_group() as group:
                    group.start_soon(cancel)
                    await connected.call("patrol", {})
            told = await what_goals_tells(connected)
            page.record(page.GIVEN_UP, "the request is cancelled", way, await watch.summary(), told)

            watch = Watch(patrolling)
            with pytest.raises(MCPError, match="timed out"):
                await connected.call("patrol", {}, read_timeout_seconds=0.5)
            told = await what_goals_tells(connected)
            page.record(
                page.GIVEN_UP, "the client's read timeout", way, await watch.summary(), told
            )

            for server, fault, tool, arguments in (
                (scripted, "the server aborts the goal", "script", {"order": 1}),
                (scripted, "the server rejects the goal", "script", {"order": 1}),
                (patrolling, "the tool's time runs out", "hurry", {}),
                (counting, "no server is there", "absent", {"order": 1}),
            ):
                watch = Watch(server)
                told = await connected.told(tool, arguments)
                page.record(page.OUTCOME, fault, way, await watch.summary(), told)

            watch = Watch(counting)
            for fault, tool, arguments in (
                ("a field outside of its limits", "count", {"order": 41}),
                ("a field of another type", "count", {"order": "five"}),
                ("a field that is not there", "count", {"speed": 1.0}),
                ("an unknown tool", "fly", {}),
            ):
                told = await connected.told(tool, arguments)
                page.record(page.REFUSED, fault, way, await watch.summary(), told)

            watch = Watch(patrolling)
            async with anyio.create_task_group() as group:
                group.start_soon(connected.call, "patrol", {})
                group.start_soon(connected.call, "patrol", {})
                await watch.until("executing", 2)
                told = await connected.told("patrol", {})
                assert len(watch.received) == 2
                reached = "nothing"
                fault = "a third goal, where two at a time are allowed"
                page.record(page.REFUSED, fault, way, reached, told)
                group.cancel_scope.cancel()
            assert await watch.summary() == "a goal, canceled; a goal, canceled"

            # It goes on working, and progress grows.
            connected.progress.clear()
            assert await connected.told("count", {"order": 5}) == "`succeeded`"
            seconds = [progress for progress, _ in connected.progress]
            assert seconds == sorted(set(seconds))
            assert seconds

            watch = Watch(patrolling)
            calling = asyncio.ensure_future(connected.told("patrol", {}))
            await watch.until("executing")
            leaving = asyncio.get_running_loop().time()
        # The client has closed the connection, and waited for the process where it is its own.
        took = asyncio.get_running_loop().time() - leaving
        assert took < 2.0
        calling.cancel()
        ended = connected.serving.is_gone()
        assert ended == (way.transport == "stdio")
        process = "ends, < 2 s" if ended else "serves on"
        fault = "the client closes the connection"
        page.record(
            page.GIVEN_UP, fault, way, await watch.summary(), "nothing: it is gone", process
        )

    asyncio.run(scenario())


class Human:
    """Answers what it is asked, in turn; thinks about the last question for ever.

    Attributes:
        asked: The questions.
        thinks: Set when it is asked the last one.
    """

    def __init__(self, *actions: str) -> None:
        self.asked: list[str] = []
        self.thinks = asyncio.Event()
        self._left = list(actions)

    async def __call__(self, ctx: Any, params: t.ElicitRequestFormParams) -> t.ElicitResult:
        self.asked.append(params.message)
        if not self._left:
            self.thinks.set()
            await anyio.sleep_forever()
        action: Any = self._left.pop(0)
        content = {"approve": action == "accept"} if action in ("accept", "untick") else None
        return t.ElicitResult(action="accept" if content else action, content=content)


@each_way
def test_a_human_is_asked_first(robot: Robot, way: Way, connect: Connect) -> None:
    counting = robot.server("fibonacci", period=0.02)

    async def scenario() -> None:
        human = Human("accept", "decline", "cancel", "untick")
        async with connect(elicitation_callback=human) as connected:
            for fault in (
                "they agree",
                "they decline",
                "they dismiss the question",
                "they accept, without the tick",
            ):
                watch = Watch(counting)
                told = await connected.told("ask", {"order": 3})
                page.record(page.ASKED, fault, way, await watch.summary(), told)
            assert len(human.asked) == 4
            assert "3" in human.asked[0]

            watch = Watch(counting)
            async with anyio.create_task_group() as group:
                group.start_soon(connected.call, "ask", {"order": 3})
                await human.thinks.wait()
                group.cancel_scope.cancel()
            # Nothing is left of it: another call is taken as the first one was.
            told = await connected.told("ask", {"order": 0})
            assert "refused" in told
            told = "no answer"
            fault = "the client gives up while the human thinks"
            page.record(page.ASKED, fault, way, await watch.summary(), told)

            told = await connected.told("ask", {"order": 41})
            fault = "the arguments are outside of their limits"
            page.record(page.ASKED, fault, way, await watch.summary(), told)
            assert len(human.asked) == 5  # nobody was bothered with it

            if way.mode == "auto":
                await take_liberties(connected)
        async with connect() as connected:
            watch = Watch(counting)
            told = await connected.told("ask", {"order": 3})
            page.record(page.ASKED, "the client cannot ask", way, await watch.summary(), told)

    async def take_liberties(connected: Agent) -> None:
        """Send what an honest client does not."""
        call = connected.client.session.call_tool
        yes: Any = {"approve": t.ElicitResult(action="accept", content={"approve": True})}
        order = {"order": 3}

        first = await call("ask", order, allow_input_required=True)
        assert isinstance(first, t.InputRequiredResult)
        given: Any = {"input_responses": yes, "request_state": first.request_state}
        once = await call("ask", order, **given, allow_input_required=True)
        assert isinstance(once, t.CallToolResult)
        assert words(once) == "`succeeded`"

        async def tried(fault: str, arguments: dict[str, int], given: Any) -> None:
            watch = Watch(counting)
            try:
                result = await call("ask", arguments, **given, allow_input_required=True)
                told = "the question" if isinstance(result, t.InputRequiredResult) else "?"
            except MCPError as error:
                told = f"error {error.code}: {error}"
            page.record(page.ASKED, fault, way, await watch.summary(), told)

        await tried("the client sends the same approval again", order, given)
        second = await call("ask", order, allow_input_required=True)
        assert isinstance(second, t.InputRequiredResult)
        given = {"input_responses": yes, "request_state": second.request_state}
        fault = "the client changes the arguments after the approval"
        await tried(fault, {"order": 4}, given)
        fault = "the client approves without having been asked"
        await tried(fault, order, {"input_responses": yes})

    asyncio.run(scenario())
