"""Every code block of the documentation runs, and prints what its page says."""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from tests.docs.snippets import ROOT, blocks, run_page

DOCS = ROOT / "docs"
_FIBONACCI = ("fibonacci", {"period": 0.02})
PAGES: dict[str, list[tuple[str, Mapping[str, Any]]]] = {
    "../README.md": [],  # starts its server itself
    "index.md": [_FIBONACCI],
    "agents.md": [],  # starts its server itself
    "tutorial.md": [],  # starts its servers itself
    "installing.md": [],
    "client.md": [_FIBONACCI],
    "coming-from/actionlib.md": [_FIBONACCI],
    "coming-from/py_trees_ros.md": [],
    "coming-from/rclpy.md": [_FIBONACCI],
    "coming-from/synchros2.md": [_FIBONACCI],
    "when-things-fail.md": [],
    "where-it-runs.md": [],
    "guides/asyncio.md": [_FIBONACCI],
    "guides/callbacks.md": [_FIBONACCI],
    "guides/deployment.md": [_FIBONACCI],
    "guides/killed-programs.md": [_FIBONACCI],
    "guides/missions.md": [_FIBONACCI],
    "guides/launch.md": [("fibonacci", {"action_name": "robot1/count", "period": 0.02})],
    "guides/lifecycle.md": [_FIBONACCI],
    "guides/replacing-a-goal.md": [
        _FIBONACCI,
        ("preemptive", {"action_name": "navigate", "period": 0.02}),
    ],
    "guides/security.md": [],
    "guides/stuck-arm.md": [_FIBONACCI],
    "guides/several-robots.md": [
        ("fibonacci", {"period": 0.02, "action_name": "robot1/fibonacci"}),
        ("fibonacci", {"period": 0.02, "action_name": "robot2/fibonacci"}),
    ],
    "guides/sim-time.md": [("fibonacci", {"period": 0.5})],
}
"""The pages that are run here, with the servers that each needs."""


_BY_DEFAULT = ("../README.md", "client.md")


@pytest.mark.parametrize(
    "page", [p if p in _BY_DEFAULT else pytest.param(p, marks=pytest.mark.long) for p in PAGES]
)
def test_what_the_page_says_is_so(page: str, action_server: Any, tmp_path: Path) -> None:
    for name, options in PAGES[page]:
        action_server(name, **options)
    run_page(DOCS / page, tmp_path)


@pytest.mark.long
@pytest.mark.timeout(900)
def test_the_first_ten_minutes_need_nothing_else(ros_domain: int, tmp_path: Path) -> None:
    """What the page on agents installs is enough for it, in an environment that was empty."""
    page = DOCS / "agents.md"
    install = next(block.text for block in blocks(page) if "pip install" in block.text)
    extras = next(line for line in install.splitlines() if line.startswith("pip install -e"))
    (wanted,) = shlex.split(extras)[3:]
    source = tmp_path / "actionkit"
    left_out = shutil.ignore_patterns(".*", "tests", "benchmarks", "__pycache__")
    shutil.copytree(ROOT, source, ignore=left_out)
    python = tmp_path / "env" / "bin" / "python"
    subprocess.run([sys.executable, "-m", "venv", tmp_path / "env"], check=True, timeout=300)
    pip = [python, "-m", "pip", "install", "-q", "--no-compile"]
    subprocess.run([*pip, wanted.replace(".", str(source), 1)], check=True, timeout=600)
    (tmp_path / "work").mkdir()
    run_page(page, tmp_path / "work", python)
