"""Calls between client and toolbox, at exact moments. No ROS."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Awaitable, Callable
from typing import Any

import mcp.types as t
import pytest

from actionkit.agents import ApprovalRequest
from actionkit.agents._mcp import http, process
from actionkit.agents._mcp.approval import Asked, CannotAskError
from actionkit.agents._mcp.calls import Calls, EndingError, GoneError


class Box:
    """Stands in for a toolbox, and takes down which calls it was asked for.

    Attributes:
        begun: Set when a call waits for its goal; none does without it.
    """

    def __init__(self, begun: asyncio.Event | None = None) -> None:
        self.called: list[str] = []
        self.begun = begun

    async def call(self, name: str, arguments: Any, **more: Any) -> Any:
        self.called.append(name)
        if self.begun is not None:
            self.begun.set()
            try:
                await asyncio.Event().wait()
            finally:
                self.called.append("cancelled")

    async def cancel_all(self) -> tuple[()]:
        return ()

    async def __aenter__(self) -> Box:
        return self

    async def aclose(self) -> None:
        pass


def asked_by(elicit: Callable[[], Awaitable[t.ElicitResult]]) -> Asked:
    """Return what asks a human over a connection, where `elicit` is the client's answer."""

    class Session:
        async def elicit_form(self, *args: Any) -> t.ElicitResult:
            return await elicit()

    class Context:
        session = Session()
        request_id = 1

    context: Any = Context()
    return Asked(context)


def test_a_call_whose_task_begins_when_the_process_ends_sends_nothing() -> None:
    async def scenario() -> None:
        box: Any = Box()
        calls = Calls(box)
        run = calls.run("patrol", {}, gone=None, on_progress=None, approve=None)
        running = asyncio.ensure_future(run)
        asyncio.get_running_loop().call_soon(setattr, calls, "_ending", True)
        with pytest.raises(EndingError):
            await running
        assert box.called == []

    asyncio.run(scenario())


def test_a_client_that_hangs_up_while_its_request_is_served_is_gone() -> None:
    seen: list[bool] = []

    async def app(scope: Any, receive: Any, send: Any) -> None:
        await receive()
        seen.append(scope[http.GONE].is_set())
        await asyncio.wait_for(scope[http.GONE].wait(), 10)
        seen.append(scope[http.GONE].is_set())

    async def scenario() -> None:
        heard = iter(({"type": "http.request"}, {"type": "http.disconnect"}))

        async def receive() -> Any:
            return next(heard)

        scope: Any = {"type": "http", "headers": []}
        await http._Watched(app)(scope, receive, receive)

    asyncio.run(scenario())
    assert seen == [False, True]


def test_the_end_waits_until_the_goals_were_cancelled_and_not_for_ever() -> None:
    async def scenario() -> None:
        box: Any = Box()
        confirmed = asyncio.Event()
        box.cancel_all = confirmed.wait
        ending = asyncio.ensure_future(Calls(box).end(60.0))
        for _ in range(20):
            await asyncio.sleep(0)
        assert not ending.done()
        confirmed.set()
        await asyncio.wait_for(ending, 10)
        confirmed.clear()
        await asyncio.wait_for(Calls(box).end(0.01), 10)

    asyncio.run(scenario())


@pytest.mark.parametrize("before", [True, False])
def test_a_client_that_is_gone_gets_nothing_sent_or_its_goal_cancelled(before: bool) -> None:
    async def scenario() -> None:
        begun, gone = asyncio.Event(), asyncio.Event()
        box: Any = Box(begun)
        run = Calls(box).run("patrol", {}, gone=gone, on_progress=None, approve=None)
        running = asyncio.ensure_future(run)
        if before:
            await asyncio.sleep(0)  # the connection shows that it is closed a moment later
        else:
            await begun.wait()
        gone.set()
        with pytest.raises(GoneError):
            await asyncio.wait_for(running, 10)
        assert box.called == ([] if before else ["patrol", "cancelled"])

    asyncio.run(scenario())


def test_no_call_begins_before_what_is_left_over_was_cancelled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of the processes before this one."""
    cancelled = threading.Event()
    box: Any = Box()
    seen: list[list[str]] = []

    class Ending:
        def __init__(self, *_: object) -> None:
            self.asked, self.why = asyncio.Event(), ""

        def ask(self, *_: object) -> None:
            self.asked.set()

        name_goals_left = end = lambda self: None

    async def serve(calls: Any, ending: Any) -> None:
        run = calls.run("patrol", {}, gone=None, on_progress=None, approve=None)
        running = asyncio.ensure_future(run)
        for _ in range(10):  # it would begin in its first turn
            await asyncio.sleep(0)
        seen.append([*box.called])
        cancelled.set()
        await running
        seen.append([*box.called])

    async def flush() -> None:
        pass

    monkeypatch.setattr(process, "Ending", Ending)
    monkeypatch.setattr(process, "_watcher", lambda ledger: None)
    monkeypatch.setattr(process, "make_server", lambda toolbox, calls, version: calls)
    monkeypatch.setattr(process, "cancel_leftovers", lambda ledger: cancelled.wait(30))
    nothing: Any = None
    asyncio.run(process._serve(box, "1", nothing, serve, flush))
    assert seen == [[], ["patrol"]]


def test_a_request_cancelled_as_the_human_answers_is_cancelled() -> None:
    async def scenario() -> None:
        answer: asyncio.Future[t.ElicitResult] = asyncio.get_running_loop().create_future()
        asked = asyncio.Event()

        async def elicit() -> t.ElicitResult:
            asked.set()
            return await answer

        asking = asked_by(elicit)
        task = asyncio.ensure_future(asking(ApprovalRequest("patrol", {}, "?")))
        await asked.wait()
        answer.set_result(t.ElicitResult(action="accept", content={"approve": True}))
        for _ in range(4):  # whichever turn it takes until the answer arrives
            await asyncio.sleep(0)
            if task.cancel():
                break
        await asyncio.wait([task])
        assert task.cancelled()

    asyncio.run(scenario())


def test_an_answer_that_cannot_be_understood_is_a_refusal_in_plain_words() -> None:
    async def scenario() -> None:
        async def elicit() -> t.ElicitResult:
            return t.ElicitResult.model_validate({"action": "go on", "content": 3})

        asking = asked_by(elicit)
        with pytest.raises(CannotAskError, match=r"^the client's answer to the question cannot be"):
            await asking(ApprovalRequest("patrol", {}, "?"))

    asyncio.run(scenario())
