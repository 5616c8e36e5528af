"""No goal of a killed program is left running, and none is sent twice (C12).

The table is in docs/maintainers/faults.md. What reached the server is read in its own journal.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import pytest
from test_msgs.action import Fibonacci

import actionkit as ak
from actionkit import CancelReport, Client, GoalUnknownError, Ledger
from actionkit.servers import Server
from tests import forked
from tests.conftest import Script, runs_nothing
from tests.faults.killed import (
    ACCEPTED,
    BY_DEFAULT,
    CANCELLING,
    CASES,
    EXECUTING,
    GUARD,
    NEXT_GUARD,
    NOT_SENT,
    PHASES,
    PROGRAM,
    SENT,
    START_CANCELS,
    Case,
    Row,
)
from tests.faults.page import killed

ENOUGH = 60.0
LOOK = "8"
"""Seconds to look for a goal that was never sent."""


class Scene:
    """A server, and a program that has sent it a goal and is killed."""

    def __init__(self, case: Case, server: Server, path: Path, stack: ExitStack) -> None:
        self.case, self.server, self.path, self.stack = case, server, path, stack
        self.guarded = case.way in (GUARD, NEXT_GUARD)
        words = [sys.executable, "-c", PROGRAM, server.action_name, case.phase]
        self.top = self.guard(*words) if self.guarded else self.popen(words)
        pid, self.goal_id = Script(self.top).line().split()
        self.pid = int(pid)

    def popen(self, words: list[str]) -> subprocess.Popen[str]:
        process = forked.Popen(
            words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=dict(os.environ)
        )
        self.stack.enter_context(process)
        self.stack.callback(process.kill)
        return process

    def guard(self, *words: str) -> subprocess.Popen[str]:
        """Start a program with a guard."""
        return self.popen([sys.executable, "-m", "actionkit", "guard", "--timeout", LOOK, *words])

    def kill(self) -> None:
        """Kill the program when its goal is so far, and in one case its guard, too."""
        phase, event = self.case.phase, PHASES[self.case.phase][2]
        if phase == CANCELLING:
            self.server.wait_for("executing", goal_id=self.goal_id)
            assert self.top.stdin is not None
            print("cancel", file=self.top.stdin, flush=True)
        if event:
            self.server.wait_for(event, goal_id=self.goal_id)
            assert Ledger(self.path).leftovers() == []  # its process lives
        doomed = {self.pid} | ({self.top.pid} if self.case.way == NEXT_GUARD else set())
        for pid in sorted(doomed, reverse=True):
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)

    def release(self) -> None:
        """Let the server go on when it has been asked to cancel, or while it is asked."""
        if self.case.phase == CANCELLING:
            self.server.wait_for("cancel_requested", goal_id=self.goal_id, count=2)
        if self.case.phase in (SENT, CANCELLING):
            self.server.release()

    def recover(self, client: Client[Any]) -> None:
        """Do what stops the goal."""
        ledger = Ledger(self.path)
        if self.case.way == GUARD:
            assert self.top.wait(ENOUGH) == -signal.SIGKILL
        elif self.case.way == NEXT_GUARD:
            self.top.wait(ENOUGH)
            assert self.guard("true").wait(ENOUGH) == 0
        elif self.case.way == START_CANCELS:
            self.top.wait(ENOUGH)
            (goal,) = ledger.leftovers()
            assert (str(goal.goal_id), goal.pid) == (self.goal_id, self.pid)
            never = self.case.phase == NOT_SENT
            report = CancelReport.NOT_NEEDED if never else CancelReport.CONFIRMED
            assert ledger.cancel(float(LOOK) if never else ENOUGH) == {goal: report}
        else:
            self.top.wait(ENOUGH)
            (future,) = ledger.attach(client)
            assert ledger.attach(client) == []
            if self.case.phase == NOT_SENT:  # the usual way to go on
                with pytest.raises(GoalUnknownError):
                    future.result(ENOUGH)
                future = client.call_async({"order": 100})
                self.server.wait_for("executing", goal_id=str(future.goal_id))
            future.cancel()
            assert future.outcome(ENOUGH).status is ak.GoalState.CANCELED


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ACTIONKIT_LEDGER", str(tmp_path / "goals.db"))
    return tmp_path / "goals.db"


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(
            case,
            id=f"{case.way}, {case.phase}",
            marks=() if case in BY_DEFAULT else pytest.mark.long,
        )
        for case in CASES
    ],
)
def test_a_killed_program_leaves_no_goal_running(
    case: Case,
    action_server: Callable[..., Server],
    make_client: Callable[..., Client[Any]],
    path: Path,
) -> None:
    kind, options, _ = PHASES[case.phase]
    server = action_server(kind, **options)
    client = make_client(Fibonacci, server.action_name, timeouts=ak.Timeouts(server=60, cancel=60))
    with ExitStack() as stack:
        if case.phase == ACCEPTED:  # a goal before it; this one is ours
            before = client.call_async({"order": 100})
            server.wait_for("executing", goal_id=str(before.goal_id))
        scene = Scene(case, server, path, stack)
        scene.kill()
        began = time.monotonic()
        others = stack.enter_context(ThreadPoolExecutor(1))
        recovery = others.submit(scene.recover, client)
        scene.release()
        if case.phase == ACCEPTED:
            server.wait_for("cancel_requested", goal_id=scene.goal_id)
            before.cancel()
        if case.phase != NOT_SENT:
            server.wait_for("canceled", goal_id=scene.goal_id, timeout=ENOUGH)
        seconds = time.monotonic() - began
        recovery.result(ENOUGH)
    client.close()
    assert runs_nothing(server)
    assert Ledger(path).leftovers() == []
    print(f"stopped {seconds:.1f} s after the kill")
    received = server.count("goal_received") - (case.phase == ACCEPTED)
    killed(Row(case, received, len(server.running()), seconds))


RUNS_ANOTHER = """
import subprocess, sys
program = subprocess.Popen(sys.argv[1:])
while program.returncode is None:
    try:
        program.communicate()
    except KeyboardInterrupt:
        pass
sys.exit(program.returncode)
"""
"""As `ros2 run` does it."""


@pytest.mark.long
@pytest.mark.parametrize("ends", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL])
def test_a_goal_of_a_program_that_another_one_has_started(
    ends: signal.Signals, action_server: Callable[..., Server], path: Path
) -> None:
    server = action_server("never_finishes")
    program = [sys.executable, "-c", PROGRAM, server.action_name, EXECUTING]
    words = [sys.executable, "-m", "actionkit", "guard", sys.executable, "-c", RUNS_ANOTHER]
    pipe = subprocess.PIPE
    options = {"stdin": pipe, "stdout": pipe, "text": True, "env": dict(os.environ)}
    with forked.Popen([*words, *program], **options) as guard:
        pid, goal_id = Script(guard).line().split()
        try:
            server.wait_for("executing", goal_id=goal_id)
            if ends == signal.SIGKILL:
                children = Path(f"/proc/{guard.pid}/task/{guard.pid}/children").read_text()
                os.kill(int(children.split()[0]), ends)
            else:
                guard.send_signal(ends)
            guard.wait(ENOUGH)
            with pytest.raises(ProcessLookupError):
                os.kill(int(pid), 0)
            server.sync()
            assert [event.goal_id for event in server.events if event.event == "canceled"] == [
                goal_id
            ]
        finally:
            guard.kill()
            with suppress(ProcessLookupError):
                os.kill(int(pid), signal.SIGKILL)
    assert Ledger(path).leftovers() == []


STEPS = ("lift", "carry", "place")
MISSION = """
import os, sys
from actionkit import Client, GoalUnknownError, Ledger, Timeouts
from test_msgs.action import Fibonacci

path = sys.argv[1]
ledger = Ledger(os.environ["ACTIONKIT_LEDGER"])
for name in sys.argv[2:]:
    with open(path) as file:
        if name in file.read().split():
            continue
    with Client(Fibonacci, name, ledger=ledger, timeouts=Timeouts(server=60)) as client:
        result = None
        for future in ledger.attach(client):
            try:
                result = future.result()
            except GoalUnknownError:
                pass
        if result is None:
            result = client.call({"order": 30})
    with open(path, "a") as file:
        print(name, file=file)
"""


@pytest.mark.long
@pytest.mark.timeout(300)
def test_a_mission_that_is_killed_twenty_times_finishes_and_sends_nothing_twice(
    action_server: Callable[..., Server],
    run_script: Callable[..., Any],
    path: Path,
    tmp_path: Path,
) -> None:
    servers = {name: action_server("fibonacci", action_name=name, period=0.1) for name in STEPS}
    done = tmp_path / "done.txt"
    done.touch()
    chance = random.Random()
    kills = missions = 0
    while kills < 20 or missions == 0:
        process = run_script(MISSION, str(done), *STEPS).process
        try:
            process.wait(chance.uniform(0.2, 3.0) if kills < 20 else 120)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            kills += 1
        else:
            assert (process.returncode, tuple(done.read_text().split())) == (0, STEPS)
            missions += 1
            done.write_text("")
    for name, server in servers.items():
        server.sync()
        running = 0
        for event in server.events:
            running += {"accepted": 1, "succeeded": -1}.get(event.event, 0)
            assert running in (0, 1), name
        print(f"{name}: {server.count('succeeded')} goals for {missions} missions")
        assert server.count("goal_received") == server.count("succeeded") + len(server.running())
        # A step is done once more only if its program was killed after the end of its goal, and
        # before that was written down.
        assert server.count("goal_received") <= missions + 3
