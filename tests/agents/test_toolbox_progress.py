"""The progress of a call while its goal runs."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from actionkit.agents import Progress
from actionkit.agents._progress import _percent
from actionkit.testing.plugin import ActionServerFactory
from tests.agents.conftest import BOUND, FIBONACCI, Make, told


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
