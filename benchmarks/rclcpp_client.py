"""A client in C++, for comparison: what a call costs where no Python takes part in it.

It is measured where `RCLCPP_PREFIX` names the folder with `include` and `lib` of rclcpp and
rclcpp_action. No package index has these: take them from an installed ROS 2 Jazzy.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from benchmarks.variant import OnFeedback, Variant

_SOURCE = Path(__file__).with_suffix(".cpp")
_BUILT = _SOURCE.parent.parent / "build" / "benchmarks" / "librclcpp_client.so"
_LIBRARIES = (
    *("rclcpp_action", "rclcpp", "rcl_action", "rcl", "rcutils", "rcpputils", "tracetools"),
    *("test_msgs__rosidl_typesupport_cpp", "action_msgs__rosidl_typesupport_cpp"),
)


def prefix() -> Path | None:
    """Return the folder with rclcpp, where there is one."""
    named = os.environ.get("RCLCPP_PREFIX")
    return Path(named) if named else None


def build() -> None:
    """Compile the client, unless it is compiled; half a minute."""
    if _BUILT.exists() and _BUILT.stat().st_mtime > _SOURCE.stat().st_mtime:
        return
    rclcpp = prefix()
    assert rclcpp is not None
    wheels = Path(sys.prefix)  # with the headers of all other packages
    headers = [folder for folder in (wheels / "include").iterdir() if "python" not in folder.name]
    _BUILT.parent.mkdir(parents=True, exist_ok=True)
    command = ["g++", "-std=c++17", "-O2", "-fPIC", "-shared", "-w", str(_SOURCE)]
    command += ["-o", str(_BUILT), f"-I{rclcpp / 'include'}"]
    command += [argument for folder in headers for argument in ("-isystem", str(folder))]
    command += [f"-L{rclcpp / 'lib'}", f"-L{wheels / 'lib'}"]
    command += [f"-l{library}" for library in _LIBRARIES]
    subprocess.run([*command, "-Wl,--allow-shlib-undefined"], check=True)


class Rclcpp(Variant):
    """A thread with rclcpp's executor; the caller waits for two futures."""

    def open(self, name: str) -> None:
        import rclpy  # noqa: F401  its libraries are those that rclcpp needs

        rclcpp = prefix()
        assert rclcpp is not None
        build()
        for library in ("librclcpp.so", "librclcpp_action.so"):
            ctypes.CDLL(str(rclcpp / "lib" / library), ctypes.RTLD_GLOBAL)
        self._library = ctypes.CDLL(str(_BUILT))
        self._library.open_client.restype = ctypes.c_void_p
        self._caller = ctypes.c_void_p(self._library.open_client(name.encode()))
        assert self._caller

    def close(self) -> None:
        self._library.close_client(self._caller)

    def call(self, order: int, on_feedback: OnFeedback | None) -> Any:
        length = self._library.call(self._caller, order, on_feedback is not None)
        assert length >= 0
        if on_feedback is not None:
            for _ in range(self._library.feedback(self._caller)):
                on_feedback(None)
        return range(length)

    def at_once(self, goals: int, order: int) -> list[float]:
        took = (ctypes.c_double * goals)()
        assert self._library.at_once(self._caller, goals, order, took) == goals
        return list(took)
