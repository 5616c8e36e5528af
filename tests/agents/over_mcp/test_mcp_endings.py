"""An agent, or the process that serves it, ends in any way: its goals are cancelled in time."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from mcp.shared.exceptions import MCPError

from tests import forked
from tests.agents.over_mcp import leaver, page
from tests.agents.over_mcp.host import Host
from tests.agents.over_mcp.lab import (
    PATIENCE,
    WAYS,
    HttpServing,
    Robot,
    Serving,
    Watch,
    Way,
    agent,
    each_way,
    words,
)
from tests.waiting import until

SOON = 2.0
"""Seconds until a host would send the next, harder signal; no run may take longer."""
AT_LAST = 4.0
STDIO, MODERN_STDIO, HTTP, MODERN_HTTP = WAYS
GONE = "nothing: it is gone"


def seconds_until_gone(serving: Serving) -> float:
    began = time.monotonic()
    assert serving.is_gone(PATIENCE)
    return time.monotonic() - began


def mcp_below(pid: int) -> int | None:
    """Return the child of a process, as Linux lists them."""
    with contextlib.suppress(FileNotFoundError):
        with open(f"/proc/{pid}/task/{pid}/children") as children:
            found = children.read().split()
        return int(found[0]) if found else None
    return None


@each_way
def test_the_client_is_killed(robot: Robot, way: Way, request) -> None:
    patrolling = robot.server("never_finishes")
    watch = Watch(patrolling)
    command, *words_ = robot.words()
    http = request.getfixturevalue("http") if way.transport == "HTTP" else None
    told = {
        "mode": way.mode,
        "url": http.url if http else "",
        "stdio": {"command": command, "args": words_, "env": robot.environment},
    }
    client = forked.Popen([sys.executable, leaver.__file__, json.dumps(told)])
    asyncio.run(watch.until("executing"))
    serving = http
    if http is None:
        below = mcp_below(client.pid)
        assert below is not None
        serving = Serving(below)
    assert serving is not None
    client.kill()
    client.wait()
    reached = asyncio.run(watch.summary())
    process = "serves on"
    if http is None:
        assert seconds_until_gone(serving) < SOON
        serving.close()
        process = "ends, < 2 s"
    assert serving is not http or not serving.is_gone()
    page.record(page.GIVEN_UP, "the client is killed (SIGKILL)", way, reached, GONE, process)


@pytest.mark.parametrize(
    ("number", "way"),
    [
        (signal.SIGTERM, STDIO),
        (signal.SIGTERM, HTTP),
        pytest.param(signal.SIGINT, MODERN_STDIO, marks=pytest.mark.long),
        pytest.param(signal.SIGHUP, STDIO, marks=pytest.mark.long),
    ],
)
def test_a_signal(robot: Robot, number: signal.Signals, way: Way) -> None:
    patrolling = robot.server("never_finishes")

    async def scenario() -> None:
        with contextlib.ExitStack() as stack:
            http = None
            if way.transport == "HTTP":
                http = stack.enter_context(contextlib.closing(HttpServing(robot)))
            watch = Watch(patrolling)
            async with agent(robot, way, http) as connected:
                calling = asyncio.ensure_future(connected.call("patrol", {}))
                await watch.until("executing")
                connected.serving.signal(number)
                took = await asyncio.to_thread(seconds_until_gone, connected.serving)
                told = words(await calling)
                code = http.code() if http else await connected.exit_code()
            assert took < SOON
            process = f"ends with {code}, < 2 s"
            fault = number.name
            page.record(page.ENDED, fault, way.transport, await watch.summary(), told, process)

    asyncio.run(scenario())


@pytest.mark.long
def test_the_process_is_killed(robot: Robot) -> None:
    patrolling = robot.server("never_finishes")
    other = HttpServing(robot)

    async def scenario() -> None:
        watch = Watch(patrolling)
        async with agent(robot, HTTP, other) as connected:
            calling = asyncio.ensure_future(connected.call("patrol", {}))
            await watch.until("executing")
            connected.serving.signal(signal.SIGKILL)
            with pytest.raises(MCPError):
                await calling
        told = "error: the connection is closed"
        process = "is gone; another cancels"
        page.record(page.ENDED, "SIGKILL", "HTTP", await watch.summary(), told, process)

    asyncio.run(scenario())
    other.close()


def watchers_of(pid: int) -> list[int]:
    """Return the processes that watch a process."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            words_ = (folder / "cmdline").read_bytes().split(b"\0")
            if b"actionkit._leftovers.watcher" in words_ and str(pid).encode() in words_:
                found.append(int(folder.name))
    return found


def test_all_is_killed_and_the_next_start_cancels_first(robot: Robot) -> None:
    patrolling = robot.server("never_finishes")

    async def scenario() -> None:
        watch = Watch(patrolling)
        with contextlib.closing(HttpServing(robot)) as first:
            async with agent(robot, HTTP, first) as connected:
                calling = asyncio.ensure_future(connected.call("patrol", {}))
                await watch.until("executing")
                (watcher,) = watchers_of(first.process.pid)
                assert os.getsid(watcher) == watcher, "what ends the whole group would end it"
                os.kill(watcher, signal.SIGKILL)
                connected.serving.signal(signal.SIGKILL)
                with pytest.raises(MCPError):
                    await calling
        (goal,) = watch.received
        assert goal in patrolling.running()
        with contextlib.closing(HttpServing(robot)) as second:
            async with agent(robot, HTTP, second) as connected:
                await connected.call("hurry", {})
        seen = [(e.event, e.goal_id == goal) for e in watch.events]
        assert seen.index(("canceled", True)) < seen.index(("goal_received", False))
        page.record(
            page.ENDED,
            "SIGKILL of all its processes, and a call of the next start",
            "HTTP",
            await watch.summary(),
            "error: the connection is closed",
            "is gone; the next start cancels first",
        )

    asyncio.run(scenario())


@pytest.fixture
def deaf(robot: Robot) -> Iterator[tuple[Host, Watch]]:
    """A host whose goal runs, and which reads nothing any more; the pipe to it is full."""
    watch = Watch(robot.server("never_finishes"))
    with Host(robot, ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST") as host:
        host.call("patrol")
        asyncio.run(watch.until("executing"))
        for _ in range(40):  # some KB each
            host.begin("tools/list", {})
        yield host, watch


@pytest.mark.long
def test_a_host_that_reads_nothing_hangs_up(deaf: tuple[Host, Watch]) -> None:
    host, watch = deaf
    wait_until_blocked(host)
    host.hang_up()
    assert seconds_until_gone(host.serving) < SOON
    process = f"ends with {host.code()}, < 2 s"
    fault = "the host reads nothing, and closes standard input"
    page.record(page.GIVEN_UP, fault, "stdio", asyncio.run(watch.summary()), "nothing", process)


@pytest.mark.long
def test_a_host_whose_child_keeps_our_input(robot: Robot) -> None:
    watch = Watch(robot.server("never_finishes"))
    with Host(robot, ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST") as host:
        host.call("patrol")  # which says nothing more, so no write would tell
        asyncio.run(watch.until("executing"))
        assert host.process.stdout is not None
        host.process.stdout.close()  # as the system does for a process that is gone
        assert seconds_until_gone(host.serving) < SOON
        process = f"ends with {host.code()}, < 2 s"
    fault = "the host is killed, and a child of it keeps standard input open"
    reached = asyncio.run(watch.summary())
    page.record(page.GIVEN_UP, fault, "stdio", reached, "nothing: it is gone", process)


@pytest.mark.long
def test_a_host_that_reads_nothing_sends_sigterm(deaf: tuple[Host, Watch]) -> None:
    host, watch = deaf
    wait_until_blocked(host)
    host.serving.signal(signal.SIGTERM)
    assert seconds_until_gone(host.serving) < SOON
    process = f"ends with {host.code()}, < 2 s"
    fault = "SIGTERM, and the host reads nothing"
    page.record(page.ENDED, fault, "stdio", asyncio.run(watch.summary()), "nothing", process)


def wait_until_blocked(host: Host) -> None:
    """Wait until a thread of the process is in `write`, in a pipe that is full."""
    tasks = f"/proc/{host.process.pid}/task"

    def is_blocked() -> bool:
        for task in os.listdir(tasks):
            with contextlib.suppress(OSError), open(f"{tasks}/{task}/wchan") as waits:
                if "pipe_write" in waits.read():
                    return True
        return False

    until(is_blocked, "a thread that is blocked", bound=PATIENCE)


#: The event loop stops, half a second after the first call has begun.
_HANGING = """
import asyncio, time
from actionkit.agents._tool_calls.goals import ToolGoal
over = ToolGoal.over
async def over_and_hang(self, *words):
    asyncio.get_running_loop().call_later(0.5, time.sleep, 60)  # the goal is sent by now
    return await over(self, *words)
ToolGoal.over = over_and_hang
"""


@pytest.mark.long
def test_the_event_loop_hangs(robot: Robot) -> None:
    watch = Watch(robot.server("never_finishes"))
    with Host(robot, before=_HANGING, ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST") as host:
        host.call("patrol")
        asyncio.run(watch.until("executing"))
        hung = threading.Event()
        hung.wait(1.0)  # there is no event to wait for: nothing happens any more
        host.serving.signal(signal.SIGTERM)
        reached = asyncio.run(watch.summary())
        assert not host.serving.is_gone()  # so it was this process that cancelled
        assert seconds_until_gone(host.serving) < AT_LAST
        process = f"ends with {host.code()}, < 4 s"
    fault = "SIGTERM, and the event loop hangs"
    page.record(page.ENDED, fault, "stdio", reached, "nothing", process)


@pytest.mark.long
def test_the_action_server_does_not_answer(robot: Robot) -> None:
    patrolling = robot.server("never_finishes")

    async def scenario() -> None:
        watch = Watch(patrolling)
        async with agent(robot, STDIO) as connected:
            calling = asyncio.ensure_future(connected.call("patrol", {}))
            await watch.until("executing")
            patrolling.pause()
            try:
                connected.serving.signal(signal.SIGTERM)
                took = await asyncio.to_thread(seconds_until_gone, connected.serving)
                told = words(await calling)
                code = await connected.exit_code()
            finally:
                patrolling.resume()
            assert took < AT_LAST
        fault = "SIGTERM, and the action server does not answer (SIGSTOP)"
        process = f"ends with {code}, < 4 s; another goes on cancelling"
        page.record(page.ENDED, fault, "stdio", await watch.summary(), told, process)

    asyncio.run(scenario())


@pytest.mark.long
def test_the_host_hangs_up_and_the_action_server_does_not_answer(robot: Robot) -> None:
    patrolling = robot.server("never_finishes")
    watch = Watch(patrolling)
    with Host(robot, ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST") as host:
        host.call("patrol")
        asyncio.run(watch.until("executing"))
        patrolling.pause()
        try:
            host.hang_up()
            assert seconds_until_gone(host.serving) < AT_LAST
            assert "may still be running" in host.errors.read_text()
        finally:
            patrolling.resume()
        process = f"ends with {host.code()}, < 4 s; another goes on cancelling"
    reached = asyncio.run(watch.summary())
    fault = "standard input is closed, and the action server does not answer"
    page.record(page.ENDED, fault, "stdio", reached, "nothing: it is gone", process)


def test_a_goal_that_is_accepted_after_the_end_is_cancelled(robot: Robot) -> None:
    server = robot.server("slow_accept", gate=1, period=1.0)
    watch = Watch(server)
    with Host(robot, ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST") as host:
        host.call("late", order=40)
        asyncio.run(watch.until("goal_received"))
        host.hang_up()
        assert seconds_until_gone(host.serving) < AT_LAST
        assert "another process goes on cancelling" in host.errors.read_text()
        ended = time.monotonic()

        def asked_after() -> bool:
            return any(e.event == "cancel_requested" and e.monotonic > ended for e in watch.events)

        until(asked_after, "a request of the other process", bound=PATIENCE)
        server.release()
        assert asyncio.run(watch.summary()) == "a goal, canceled"


@pytest.mark.long  # the middleware takes 20 s to notice that the process is dead
def test_a_server_that_is_killed(robot: Robot, http: HttpServing) -> None:
    mortal = robot.server("scripted", script=[["accept", {"feedback": 1}, "never"]])

    async def scenario() -> None:
        async with agent(robot, HTTP, http) as connected:
            watch = Watch(mortal)
            calling = asyncio.ensure_future(connected.told("script", {"order": 1}))
            await watch.until("executing")
            mortal.kill()
            told = await calling
            fault = "the server is killed (SIGKILL)"
            page.record(page.OUTCOME, fault, "HTTP", await watch.summary(patience=0.1), told)

    asyncio.run(scenario())


@pytest.mark.long
def test_a_server_that_refuses_to_cancel(robot: Robot, http: HttpServing) -> None:
    stubborn = robot.server("refuses_cancel", period=0.1)

    async def scenario() -> None:
        async with agent(robot, HTTP, http) as connected:
            watch = Watch(stubborn)
            calling = asyncio.ensure_future(connected.call("stubborn", {"order": 40}))
            await watch.until("executing")
            calling.cancel()
            await watch.until("cancel_refused")
            latest = (await connected.goals())[0]
            running = latest["may_still_run"]
            told = f"no answer; then `{latest['status']}`" + (", may still run" if running else "")
            fault = "the request is cancelled, and the server refuses to cancel"
            page.record(page.OUTCOME, fault, "HTTP", await watch.summary(), told)

    asyncio.run(scenario())
