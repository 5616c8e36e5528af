"""If rclpy is missing, the error names the commands to install it (C9.3)."""

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


def _told(program: str) -> str:
    """Run a program without rclpy, which fails; return all that it wrote."""
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.modules['rclpy'] = None\n{program}"],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert done.returncode != 0
    return " ".join((done.stdout + done.stderr).split())


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
    told = _told(program)
    assert "rclpy" in told
    assert "source /opt/ros/jazzy/setup.bash" in told
    assert "python3 -m venv --system-site-packages .venv" in told
    assert "pip install 'ros-jazzy-rclpy[fastrtps]'" in told


@pytest.mark.long
@pytest.mark.parametrize(
    "program",
    [
        f"from actionkit import Client; import sys; sys.platform = 'darwin'\n{CALL}",
        "import sys; import actionkit.cli._shared.problems; sys.platform = 'darwin'\n"
        "from actionkit.cli import main; main(['list'])",
        "import sys; from actionkit.cli import main; sys.platform = 'darwin'; main(['doctor'])",
        "import sys; import asyncio, logging, signal; del signal.SIGHUP; sys.platform = 'win32'\n"
        "from actionkit import Client",
    ],
    ids=["library", "command", "doctor", "Windows"],
)
def test_on_another_system_the_error_says_so(program: str) -> None:
    told = _told(program)
    assert "ActionKit runs on Linux only: use a Linux machine" in told
    assert "pip install" not in told
