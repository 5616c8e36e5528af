"""The progress of a call while its goal runs."""

from __future__ import annotations

import asyncio
import math

import pytest
from geometry_msgs.msg import Point
from sensor_msgs.msg import BatteryState

from actionkit.agents import ApprovalRequest, Progress
from actionkit.agents._answers.progress import telling
from actionkit.testing.plugin import ActionServerFactory
from tests.agents.conftest import BOUND, FIBONACCI, Make, told


@pytest.mark.long
def test_progress_comes_also_while_nothing_changes(
    make_toolbox: Make, action_server: ActionServerFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("actionkit.agents._answers.progress._EVERY", 0.02)
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


@pytest.mark.long
def test_progress_comes_also_while_a_human_is_asked(
    make_toolbox: Make, action_server: ActionServerFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("actionkit.agents._answers.progress._EVERY", 0.02)
    server = action_server("fibonacci", period=0.01)

    async def main() -> list[str]:
        async with make_toolbox({"fib": {**FIBONACCI, "confirm": "always"}}) as toolbox:
            told_of: list[str] = []
            twice = asyncio.Event()

            def on_progress(progress: Progress) -> None:
                told_of.append(progress.message)
                if len(told_of) == 2:
                    twice.set()

            async def approve(request: ApprovalRequest) -> bool:
                await asyncio.wait_for(twice.wait(), BOUND)
                return False

            await toolbox.call("fib", {"order": 3}, on_progress=on_progress, approve=approve)
            return told_of

    assert set(asyncio.run(main())) == {"waiting for a human to approve this"}
    server.sync()
    assert server.count("goal_received") == 0


@pytest.mark.long
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


def test_the_end_of_a_call_is_the_end_even_if_on_progress_swallows_a_cancellation(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("actionkit.agents._answers.progress._EVERY", 0.02)

    async def main() -> None:
        asked = asyncio.Event()

        async def on_progress(progress: Progress) -> None:
            again = asked.is_set()
            asked.set()
            try:
                await asyncio.Event().wait()
            except asyncio.CancelledError:
                if again:
                    raise

        with telling(on_progress, lambda: "EXECUTING"):
            await asyncio.wait_for(asked.wait(), BOUND)
        (teller,) = asyncio.all_tasks() - {asyncio.current_task()}
        done, _ = await asyncio.wait([teller], timeout=BOUND)
        assert done

    asyncio.run(main())


def test_percent_is_read_as_the_command_line_reads_it() -> None:
    async def told_of(*messages: object) -> Progress:
        told: asyncio.Future[Progress] = asyncio.get_running_loop().create_future()
        with telling(told.set_result, lambda: "EXECUTING") as on_feedback:
            assert on_feedback is not None
            for message in messages:
                on_feedback(message)
            return await asyncio.wait_for(told, BOUND)

    assert asyncio.run(told_of(BatteryState(percentage=40.0))).percent == 40.0
    assert asyncio.run(told_of(BatteryState(percentage=140.0))).percent == 100.0
    assert asyncio.run(told_of(BatteryState(percentage=math.nan))).percent is None
    assert asyncio.run(told_of(Point(x=1.0))).percent is None
