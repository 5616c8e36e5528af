"""Where rclpy is missing, the error names the commands that get it (C9.3)."""

from __future__ import annotations

import subprocess
import sys

import pytest

CALL = """
from actionkit import Client
class Pick:
    class Goal: pass
    class Result: pass
    class Feedback: pass
    class Impl: pass
Client(Pick, "pick")
"""


@pytest.mark.parametrize(
    "program",
    [
        CALL,
        "from actionkit.cli import main; main(['list'])",
        "from actionkit.cli import main; main(['doctor'])",
    ],
    ids=["library", "command", "doctor"],
)
def test_without_rclpy_the_commands_that_work_are_named(program: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.modules['rclpy'] = None\n{program}"],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert done.returncode != 0
    told = " ".join((done.stdout + done.stderr).split())
    assert "rclpy" in told
    assert "source /opt/ros/jazzy/setup.bash" in told
    assert "python3 -m venv --system-site-packages .venv" in told
    assert "pip install 'ros-jazzy-rclpy[fastrtps]'" in told
