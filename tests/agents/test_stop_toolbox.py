"""The real `actionkit stop` and a real `Toolbox`, with calls in every phase."""

from __future__ import annotations

import asyncio
import subprocess
import sys
from collections.abc import Iterator

import pytest

from actionkit.agents import ApprovalRequest, Toolbox
from actionkit.testing.plugin import ActionServerFactory
from tests.agents.conftest import BOUND, FIBONACCI, seen
from tests.holding import end_keepers

TOOLS = {
    "run": {**FIBONACCI, "timeout": 100.0},
    "ask": {**FIBONACCI, "timeout": 100.0, "confirm": "always"},
    "wait": {**FIBONACCI, "action": "absent", "timeout": 100.0, "retries": 9},
}


@pytest.fixture
def domain(ros_domain: int) -> Iterator[int]:
    """Leave no hold behind."""
    yield ros_domain
    end_keepers(ros_domain)


async def human(domain: int, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "actionkit", "stop", *words, "--domain-id", str(domain)]
    return await asyncio.to_thread(
        subprocess.run, command, capture_output=True, text=True, timeout=BOUND, check=False
    )


def test_a_stop_reaches_every_call_and_a_release_ends_it(
    domain: int, action_server: ActionServerFactory
) -> None:
    server = action_server("fibonacci", period=0.5)
    asked, answer = asyncio.Event(), asyncio.Event()

    async def approve(request: ApprovalRequest) -> bool:
        asked.set()
        await answer.wait()
        return True

    async def main() -> None:
        async with Toolbox.from_config({"tools": TOOLS}, domain_id=domain) as toolbox:
            running = asyncio.create_task(toolbox.call("run", {"order": 90}))
            asking = asyncio.create_task(toolbox.call("ask", {"order": 90}, approve=approve))
            waiting = asyncio.create_task(toolbox.call("wait", {"order": 90}))
            await asked.wait()
            await seen(server, "executing")
            stopped = await human(domain)
            assert stopped.returncode == 0, stopped
            assert "1 in sight obey" in stopped.stdout
            # The server told of what ran, or the toolbox did; the human counts in any case.
            assert (await running).value["status"] == "canceled"
            # It ends by itself after five seconds without a server.
            late = (await waiting).value
            assert late["status"] in ("canceled", "no_server")
            assert not late["may_still_run"]
            answer.set()
            refused = (await asking).value
            assert (refused["status"], refused["error"]["type"]) == ("refused", "held")
            again = (await toolbox.call("run", {"order": 1})).value
            assert (again["status"], again["error"]["type"]) == ("refused", "held")
            server.sync()
            assert server.count("goal_received") == 1
            assert server.running() == set()
            assert (await human(domain, "--release")).returncode == 0
            assert (await toolbox.call("run", {"order": 1})).value["status"] == "succeeded"

    asyncio.run(main())


def test_an_approval_given_while_the_robot_was_stopped_and_released_does_not_count(
    domain: int, action_server: ActionServerFactory
) -> None:
    server = action_server("fibonacci")

    async def approve(request: ApprovalRequest) -> bool:
        for words in ((), ("--release",)):
            assert (await human(domain, *words)).returncode == 0
        return True

    async def main() -> None:
        async with Toolbox.from_config({"tools": TOOLS}, domain_id=domain) as toolbox:
            value = (await toolbox.call("ask", {"order": 1}, approve=approve)).value
            assert (value["status"], value["error"]["type"]) == ("refused", "cancelled")

    asyncio.run(main())
    server.sync()
    assert server.count("goal_received") == 0
