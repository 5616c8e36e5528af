"""micro-ROS' client library for C (`rclc`), with its example's server."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tests.field.kind import Kind
from tests.field.rclc import library

ATTACHED = "another client attaches: it sends the result there alone"
CANCELLED_EARLY = "cancelled while it accepts the goal: it says that it has ended, and runs it"
FULL = "more than its ten goals: it reads no more, and accepts one when another ends"


def _program() -> Sequence[str]:
    # A step takes it 0.9 s, so it can serve both a short goal and one of 26 s.
    return str(Path(__file__).parents[1] / "serve_rclc.py"), str(library("rclc_slow_server"))


KINDS = (
    Kind(
        name="micro-ROS (`rclc`)",
        program=_program,
        goals={
            "short": {"order": 3},
            "long": {"order": 40},
            "aborts": {"order": 1},
            "rejected": {"order": 201},
        },
        log={
            "executing": r"Goal \d+ accepted",
            "succeeded": r"Goal \d+ succeeded",
            "canceled": r"Goal \d+ canceled",
            "aborted": r"Goal \d+ aborted",
            "rejected": r"Goal \d+ rejected",
        },
        results={"short": [0, 1, 1], "aborts": []},
        second="runs both",
        has_status=False,
        own=(CANCELLED_EARLY, ATTACHED, FULL),
    ),
)
