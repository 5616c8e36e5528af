"""Two short rounds of the soak, in every run of the suite."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.hunting import REPEAT

_ROOT = Path(__file__).parents[2]
_SEED = 180
"""By its plan, servers are stopped in the first round, a program with 29 goals is told to end, and
the child of one ends with 67. No server is doubled: where two answer on one name, a call's next
goal may be sent while the other server has not begun the first."""
_MINUTES = 0.25 * REPEAT
"""A second round begins while they last, and a round takes 10 seconds and what it waits for."""


@pytest.mark.long
@pytest.mark.heavy
@pytest.mark.timeout(180 + 70 * REPEAT)
def test_two_rounds_of_the_soak(tmp_path):
    out = tmp_path / "soak.json"
    command = ["-m", "tests.soak", "--minutes", str(_MINUTES), "--seed", str(_SEED), "--no-network"]
    done = subprocess.run(
        [sys.executable, *command, "--round", "10", "--out", str(out)],
        cwd=_ROOT,
        capture_output=True,
        text=True,
        timeout=170 + 70 * REPEAT,
        check=False,
        env={**os.environ, "PYTHONPATH": str(_ROOT)},
    )
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads(out.read_text())
    assert report["good"]
    assert report["rounds"] >= 1
    assert sum(report["outcomes"].values()) > 20
