"""Shared by tests of agents: toolboxes, and a human's stop that the test controls."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Iterator
from typing import Any

import jsonschema
import pytest

from actionkit.agents import Toolbox, ToolResult
from tests import forked

FIBONACCI: dict[str, Any] = {
    "action": "fibonacci",
    "type": "test_msgs/action/Fibonacci",
    "expose": "all",
}
BOUND = 30.0
"""Seconds; only what hangs takes so long."""
Make = Callable[..., Toolbox]


class FakeHold:
    """Stands in for the listener to a human's stop; the test says what it knows."""

    def __init__(self) -> None:
        self.runtime: Any = None
        self.reason: str | None = None
        self.is_known = self.surely_free = True
        self.asked = 0
        self.stop_when_asked: int | None = None
        self.callbacks: list[Callable[[str], object]] = []

    def close(self) -> None:
        from actionkit._ros.communication import runtimes

        runtimes.release(self.runtime, self)
        self.runtime.join_if_stopping(20.0)

    def why_held(self) -> str | None:
        self.asked += 1
        if self.asked == self.stop_when_asked:
            self.stop()
        if not self.is_known:
            return "it is not known yet whether a human has stopped the robot"
        return self.reason

    async def until_known(self, timeout: float) -> bool:
        return self.is_known

    def stop(self, reason: str = "held by ann@desk") -> None:
        """Be the human; on a thread of its own, as the real one."""
        self.reason = reason
        for callback in self.callbacks:
            thread = threading.Thread(target=callback, args=(reason,))
            thread.start()
            thread.join()


@pytest.fixture(scope="session", autouse=True)
def _forked_hosts() -> Iterator[None]:
    """Fork what the SDK of MCP starts, which costs a tenth of starting interpreters for it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("asyncio.unix_events.subprocess", forked.SUBPROCESS)
        yield


@pytest.fixture
def hold(monkeypatch: pytest.MonkeyPatch) -> FakeHold:
    """Return the human's stop of all toolboxes of the test."""
    fake = FakeHold()

    def listen(domain_id: int | None, on_hold: Callable[[str], object]) -> FakeHold:
        from actionkit._ros.communication import runtimes

        fake.runtime = runtimes.acquire(domain_id, fake)  # the real one keeps a node, too
        fake.callbacks.append(on_hold)
        return fake

    monkeypatch.setattr("actionkit.agents._tool_calls.clients.HoldListener", listen)
    return fake


@pytest.fixture
def make_toolbox(ros_domain: int, hold: FakeHold) -> Iterator[Callable[..., Toolbox]]:
    """Make toolboxes in the test's domain; what is left open is closed at its end."""
    made: list[Toolbox] = []

    def make(tools: Any = None, topics: Any = None) -> Toolbox:
        config = {"domain_id": ros_domain, "tools": tools or {}, "topics": topics or {}}
        made.append(Toolbox.from_config(config))
        return made[-1]

    yield make
    for toolbox in made:
        toolbox.close()


async def seen(server: Any, event: str, count: int = 1) -> None:
    """Wait for an event of a server without blocking the event loop."""
    await asyncio.to_thread(server.wait_for, event, count=count, timeout=BOUND)


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
