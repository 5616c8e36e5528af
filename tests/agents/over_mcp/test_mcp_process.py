"""Signals, in a process that only waits for its end. No ROS."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from actionkit import Ledger
from actionkit.agents._mcp.process import _watcher, goals_left
from tests import forked
from tests.agents.over_mcp.lab import PATIENCE

_PROGRAM = """
import asyncio, os, signal, sys, time
from actionkit.agents._mcp.process import Ending

hang, ignored = sys.argv[1:]

class Calls:
    def cancel_all(self, why):
        print("cancelled", flush=True)

class Toolbox:
    _calls = Calls()

    def goals(self):
        return ()

async def main():
    if int(ignored):
        signal.signal(int(ignored), signal.SIG_IGN)
    ending = Ending(Toolbox(), None)
    if int(ignored):
        os.kill(os.getpid(), int(ignored))
    print("waits", flush=True)
    if hang:
        time.sleep(60)
    await ending.asked.wait()
    os._exit(ending.code)

asyncio.run(main())
"""


def ended(first: int, *more: int, hang: bool = False, ignored: int = 0) -> tuple[int, float]:
    """Send signals; return the exit code, and how many seconds the end took after the first."""
    process = forked.Popen(
        [sys.executable, "-c", _PROGRAM, "yes" if hang else "", f"{ignored:d}"],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    try:
        assert process.stdout.readline() == "waits\n"
        process.send_signal(first)
        began = time.monotonic()
        if hang:  # else the event loop does it
            assert process.stdout.readline() == "cancelled\n"
            assert process.poll() is None  # not only at the end
        for number in more:  # of two at once, the system may deliver the second first
            process.send_signal(number)
        return process.wait(PATIENCE), time.monotonic() - began
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


@pytest.mark.parametrize(("number", "code"), [("SIGINT", 130), ("SIGTERM", 143), ("SIGHUP", 129)])
@pytest.mark.parametrize("hang", [False, True])
@pytest.mark.every
def test_a_signal_cancels_and_ends_in_time(number: str, code: int, hang: bool) -> None:
    ended_with, seconds = ended(signal.Signals[number], hang=hang)
    assert ended_with == code
    assert seconds < 8.0  # 4 is promised; what is measured here also counts a busy machine


def test_a_signal_that_was_ignored_stays_ignored() -> None:
    """As SIGHUP is under `nohup`."""
    code, _ = ended(signal.SIGTERM, ignored=signal.SIGHUP)
    assert code == 143


@pytest.mark.long
def test_the_first_reason_counts() -> None:
    code, _ = ended(signal.SIGTERM, signal.SIGINT, hang=True)
    assert code == 143


_LEFT = """
import asyncio, time
from actionkit.agents._mcp import process

class Toolbox:
    class _calls:
        cancel_all = print

async def main():
    process.Ending(Toolbox, None).ask(0, "the host closed its end")
    time.sleep(60)

process.goals_left = lambda toolbox, watcher: ["goal 1 may still be running"]
asyncio.run(main())
"""


@pytest.mark.long
def test_the_exit_code_tells_of_a_goal_that_may_run_even_if_the_event_loop_hangs() -> None:
    command = [sys.executable, "-c", _LEFT]
    done = forked.run(command, check=False, capture_output=True, timeout=PATIENCE)
    assert b"goal 1 may still be running" in done.stderr
    assert done.returncode == 23


_NO_THREADS = """
import asyncio, threading
from actionkit.agents._mcp import process

class Toolbox:
    class _calls:
        cancel_all = print

    async def __aenter__(self):
        pass

    async def cancel_all(self):
        pass

    async def aclose(self):
        await asyncio.to_thread(print)

    def goals(self):
        print("its goals are looked at")
        return ()

def refuse(thread):
    raise RuntimeError("can't start new thread")

async def serve(server, ending):
    threading.Thread.start = refuse
    ending.ask(5, "the host closed its end")
    await asyncio.Event().wait()

process.make_server = lambda *_: None
process._watcher = lambda ledger: None
process._run(Toolbox(), "", None, serve, lambda: asyncio.to_thread(print))
"""


def test_it_cancels_and_ends_even_if_no_thread_can_be_started() -> None:
    command = [sys.executable, "-u", "-c", _NO_THREADS]
    done = forked.run(command, check=False, capture_output=True, timeout=PATIENCE)
    assert done.returncode == 5
    assert b"all goals were cancelled" in done.stdout
    assert b"its goals are looked at" in done.stdout


def test_a_goal_is_named_even_if_no_process_can_go_on_cancelling_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    class Toolbox:
        def goals(self) -> tuple[dict[str, Any], ...]:
            return ({"goal_id": "1", "tool": "arm", "may_still_run": True},)

        def action_of(self, tool: str) -> str:
            return f"/{tool}"

    def refused(*_: Any, **__: Any) -> Any:
        raise BlockingIOError("no more processes")

    monkeypatch.setattr("subprocess.Popen", refused)
    watcher = _watcher(Ledger(tmp_path / "goals.db"))
    assert "(no more processes). If this one is killed, its goals run on" in capfd.readouterr().err
    toolbox: Any = Toolbox()
    assert goals_left(toolbox, watcher) == [
        "goal 1 of /arm may still be running; nothing goes on cancelling it"
    ]
