"""Stands in for Nav2 while the page on NavigateToPose runs: a goal for each that it sends."""

from __future__ import annotations

import sys

from nav2_msgs.action import NavigateToPose  # built by the test

from actionkit.testing import FakeServer

GOALS = [
    {},
    {"end": "aborted", "result": {"error_code": 102}},
    {},
    {"end": "aborted", "result": {"error_code": 208}},
    {"feedback": [{"distance_remaining": left} for left in (2.0, 1.0, 0.0)], "period": 0.05},
    {
        "feedback": [{"number_of_recoveries": count} for count in range(1, 10)],
        "period": 0.05,
        "end": "never",
    },
]

with FakeServer(NavigateToPose, "navigate_to_pose") as server:
    server.script(GOALS)
    print("ready", flush=True)
    sys.stdin.read()
