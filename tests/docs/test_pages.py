"""Every code block of the documentation runs, and prints what its page says."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from tests.docs.snippets import ROOT, run_page

DOCS = ROOT / "docs"
_FIBONACCI = ("fibonacci", {"period": 0.02})
PAGES: dict[str, list[tuple[str, Mapping[str, Any]]]] = {
    "../README.md": [],  # starts its server itself
    "index.md": [_FIBONACCI],
    "tutorial.md": [],  # starts its servers itself
    "installing.md": [],
    "client.md": [_FIBONACCI],
    "coming-from/actionlib.md": [_FIBONACCI],
    "coming-from/py_trees_ros.md": [],
    "coming-from/rclpy.md": [_FIBONACCI],
    "coming-from/synchros2.md": [_FIBONACCI],
    "losing-the-server.md": [_FIBONACCI],
    "guides/asyncio.md": [_FIBONACCI],
    "guides/callbacks.md": [_FIBONACCI],
    "guides/deployment.md": [_FIBONACCI],
    "guides/launch.md": [("fibonacci", {"action_name": "robot1/count", "period": 0.02})],
    "guides/lifecycle.md": [_FIBONACCI],
    "guides/replacing-a-goal.md": [
        _FIBONACCI,
        ("preemptive", {"action_name": "navigate", "period": 0.02}),
    ],
    "guides/stuck-arm.md": [_FIBONACCI],
    "guides/several-robots.md": [
        ("fibonacci", {"period": 0.02, "action_name": "robot1/fibonacci"}),
        ("fibonacci", {"period": 0.02, "action_name": "robot2/fibonacci"}),
    ],
    "guides/sim-time.md": [("fibonacci", {"period": 0.5})],
}
"""The pages that are run here, with the servers that each needs."""


_LONG = ("tutorial.md", "guides/stuck-arm.md")


@pytest.mark.parametrize(
    "page", [pytest.param(p, marks=pytest.mark.long) if p in _LONG else p for p in PAGES]
)
def test_what_the_page_says_is_so(page: str, action_server: Any, tmp_path: Path) -> None:
    for name, options in PAGES[page]:
        action_server(name, **options)
    run_page(DOCS / page, tmp_path)
