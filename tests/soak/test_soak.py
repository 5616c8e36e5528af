"""Half a minute of the soak, in every run of the suite."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

_ROOT = Path(__file__).parents[2]


@pytest.mark.heavy
@pytest.mark.timeout(200)
def test_half_a_minute_of_the_soak(tmp_path):
    out = tmp_path / "soak.json"
    command = ["-m", "tests.soak", "--minutes", "0.5", "--seed", "32", "--no-network"]
    done = subprocess.run(
        [sys.executable, *command, "--round", "12", "--out", str(out)],
        cwd=_ROOT,
        capture_output=True,
        text=True,
        timeout=190,
        check=False,
        env={**os.environ, "PYTHONPATH": str(_ROOT)},
    )
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads(out.read_text())
    assert report["good"]
    assert report["rounds"] >= 1
    assert sum(report["outcomes"].values()) > 20
