"""A signal handler may cancel, close, read and raise, whatever it interrupted (C2.9).

`ACTIONKIT_SIGNALS=10000` in the environment makes it many more: for whoever changes what threads
share, and has an hour.
"""

from __future__ import annotations

import json
import os
import sys

import pytest

from tests import forked
from tests.conftest import without_noise
from tests.in_handler import HANDLERS, USES

PLACES = max(1, int(os.environ.get("ACTIONKIT_SIGNALS", "80")) // len(USES) // len(HANDLERS))
LONGEST = 5.0
"""Seconds; what waits for the communication thread in vain waits longer, and the rest a second."""


@pytest.mark.timeout(240 + 10 * PLACES)
@pytest.mark.parametrize(
    "use",
    [
        pytest.param(
            use.__name__, marks=pytest.mark.long if use.__name__ == "blocking_call" else ()
        )
        for use in USES
    ],
)
def test_what_a_handler_may_do_at_any_moment(use, action_server):
    server = action_server("fibonacci", period=0.05)
    script = [sys.executable, "-m", "tests.in_handler", use, str(PLACES)]
    done = forked.run(script, capture_output=True, text=True, check=False)
    err = without_noise(done.stderr)
    assert done.returncode == 0, f"{done.stdout}\n{err}"
    assert "error in ActionKit itself" not in err
    reports = [json.loads(line) for line in without_noise(done.stdout).splitlines()]
    assert [report["handler"] for report in reports] == [one.__name__ for one in HANDLERS]
    for report in reports:
        # A run may take a shorter way than those that were counted.
        assert report["interrupted"] >= PLACES // 2, report
        assert report["longest"] < LONGEST, report
    for goal_id in server.running():
        server.wait_for("canceled", goal_id=goal_id)
