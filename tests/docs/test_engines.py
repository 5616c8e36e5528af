"""The snippets for workflow engines do each goal once (docs/guides/missions.md)."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.docs.snippets import ROOT, blocks

PAGE = ROOT / "docs" / "guides" / "missions.md"
RUNS = """
import asyncio
from temporalio.testing import ActivityEnvironment
for _ in range(2):
    print(asyncio.run(ActivityEnvironment().run(drive, 3)))
client.close()
"""


def snippet(package: str) -> str:
    (found,) = [block.text for block in blocks(PAGE) if f"from {package} import" in block.text]
    return found


def start(package: str, folder: Path, more: str = "") -> subprocess.Popen[str]:
    """Run a snippet where its package is installed."""
    packages = folder / "packages"
    if not packages.is_dir():
        pip = [sys.executable, "-m", "pip", "install", "-q", "--target", packages, package]
        if subprocess.run(pip, check=False, timeout=300).returncode:
            pytest.skip(f"pip cannot install {package} here")
    path = os.pathsep.join([str(ROOT), str(packages)])
    words = [sys.executable, "-c", snippet(package) + more]
    env = {**os.environ, "PYTHONPATH": path}
    return subprocess.Popen(words, stdout=subprocess.PIPE, text=True, cwd=folder, env=env)


@pytest.mark.long
@pytest.mark.timeout(400)
def test_a_step_of_dbos_that_was_killed_follows_its_goal(action_server, tmp_path):
    server = action_server("fibonacci", period=1.0)
    with start("dbos", tmp_path) as program:
        server.wait_for("executing", count=2, timeout=60)
        program.kill()
    with start("dbos", tmp_path) as program:
        assert program.communicate(timeout=60)[0] == "9\n"
    assert server.count("goal_received") == 2


@pytest.mark.long
@pytest.mark.timeout(400)
def test_an_activity_of_temporal_that_is_repeated_sends_nothing(action_server, tmp_path):
    server = action_server("fibonacci", period=0.01)
    with start("temporalio", tmp_path, RUNS) as program:
        assert program.communicate(timeout=60)[0] == "[0, 1, 1, 2]\n" * 2
    assert server.count("goal_received") == 1
