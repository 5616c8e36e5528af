"""The form of results for clients, and progress when nothing changes."""

from __future__ import annotations

import asyncio
import base64
from typing import Any

import mcp.types as t
import pytest
from geometry_msgs.msg import Point

from actionkit.agents import Image, Progress, ToolResult
from actionkit.agents._answers.progress import telling
from actionkit.agents._mcp.approval import Questions
from actionkit.agents._mcp.session import _answered, _reporting
from tests.agents.over_mcp.lab import WAYS, HttpServing, Robot, Watch, agent
from tests.waiting import until_in_loop


def test_pictures_come_as_pictures() -> None:
    image = Image("image/png", b"\x89PNG")
    answer = _answered(ToolResult({"status": "ok"}, is_error=False, images=(image,)))
    text, picture = answer.content
    assert isinstance(text, t.TextContent)
    assert isinstance(picture, t.ImageContent)
    assert picture.mime_type == "image/png"
    assert base64.b64decode(picture.data) == image.data


def test_text_that_is_no_unicode_is_told_all_the_same() -> None:
    answer = _answered(ToolResult({"status": "aborted", "why": "a\ud800b"}, is_error=True))
    assert answer.structured_content == {"status": "aborted", "why": "a?b"}
    assert answer.model_dump_json()


def test_a_question_is_good_for_one_goal() -> None:
    stops = 0
    questions = Questions(lambda: stops)
    first, second, third = questions.ask(), questions.ask(), questions.ask()
    assert not questions.answered(None)
    assert not questions.answered("made up")
    assert questions.answered(second)
    assert not questions.answered(second)
    assert questions.answered(first)
    stops += 1
    assert not questions.answered(third), "a human has stopped the robot meanwhile"


def test_a_client_that_does_not_read_is_told_the_newest_and_numbers_grow() -> None:
    async def scenario() -> None:
        told: list[tuple[float, str]] = []
        asked, reading, told_twice = asyncio.Event(), asyncio.Event(), asyncio.Event()

        async def send(progress: float, total: None, message: str) -> None:
            asked.set()
            await reading.wait()
            told.append((progress, message))
            if len(told) == 2:
                told_twice.set()

        with telling(_reporting(send), lambda: "EXECUTING") as on_feedback:
            assert on_feedback is not None
            on_feedback(Point())
            await asked.wait()
            for _ in range(1000):
                on_feedback(Point())
            reading.set()
            await told_twice.wait()
        (first, oldest), (second, newest) = told
        assert first < second
        assert oldest.startswith("EXECUTING, feedback 1: ")
        assert newest.startswith("EXECUTING, feedback 1001: ")

    asyncio.run(asyncio.wait_for(scenario(), 30))


def test_numbers_grow_however_fast_they_come() -> None:
    async def scenario() -> None:
        told: list[float] = []

        async def send(progress: float, total: None, message: str) -> None:
            told.append(progress)

        report: Any = _reporting(send)
        for _ in range(100):
            await report(Progress(0.0, 0, "", None))
        assert told == sorted(set(told))

    asyncio.run(scenario())


@pytest.mark.long
def test_progress_comes_where_nothing_changes(robot: Robot, http: HttpServing) -> None:
    watch = Watch(robot.server("never_finishes"))

    async def scenario() -> None:
        async with agent(robot, WAYS[2], http) as connected:
            calling = asyncio.ensure_future(connected.call("patrol", {}))
            await watch.until("executing")
            progress = connected.progress
            await until_in_loop(lambda: any(seconds > 4.5 for seconds, _ in progress), progress)
            calling.cancel()
            await asyncio.wait([calling])
        assert await watch.summary() == "a goal, canceled"

    asyncio.run(scenario())
