"""Programs that are told to end leave no goal running (C2.6), and docs/faults.md says how."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest

from actionkit.servers import Server
from tests.conftest import RCLPYS_RACE
from tests.faults import ending
from tests.faults.ending import CANCEL, IGNORED, KILL, NOTHING, SHUTDOWN, Case, Row
from tests.faults.page import ended

BOUND = 3.0
"""Seconds: `Timeouts.cancel`, and one."""
IGNORING = ("sh", "-c", 'trap "" INT; exec "$@"', "sh")
"""Starts a program as a shell script does in the background."""
NOISE = 4.0
"""A machine with other work is so much slower."""


def end(case: Case, server: Server, goals: Iterator[int]) -> Row:
    """Run a program until its goal runs, end it, and look what reached the server.

    Once more where rclpy itself has failed: its executor does where a signal comes between two of
    its steps (R10).
    """
    row, err = end_once(case, server, next(goals))
    if row.code == 1 and RCLPYS_RACE in err:
        row, _ = end_once(case, server, next(goals))
    return row


def end_once(case: Case, server: Server, goals: int) -> tuple[Row, str]:
    """Do it, with as many goals as the server has had by then; return what the program said too."""
    process = subprocess.Popen(
        [*(IGNORING if case.what == IGNORED else ()), sys.executable, "-c", case.source],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONUNBUFFERED": "1"},
    )
    try:
        assert process.stdin is not None
        assert process.stdout is not None
        while "running" not in (line := process.stdout.readline()):
            assert line, process.communicate()[1]
        goal = server.wait_for("executing", count=goals)[-1].goal_id
        began = time.monotonic()
        if case.number is not None:
            process.send_signal(case.number)
        else:
            process.stdin.write("shutdown\n" if case.what == SHUTDOWN else "destroy\n")
            process.stdin.flush()
        if case.goes_on:
            server.wait_for("canceled", goal_id=goal)
            process.kill()
        process.wait(60)
        took = time.monotonic() - began
        print(f"{case}: gone after {took:.2f} s, {process.returncode}")
        reached = NOTHING
        if case.what != KILL and (case.handled or case.what != "SIGTERM" or "node" in case.program):
            server.wait_for("cancel_accepted", goal_id=goal)
            server.wait_for("canceled", goal_id=goal)
            reached = CANCEL
            assert took < BOUND * NOISE
        else:
            assert goal in server.running()
        _, err = process.communicate()
        assert "Exception ignored" not in err
        assert "MAY STILL" not in err
        return Row(case, reached, None if case.goes_on else process.returncode), err
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()


@pytest.mark.long
@pytest.mark.timeout(600)
@pytest.mark.parametrize("program", ending.PROGRAMS)
def test_what_reaches_the_server_when_a_program_ends(program, action_server):
    server = action_server("never_finishes")
    goals = itertools.count(1)
    for case in ending.cases(program):
        ended(end(case, server, goals))
