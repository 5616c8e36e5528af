"""HTTP under a flood: clients without the token lock out nobody, and fill no memory and no disk."""

from __future__ import annotations

import asyncio
import contextlib
import subprocess
import sys
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass
from urllib.parse import urlsplit

import httpx2
import pytest
from mcp import Client
from mcp.client.streamable_http import streamable_http_client

from actionkit.agents._mcp.address import TOKEN_VARIABLE
from tests import forked
from tests.agents.over_mcp import flooder
from tests.agents.over_mcp.lab import PATIENCE, HttpServing, Robot, words
from tests.conftest import Script

TOKEN = "a-secret-of-the-test"
HEADERS = {"Content-Type": "application/json", "Accept": "application/json, text/event-stream"}
MODERN = "2026-07-28"
USUAL_LIMIT = """
import resource
resource.setrlimit(resource.RLIMIT_NOFILE, (1024, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
"""
"""The file descriptors that most systems give to a process."""
MORE_MEMORY = 80_000
"""kB of resident memory that a flood may take: 256 sessions take 13,000, 512 requests the rest."""
MORE_LOG = 20_000
"""Bytes on standard error that a flood may cause in a minute."""


@dataclass(frozen=True)
class Flood:
    """Connections of some kinds: how many, how many of them stay open, how many a second."""

    count: int
    kept: int
    rate: int
    kinds: tuple[str, ...]


SILENT = Flood(1_200, 1_100, 400, ("nothing", "half a head"))
"""More at a time than the process has file descriptors."""
WITHOUT_TOKEN = Flood(300, 200, 100, tuple(flooder.KINDS))
SESSIONS = Flood(600, 100, 200, ("initialize", "another host"))


def memory(pid: int) -> int:
    """Return the resident memory of a process, in kB."""
    with open(f"/proc/{pid}/status") as status:
        return next(int(line.split()[1]) for line in status if line.startswith("VmRSS"))


@contextlib.contextmanager
def flood(serving: HttpServing, what: Flood, times: int) -> Iterator[None]:
    """Flood as long as the block lasts, and with so many times the connections at least."""
    command = [sys.executable, flooder.__file__, str(urlsplit(serving.url).port)]
    flooding = forked.Popen(
        [*command, str(what.kept), str(what.rate), *what.kinds], stdout=subprocess.PIPE, text=True
    )
    try:
        script = Script(flooding)
        while int(script.line()) < what.kept:
            pass
        yield
        while int(script.line()) < what.count * times:
            pass
    finally:
        flooding.kill()
        flooding.wait()
        assert flooding.stdout is not None
        flooding.stdout.close()


@contextlib.asynccontextmanager
async def agent(serving: HttpServing, mode: str) -> AsyncIterator[Client]:
    headers = {"Authorization": f"Bearer {TOKEN}"}
    async with (
        httpx2.AsyncClient(timeout=PATIENCE, headers=headers) as http,
        Client(streamable_http_client(serving.url, http_client=http), mode=mode) as client,
    ):
        yield client


async def call(client: Client) -> str:
    return words(await client.call_tool("count", {"order": 3}))


async def sessions_until_refused(serving: HttpServing) -> int:
    async with httpx2.AsyncClient(timeout=PATIENCE) as client:
        for number in range(300):
            answer = await client.post(serving.url, content=flooder.HELLO, headers=HEADERS)
            if answer.status_code == 503:
                assert "Too many open sessions" in answer.text
                return number
    raise AssertionError("every session was opened")


@pytest.mark.parametrize("times", [1, pytest.param(4, marks=pytest.mark.long)])
@pytest.mark.parametrize(
    ("token", "floods"),
    [
        pytest.param(TOKEN, [SILENT, WITHOUT_TOKEN], id="without the token"),
        pytest.param("", [SESSIONS], id="where none is needed", marks=pytest.mark.long),
    ],
)
def test_a_flood(robot: Robot, token: str, floods: list[Flood], times: int) -> None:
    robot.server("fibonacci", period=0.02)
    with contextlib.closing(
        HttpServing(robot, before=USUAL_LIMIT, **{TOKEN_VARIABLE: token})
    ) as serving:

        async def scenario() -> None:
            # It keeps a stream open, and so its session.
            async with agent(serving, "legacy") as early:
                assert await call(early) == "`succeeded`"
                before, log_before = memory(serving.pid), serving.log.stat().st_size
                for what in floods:
                    with flood(serving, what, times):
                        async with agent(serving, MODERN) as late:
                            assert await call(late) == "`succeeded`"
                    assert await call(early) == "`succeeded`"
                if SESSIONS in floods:
                    assert await sessions_until_refused(serving) <= 256
                assert memory(serving.pid) < before + MORE_MEMORY
                assert serving.log.stat().st_size < log_before + MORE_LOG * times

        asyncio.run(scenario())
