"""A robot, all four kinds of agents that drive it over MCP, and the results."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import json
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mcp.client.stdio
import mcp.types as t
import pytest
from mcp import Client, StdioServerParameters
from mcp.shared.exceptions import MCPError

from actionkit import servers
from actionkit.servers import Server, ServerEvent
from actionkit.testing import isolated_domain
from tests import forked
from tests.conftest import Script
from tests.waiting import until_in_loop

PATIENCE = 40.0
"""Seconds; bounds a wait that only a bug makes long."""
ENDS = ("rejected", "succeeded", "canceled", "aborted")
HOLDS_SOON_KNOWN = """
from contextlib import suppress
with suppress(ImportError):
    import actionkit._ros.holds.view as holds
    holds.SETTLE = 0.5
"""
"""For 4 s a process listens for holds of other computers before it calls; here there are none."""

CONFIG = """
[tools.count]
action = "/fibonacci"
type = "test_msgs/action/Fibonacci"
description = "Counts as far as it is told to."
timeout = 60.0
[tools.count.fields.order]
minimum = 1
maximum = 40

[tools.ask]
action = "/fibonacci"
type = "test_msgs/action/Fibonacci"
description = "Counts, after a human has agreed."
timeout = 60.0
confirm = "always"
[tools.ask.fields.order]
minimum = 1
maximum = 40

[tools.patrol]
action = "/never_finishes"
type = "test_msgs/action/Fibonacci"
description = "Goes round until it is stopped."
expose = "all"
timeout = 600.0
concurrent = 2

[tools.hurry]
action = "/never_finishes"
type = "test_msgs/action/Fibonacci"
description = "Goes round, for a second."
expose = "all"
timeout = 1.0

[tools.script]
action = "/scripted"
type = "test_msgs/action/Fibonacci"
description = "Does what the test has written down for it."
expose = "all"
timeout = 60.0

[tools.stubborn]
action = "/refuses_cancel"
type = "test_msgs/action/Fibonacci"
description = "Counts, and does not let itself be stopped."
expose = "all"
timeout = 60.0

[tools.late]
action = "/slow_accept"
type = "test_msgs/action/Fibonacci"
description = "Counts, when it has thought about it."
expose = "all"
timeout = 60.0

[tools.absent]
action = "/absent"
type = "test_msgs/action/Fibonacci"
description = "Nobody does it."
expose = "all"
timeout = 1.0
"""


@dataclass(frozen=True)
class Way:
    """How an agent talks to the robot."""

    transport: str
    era: str

    @property
    def mode(self) -> str:
        return "legacy" if self.era < "2026" else "auto"

    def __str__(self) -> str:
        return f"{self.transport}, {self.era}"


WAYS = [Way(way, era) for way in ("stdio", "HTTP") for era in ("2025-11-25", "2026-07-28")]
# By default each transport and each era once: the other two ways are these, combined otherwise.
each_way = pytest.mark.parametrize(
    "way",
    [
        pytest.param(way, marks=[pytest.mark.long] if way in WAYS[1:3] else [], id=str(way))
        for way in WAYS
    ],
)


@dataclass
class Robot:
    """A ROS domain with reference servers, and the file that describes its tools."""

    domain: int
    file: Path
    stack: ExitStack
    servers: dict[str, Server] = field(default_factory=dict)
    holds_soon_known: bool = True

    def server(self, name: str, **options: Any) -> Server:
        """Return the server, on the action of its name; started where it does not run."""
        if name not in self.servers:
            self.servers[name] = self.stack.enter_context(
                servers.start(name, action_name=name, domain_id=self.domain, **options)
            )
        return self.servers[name]

    @property
    def environment(self) -> dict[str, str]:
        return {
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "PYTHONWARNINGS": "default",
            "ACTIONKIT_HOLD_DIR": os.environ["ACTIONKIT_HOLD_DIR"],
            "ACTIONKIT_LEDGER": str(self.ledger),
        }

    @property
    def ledger(self) -> Path:
        """The file in which each `actionkit mcp` writes down its goals."""
        return self.file.with_name("goals.db")

    def words(self, *more: str, before: str = "") -> list[str]:
        """The command; `before` is code to run first, in the same process."""
        soon = HOLDS_SOON_KNOWN if self.holds_soon_known else ""
        code = f"{before}\n{soon}\nfrom actionkit.cli import main; main()"
        domain = ("--domain-id", str(self.domain))
        return [sys.executable, "-c", code, "mcp", str(self.file), *domain, *more]


@contextlib.contextmanager
def robot(directory: Path) -> Iterator[Robot]:
    file = directory / "robot.toml"
    file.write_text(CONFIG)
    before = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE")
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"  # for the servers
    try:
        with isolated_domain() as domain, ExitStack() as stack:
            yield Robot(domain, file, stack)
    finally:
        del os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"]
        if before is not None:
            os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = before


class Serving:
    """A process of `actionkit mcp`."""

    def __init__(self, pid: int) -> None:
        self.pid = pid
        self._descriptor = os.pidfd_open(pid)

    def is_gone(self, patience: float = 0.0) -> bool:
        """Whether it has ended, within some seconds."""
        poll = select.poll()
        poll.register(self._descriptor, select.POLLIN)
        return bool(poll.poll(patience * 1000))

    def signal(self, number: int) -> None:
        signal.pidfd_send_signal(self._descriptor, number)

    def close(self) -> None:
        if not self.is_gone():
            self.signal(signal.SIGKILL)
        os.close(self._descriptor)


class HttpServing(Serving):
    """One that serves over HTTP; it outlives its clients."""

    def __init__(
        self,
        robot: Robot,
        *more: str,
        at: str = "127.0.0.1:0",
        before: str = "",
        **environment: str,
    ) -> None:
        self.log = robot.file.with_name("http.txt")
        self._errors = open(self.log, "w")  # noqa: SIM115
        self.process = forked.Popen(
            robot.words("--http", at, *more, before=before),
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            env=os.environ | robot.environment | environment,
        )
        super().__init__(self.process.pid)
        self.url = Script(self.process).line().split()[-1]

    def code(self) -> int:
        return self.process.wait(PATIENCE)

    def close(self) -> None:
        super().close()
        self.process.wait()
        assert self.process.stdout is not None
        self.process.stdout.close()
        self._errors.close()


class Agent:
    """A client of the SDK, and the process that serves it."""

    def __init__(self, client: Client, serving: Serving, process: Any = None) -> None:
        self.client = client
        self.serving = serving
        self._process = process
        self.progress: list[tuple[float, str]] = []

    async def call(self, tool: str, arguments: Any, **more: Any) -> t.CallToolResult:
        """Call a tool, taking down its progress."""

        async def take(progress: float, total: float | None, message: str | None) -> None:
            self.progress.append((progress, message or ""))

        return await self.client.call_tool(tool, arguments, progress_callback=take, **more)

    async def told(self, tool: str, arguments: Any, **more: Any) -> str:
        """Call a tool; return what the agent was told, in a few words."""
        try:
            return words(await self.call(tool, arguments, **more))
        except MCPError as error:
            return f"error {error.code}: {error}"

    async def goals(self) -> list[dict[str, Any]]:
        """Return what the tool `goals` tells, when all goals have ended."""
        deadline = time.monotonic() + PATIENCE
        while True:
            result = await self.client.call_tool("goals", {})
            assert not result.is_error, result
            goals = result.structured_content["goals"]
            if not any(goal["status"] in ("running", "canceling") for goal in goals):
                return goals
            assert time.monotonic() < deadline, goals

    async def exit_code(self) -> int:
        """Wait for the end of the process, over stdio."""
        with contextlib.suppress(ProcessLookupError):
            await asyncio.wait_for(self._process.wait(), PATIENCE)
        return int(self._process.returncode)


def words(result: t.CallToolResult) -> str:
    """What an agent was told, in a few words."""
    value = result.structured_content
    if value is None:
        return " ".join(block.text for block in result.content if isinstance(block, t.TextContent))
    text = json.loads(next(b.text for b in result.content if isinstance(b, t.TextContent)))
    assert text == value  # the same in both forms
    said = f"`{value['status']}`"
    if value.get("may_still_run"):
        said += ", may still run"
    retry = (value.get("error") or {}).get("retry")
    if retry is not None:
        said += f", {'' if retry else 'no '}retry"
    assert result.is_error == (value["status"] != "succeeded"), value
    return said


@contextlib.asynccontextmanager
async def agent(
    robot: Robot, way: Way, http: HttpServing | None = None, *, before: str = "", **options: Any
) -> AsyncIterator[Agent]:
    """Connect a client of the SDK; over stdio, it starts the process as hosts do.

    Args:
        robot: Its tools are served.
        way: How.
        http: What serves over HTTP.
        before: Code for the process to run first.
        options: For the client of the SDK.
    """
    if way.transport == "HTTP":
        assert http is not None
        async with Client(http.url, mode=way.mode, **options) as client:
            assert client.protocol_version == way.era
            yield Agent(client, http)
        return
    command, *arguments = robot.words(before=before)
    parameters = StdioServerParameters(command=command, args=arguments, env=robot.environment)
    started: list[Any] = []
    create = mcp.client.stdio._create_platform_compatible_process

    async def creating(*args: Any, **kwargs: Any) -> Any:
        # The SDK keeps the process to itself, and whether it ends in time matters here.
        started.append(await create(*args, **kwargs))
        return started[0]

    mcp.client.stdio._create_platform_compatible_process = creating
    try:
        client = Client(parameters, mode=way.mode, **options)
        await client.__aenter__()
    finally:
        mcp.client.stdio._create_platform_compatible_process = create
    serving = Serving(started[0].pid)
    try:
        assert client.protocol_version == way.era
        yield Agent(client, serving, started[0])
    finally:
        await client.__aexit__(None, None, None)
        serving.close()


class Watch:
    """What reaches an action server from now on."""

    def __init__(self, server: Server) -> None:
        self.server = server
        server.sync()  # a goal before may not be in the journal yet
        self._before = {e.goal_id for e in server.events if e.event == "goal_received"}

    @property
    def events(self) -> list[ServerEvent]:
        return [e for e in self.server.events if e.goal_id and e.goal_id not in self._before]

    @property
    def received(self) -> list[str]:
        return [str(e.goal_id) for e in self.events if e.event == "goal_received"]

    async def until(self, event: str, count: int = 1) -> None:
        """Wait for events of new goals."""
        seen = sum(e.event == event for e in self.server.events if e.goal_id in self._before)
        await asyncio.to_thread(self.server.wait_for, event, count=seen + count, timeout=PATIENCE)

    def _has_ended(self, goal: str) -> bool:
        return any(e.goal_id == goal and e.event in ENDS for e in self.events)

    async def summary(self, patience: float = PATIENCE) -> str:
        """Wait for the ends of all goals; in a few words."""
        await asyncio.to_thread(self.server.sync)  # the answer may be ahead of the journal
        goals = self.received
        for goal in goals:
            ended = functools.partial(self._has_ended, goal)
            with contextlib.suppress(AssertionError):  # it runs on
                await until_in_loop(ended, goal, bound=patience)
        ends = [
            next((e.event for e in self.events if e.goal_id == goal and e.event in ENDS), "runs on")
            for goal in goals
        ]
        return "; ".join(f"a goal, {end}" for end in ends) or "nothing"
