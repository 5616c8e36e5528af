"""ros2_control's `RealtimeServerGoalHandle`, as joint_trajectory_controller uses it."""

from __future__ import annotations

from collections.abc import Sequence

from tests.field import native
from tests.field.kind import Kind

DEACTIVATED = [-9]
"""The result of a goal that the command `deactivate` ends."""
RACE = {"order": 5}
"""Succeeds just after one of the looks, 50 ms apart, at which the server tells its clients."""

STOPPED = "deactivated in the middle of a goal"
THREE = "three goals at once"
STUCK = "a cancel comes within 50 ms of the success: the goal stays CANCELING until the next one"


def _controller(name: str, kind: str, *own: str) -> Kind:
    def program() -> Sequence[str]:
        return native.program(kind)

    return Kind(
        name=name,
        program=program,
        goals={"short": {"order": 3}, "long": {"order": 120}, "rejected": {"order": -1}},
        log={
            "executing": "SRV accepted",
            "cancel_requested": "SRV cancel request",
            # It says no more of these: it ends a goal in the line's own step.
            "canceled": "SRV cancel request, active=this",
            "aborted": "SRV preempted the active goal|SRV command deactivate",
            "succeeded": "SRV rt: succeeded",
        },
        results={"short": [42]},
        second="preempts",
        own=own,
    )


CONTROLLER = _controller(
    "ros2_control, `joint_trajectory_controller`", "jtc", STOPPED, THREE, STUCK
)
OLDER = _controller("ros2_control, an older `joint_trajectory_controller`", "jtcold")
"""In no table: only what it does with a preempted goal is different."""
KINDS = (CONTROLLER,)
