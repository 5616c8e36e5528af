"""The contents of countdown's and navigate's messages of actionkit_interfaces. No rclpy here.

`actionkit interfaces build --own` builds the package.
"""

from __future__ import annotations

import math
from typing import Any

from actionkit.servers._run import Content

COUNTDOWN = "actionkit_interfaces/action/Countdown"
NAVIGATE = "actionkit_interfaces/action/NavigateToPose"
_FAR_FUTURE = 2**31 - 1


def is_own(goal: Any) -> bool:
    """Return whether it is a goal of actionkit_interfaces."""
    return type(goal).__module__.partition(".")[0] == "actionkit_interfaces"


def duration(path: str, seconds: float) -> dict[str, object]:
    """Return a time span as fields of a `builtin_interfaces/Duration`."""
    whole = math.floor(seconds)
    if whole >= _FAR_FUTURE:
        return {f"{path}.sec": _FAR_FUTURE, f"{path}.nanosec": 0}
    return {f"{path}.sec": whole, f"{path}.nanosec": int((seconds - whole) * 1e9)}


def counted(goal: Any, left: int) -> Content:
    """Return countdown's result, `left` steps before zero."""
    done = f"counted down from {goal.target}" if left == 0 else f"stopped at {left}"
    return {"completed": left == 0, "message": done}


def way(goal: Any) -> tuple[float, ...]:
    """Return the target's coordinates in m; the robot starts at zero."""
    position = goal.target_pose.pose.position
    return position.x, position.y, position.z


def refusal(goal: Any) -> str | None:
    """Return why navigate rejects a goal; `None` if it does not."""
    if not all(map(math.isfinite, way(goal))):
        return f"target_pose {way(goal)}"
    if not 0 <= goal.max_velocity < math.inf:
        return f"max_velocity {goal.max_velocity}"
    return None


def driving(goal: Any, done: float, seconds_left: float, status: str) -> Content:
    """Return navigate's feedback; `done` is the finished part of the way, 0 to 1."""
    pose = "current_pose.pose"
    place = {
        f"{pose}.position.{axis}": at * done for axis, at in zip("xyz", way(goal), strict=True)
    }
    return {
        **place,
        f"{pose}.orientation": goal.target_pose.pose.orientation,
        "current_pose.header.frame_id": goal.target_pose.header.frame_id,
        "distance_remaining": math.hypot(*way(goal)) * (1 - done),
        "percent_complete": 100 * done,
        "status_message": status,
        **duration("estimated_time_remaining", seconds_left),
    }


def drove(goal: Any, done: float, seconds: float) -> Content:
    """Return navigate's result."""
    remains = math.hypot(*way(goal)) * (1 - done)
    message = "arrived" if done == 1 else f"stopped {remains:.2f} m before the target"
    return {"success": done == 1, "message": message, **duration("total_time", seconds)}
