"""Standard output has only the protocol; unreadable messages get an answer, too."""

from __future__ import annotations

import asyncio
import json
import os
import pty
import subprocess
import sys

import httpx2
import pytest

from actionkit.agents._mcp.stdio import MOST_BYTES
from tests import forked
from tests.agents.over_mcp import page
from tests.agents.over_mcp.host import Host
from tests.agents.over_mcp.lab import WAYS, HttpServing, Robot, Watch, agent

DEEP = '{"order":' * 10_000 + "1" + "}" * 10_000
LARGE = json.dumps({"order": "1" * 5_000_000})

#: A user's message package says something, and so do libraries in C.
_NOISE = """
import builtins, ctypes, os
from actionkit.agents._mcp.calls import Calls
run = Calls.run
async def noisy(self, *words, **options):
    import sys, rclpy.logging
    print("noise of print")
    sys.__stdout__.write("noise of a stream\\n")
    os.write(1, b"noise of a descriptor\\n")
    ctypes.CDLL(None).puts(b"noise of C")
    rclpy.logging.get_logger("noise").error("noise of the log of rclpy")
    ctypes.CDLL(None).fflush(None)
    os.system("echo noise of a child")
    return await run(self, *words, **options)
Calls.run = noisy
"""


def call(arguments: str, number: int = 90) -> str:
    params = f'{{"name":"count","arguments":{arguments}}}'
    return f'{{"jsonrpc":"2.0","id":{number},"method":"tools/call","params":{params}}}'


def test_stdout_is_the_protocols(robot: Robot) -> None:
    """With the few variables that hosts pass on, and anything that a host sends."""
    watch = Watch(robot.server("fibonacci", period=0.02))
    with Host(robot, before=_NOISE, RCUTILS_LOGGING_USE_STDOUT="1") as host:
        answer = host.answer(host.call("count", order=3))
        assert answer["result"]["structuredContent"]["status"] == "succeeded", answer
        errors = host.errors.read_text()
        for who in ("print", "a stream", "a descriptor", "C", "the log of rclpy", "a child"):
            assert f"noise of {who}" in errors
        assert asyncio.run(watch.summary()) == "a goal, succeeded"

        watch = Watch(watch.server)
        for fault, arguments in (
            ("arguments nested 10,000 deep", DEEP),
            ("a message of 5 MB", LARGE),
        ):
            host.send_line(call(arguments))
            error = host.answer(90)["error"]
            text = f"error {error['code']}: {error['message']}"
            page.record(page.REFUSED, fault, "stdio", asyncio.run(watch.summary()), text)
        assert all(json.loads(line)["jsonrpc"] == "2.0" for line in host.lines)
        host.hang_up()
        assert host.process.stdout is not None
        assert host.process.stdout.read() == b""
        assert host.code() == 0


@pytest.mark.long
def test_messages_over_http_that_cannot_be_read(robot: Robot, http: HttpServing) -> None:
    watch = Watch(robot.server("fibonacci", period=0.02))
    headers = {
        "Content-Type": "application/json",
        "Accept": "application/json, text/event-stream",
        "MCP-Protocol-Version": "2026-07-28",
    }

    async def scenario() -> None:
        async with httpx2.AsyncClient(headers=headers) as client:
            for fault, arguments in (
                ("arguments nested 10,000 deep", DEEP),
                ("a message of 5 MB", LARGE),
            ):
                answer = await client.post(http.url, content=call(arguments))
                told = f"HTTP status {answer.status_code}"
                page.record(page.REFUSED, fault, "HTTP", await watch.summary(), told)
        async with agent(robot, WAYS[3], http) as connected:
            assert await connected.told("count", {"order": 3}) == "`succeeded`"

    asyncio.run(scenario())


@pytest.mark.long
def test_the_longest_line_is_that_of_http() -> None:
    from mcp.server.transport_security import DEFAULT_MAX_REQUEST_BODY_SIZE

    assert MOST_BYTES == DEFAULT_MAX_REQUEST_BODY_SIZE


def run(robot: Robot, *words: str, before: str = "", **environment: str) -> tuple[int, str, str]:
    kept = {name: value for name, value in os.environ.items() if not name.startswith("ACTIONKIT")}
    done = forked.run(
        robot.words(*words, before=before),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        env=kept | environment,
        timeout=60,
        check=False,
    )
    return done.returncode, done.stdout, done.stderr


@pytest.mark.long
def test_a_person_in_a_terminal_is_told_what_this_is(robot: Robot) -> None:
    master, slave = pty.openpty()
    with open(master, "wb"), open(slave, "rb") as terminal:
        done = forked.Popen(
            robot.words(), stdin=terminal, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        assert done.stderr is not None
        told = done.stderr.readline()
        os.write(master, b"\4")  # Ctrl-D
        out, errors = done.communicate(timeout=60)
    assert b"a host starts this command by itself" in told
    assert (done.returncode, out) == (0, b""), errors


@pytest.mark.long
def test_half_of_an_environment_is_made_whole(robot: Robot) -> None:
    """A host passes on the mark of the wheels' bootstrapper, and not what it stands for."""
    code, out, errors = run(robot, _ROS_WHEELS_BOOTSTRAP_COMPLETE="1", LD_LIBRARY_PATH="/nowhere")
    assert (code, out) == (0, ""), errors


@pytest.mark.long
def test_what_is_missing_is_named(robot: Robot) -> None:
    without = "import sys; sys.modules['uvicorn'] = None"
    code, out, errors = run(robot, before=without)
    assert (code, out) == (1, "")
    assert "pip install 'mcp>=2.2,<3' pillow" in errors
    assert "uvicorn" in errors


@pytest.mark.long
def test_a_ledger_that_cannot_be_used(robot: Robot) -> None:
    code, out, errors = run(robot, ACTIONKIT_LEDGER=str(robot.file))
    assert (code, out) == (1, "")
    assert "ledger=" not in errors
    told = "on a disk of this computer. Name it in the environment variable ACTIONKIT_LEDGER"
    assert told in " ".join(errors.split())


@pytest.mark.long
def test_an_output_that_is_closed_at_the_start(robot: Robot) -> None:
    command = ["bash", "-c", 'exec "$@" >&-', "bash", *robot.words()]
    done = subprocess.run(command, input="", stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert "standard input or output is closed" in line


@pytest.mark.long
def test_a_wrong_file_is_told_of_whole(robot: Robot) -> None:
    path = robot.file.with_name("wrong.toml")
    path.write_text('[tools.a]\naction = 7\n[topics.b]\nspeed = "fast"\n')
    command = [sys.executable, "-m", "actionkit", "mcp", str(path)]
    done = forked.run(command, input="", capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "tools.a.action" in done.stderr
    assert "topics.b: there is no key 'speed'" in done.stderr
    assert done.stdout == ""
