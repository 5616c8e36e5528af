"""A signal handler may use any public method, whatever it interrupted (C2.5).

`ACTIONKIT_SIGNALS=10000` in the environment makes it many more: for whoever changes what threads
share, and has an hour.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from typing import Any

import pytest

from tests.conftest import without_noise
from tests.signal_walk import HANDLERS, USES

SIGNALS = int(os.environ.get("ACTIONKIT_SIGNALS", "300"))
PLACES = max(1, SIGNALS // len(USES) // len(HANDLERS))
LONGEST = 7.0
"""Seconds; what waits for the communication thread in vain waits longer, and the rest a second."""


def run(*command: str) -> list[dict[str, Any]]:
    """Run a script of these tests to its end; return the lines of JSON that it printed."""
    done = subprocess.run(
        [sys.executable, "-m", *command], capture_output=True, text=True, check=False
    )
    err = without_noise(done.stderr)
    assert (done.returncode, err) == (0, ""), f"{done.stdout}\n{err}"
    return [json.loads(line) for line in without_noise(done.stdout).splitlines()]


@pytest.mark.timeout(240 + SIGNALS)
@pytest.mark.parametrize(
    "use",
    [
        pytest.param(use.__name__, marks=[] if use in USES[:2] else [pytest.mark.long])
        for use in USES
    ],
)
def test_a_handler_may_run_between_any_two_bytecodes(use, action_server):
    server = action_server("fibonacci", period=0.002)
    reports = run("tests.signal_walk", use, str(PLACES))
    assert [report["handler"] for report in reports] == [one.__name__ for one in HANDLERS]
    for report in reports:
        # A run may take a shorter way than those that were counted.
        assert report["interrupted"] >= PLACES // 2, report
        assert report["longest"] < LONGEST, report
    for goal_id in server.running():
        server.wait_for("canceled", goal_id=goal_id)


@pytest.mark.long
@pytest.mark.timeout(240 + SIGNALS)
def test_handlers_that_do_anything_at_any_time(action_server):
    action_server("fibonacci", period=0.002)
    endless = action_server("never_finishes", action_name="endless")
    (report,) = run("tests.signal_soak", str(SIGNALS))
    print(report)
    assert report["wrong"] == []
    assert report["unfinished"] == 0
    assert report["signals"] >= SIGNALS
    assert report["longest"] < 3 * LONGEST  # one handler may interrupt another
    for goal_id in endless.running():
        endless.wait_for("canceled", goal_id=goal_id)
