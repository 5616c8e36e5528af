"""Programs that end in any way leave no goal running (C2.5, C2.6).

docs/maintainers/faults.md says how. What reached the server is read in its own journal.
"""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import pytest

from actionkit.servers import Server
from tests import forked
from tests.conftest import NEVER, RCLPYS_RACE, without_noise
from tests.faults import ending
from tests.faults.ending import (
    AGES,
    BY_DEFAULT,
    CANCEL,
    CASES,
    IGNORED,
    NOTHING,
    RAISES,
    SILENT,
    TWICE,
    WARNED,
    Case,
    Row,
)
from tests.faults.page import ended
from tests.tables import WRITING

BOUND = 3.0
"""Seconds: `Timeouts.cancel`, and one."""
NOISE = 4.0
"""A machine with other work is so much slower."""
IGNORING = ("sh", "-c", 'trap "" INT; exec "$@"', "sh")
"""Starts a program as a shell script does in the background."""
AGAIN_AFTER = 0.3
"""Seconds between two times Ctrl-C."""
_orders = itertools.count(1_000_000)
"""A number for each goal, by which its server's journal is searched."""


def end(case: Case, age: float, server: Server, program: Path) -> Row:
    """Run a program until its goal has that age, end it, and look what reached the server.

    Once more where rclpy itself has failed: its executor does where a signal comes between two of
    its steps (R10).
    """
    row, err = end_once(case, age, server, program)
    if row.code == 1 and RCLPYS_RACE in err:
        row, err = end_once(case, age, server, program)
    # Python itself says so, of a second Ctrl-C while it waits for threads or for a child.
    if case.what != TWICE:
        assert "Exception ignored" not in err
    if case.what == RAISES:
        assert (err.count("Traceback"), err.rstrip()[-16:]) == (1, "ValueError: mine"), err
    assert "thread of ActionKit died" not in err
    assert "report it" not in err
    warnings = [line for line in err.splitlines() if line.startswith("actionkit: ")]
    told = ["MAY STILL BE RUNNING" in line for line in warnings]
    assert told == [True] * (row.reached == WARNED), err
    return row


def end_once(case: Case, age: float, server: Server, program: Path) -> tuple[Row, str]:
    """Do it; return what the program said, too."""
    order = next(_orders)
    command = [
        *(IGNORING if case.what == IGNORED else ()),
        *(sys.executable, str(program), server.action_name, str(order)),
        *(case.what, "handled" if case.handled else ""),
    ]
    with (
        forked.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        ) as process,
        ThreadPoolExecutor(1) as reader,
    ):
        assert process.stderr is not None
        err = reader.submit(process.stderr.read)
        try:
            goal = _begun(server, order)
            NEVER.wait(age)
            assert process.poll() is None
            began = time.monotonic()
            _tell(case, process, server)
            if not case.goes_on:
                process.wait(60)
            took = time.monotonic() - began
            reached = _reached(case, server, goal)
        finally:
            _signal(process, signal.SIGKILL)
        said = without_noise(err.result(60))
    print(f"{case.name}, {age} s: {reached}, {process.returncode} after {took:.2f} s\n{said}")
    assert took < BOUND * NOISE
    return Row(case, reached, None if case.goes_on else process.returncode), said


def _begun(server: Server, order: int) -> str:
    """Wait until the goal of that number runs; return its id."""
    found, seen = "", 0
    while not found:
        accepted = server.wait_for("accepted", count=seen + 1, timeout=60)
        seen = len(accepted)
        found = next((str(e.goal_id) for e in accepted if e.details["order"] == order), "")
    server.wait_for("executing", goal_id=found)
    return found


def _tell(case: Case, process: subprocess.Popen[str], server: Server) -> None:
    if case.what == SILENT:
        server.pause()
    if not case.what.startswith("SIG"):
        assert process.stdin is not None
        process.stdin.close()
        return
    number = signal.Signals[case.what.split()[0].strip(",")]
    _signal(process, number)
    if case.what == TWICE:
        with suppress(subprocess.TimeoutExpired):
            process.wait(AGAIN_AFTER)
        _signal(process, number)


def _signal(process: subprocess.Popen[str], number: int) -> None:
    """Send it to the program and its children, as a terminal does, and systemd."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, number)


def _reached(case: Case, server: Server, goal: str) -> str:
    if case.what == SILENT:
        server.resume()
        return WARNED
    try:
        # A node that is destroyed is noticed by a look once a second.
        server.wait_for("canceled", goal_id=goal, timeout=8 if case.goes_on else 2)
    except TimeoutError:
        assert goal in server.running()
        return NOTHING
    return CANCEL


def _tries() -> list[object]:
    found: list[object] = []
    for number, case in enumerate(CASES):
        # All ages of each are for the page. A run of the suite has each age with some of them.
        ages = AGES if WRITING else (AGES[number % len(AGES)],)
        if (age := BY_DEFAULT.get(case)) is not None:
            ages = tuple(other for other in ages if other != age)
            found.append(pytest.param(case, (age,), id=f"{case.name}, {age:g} s"))
        if ages:
            found.append(pytest.param(case, ages, id=case.name, marks=pytest.mark.long))
    return found


@pytest.mark.timeout(240)
@pytest.mark.parametrize(("case", "ages"), _tries())
def test_what_reaches_the_server_when_a_program_ends(
    case: Case, ages: tuple[float, ...], action_server: Callable[..., Server], tmp_path: Path
) -> None:
    program = tmp_path / "program.py"
    program.write_text(ending.HEAD + ending.PROGRAMS[case.program], "utf-8")

    def start(number: int) -> Server:
        name = f"fibonacci_{number}"
        return action_server("fibonacci", action_name=name, period=0.1, max_order=2**31 - 1)

    # One that becomes silent is so for all its clients.
    servers = [start(n) for n in range(len(ages) if case.what == SILENT else 1)]
    with ThreadPoolExecutor(len(ages)) as drivers:
        rows = [
            drivers.submit(end, case, age, servers[n % len(servers)], program)
            for n, age in enumerate(ages)
        ]
    for row in rows:
        ended(row.result())
