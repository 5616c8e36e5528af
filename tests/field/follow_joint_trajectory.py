"""The server in `follow_joint_trajectory.cpp`: builds it, and runs it as a program."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from tests.field import cpp_types
from tests.field.kind import Kind
from tests.field.native import rclcpp
from tests.field.sources import TOP, built, upstream
from tests.native import build

TYPES = Path(__file__).parents[1] / "docs" / "control_msgs"
"""Of ros2_control's package, the one action that the server has, and what it uses."""
_SOURCE = Path(__file__).with_suffix(".cpp")
_LIBRARY = "libfollow_joint_trajectory.so"
_LIBRARIES = (
    *("rclcpp_action", "rclcpp", "rcl_action", "rcl", "rcutils", "rcpputils", "tracetools"),
    "action_msgs__rosidl_typesupport_cpp",
)
_LAUNCHER = f"""
import sys
sys.path.insert(0, {str(TOP)!r})
from tests.field.follow_joint_trajectory import main
main(*sys.argv[1:])
"""


def kind(monitor_period: float) -> Kind:
    """Return the server; it tells its clients how goals ended at intervals of so many seconds."""

    def program() -> Sequence[str]:
        return "-c", _LAUNCHER, str(folder()), action_name, str(monitor_period)

    action_name = "/arm_controller/follow_joint_trajectory"
    return Kind(
        name="ros2_control, FollowJointTrajectory",
        program=program,
        goals={},
        log={
            "ready": "ready",
            "executing": "executing",
            "rejected": "rejected",
            "cancel_requested": "cancel requested: active",
            "cancel_too_late": "cancel requested: not active",
            "preempted": "preempted",
            "succeeded": "succeeded",
            "path": "aborted: path",
            "goal": "aborted: goal",
        },
        second="preempts",
        action_type="control_msgs/action/FollowJointTrajectory",
        action_name=action_name,
        prepare=_importable,
    )


def folder() -> Path:
    """Return the folder with the server, and with `control_msgs`; build it where it is not.

    Raises:
        Missing: There is no compiler here, or no rclcpp.
    """
    own = [*TYPES.rglob("*.*"), _SOURCE, Path(__file__), Path(cpp_types.__file__)]
    generators = sorted(Path(sys.prefix, "share").glob("rosidl_*/package.xml"))
    sources = [*(path for path in own if path.is_file()), *generators, *rclcpp()]
    return built(f"control_msgs-{sys.implementation.cache_tag}", _build, *sources)


def _importable() -> None:
    if str(folder()) not in sys.path:
        sys.path.append(str(folder()))


def _build(target: Path) -> None:
    words = [sys.executable, "-m", "actionkit", "interfaces", "build", str(TYPES)]
    _run([*words, "-o", str(target)])
    words = cpp_types.build(target / "control_msgs", target)
    include = build.prefix() / "include"
    for path in (upstream() / "rt/realtime_tools/include", include, *include.iterdir()):
        words += ["-isystem", str(path)]
    words += ["-O1", "-Wall", str(_SOURCE), "-o", str(target / _LIBRARY)]
    words += [f"-L{build.prefix() / 'lib'}", *(f"-l{name}" for name in _LIBRARIES)]
    _run(words)


def _run(words: Sequence[str]) -> None:
    subprocess.run(words, check=True, stdout=subprocess.DEVNULL)


def main(where: str, action_name: str, monitor_period: str) -> None:
    """Serve until the end of standard input; each line of the log is something that it does."""
    import rclpy  # noqa: F401  its libraries are those that rclcpp needs

    for file in ("librclcpp.so", "librclcpp_action.so"):
        ctypes.CDLL(str(build.prefix() / "lib" / file), ctypes.RTLD_GLOBAL)
    native = ctypes.CDLL(str(Path(where, _LIBRARY)))
    native.start.restype = ctypes.c_void_p
    period = ctypes.c_double(float(monitor_period))
    server = ctypes.c_void_p(native.start(action_name.encode(), period))
    print("ready", flush=True)
    sys.stdin.read()
    native.stop(server)
    os._exit(0)
