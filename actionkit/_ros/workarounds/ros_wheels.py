"""Repairs the environment of a process if ROS comes from wheels.

This can be deleted when the wheels of `ros-jazzy-rclpy` set the library path again in a
process that has inherited only their mark (7.1.x do not).
"""

from __future__ import annotations

import os
import sys

_DONE = "_ROS_WHEELS_BOOTSTRAP_COMPLETE"
_PATH = "LD_LIBRARY_PATH"


def find_libraries() -> None:
    """Start this program again if it would not find the libraries of ROS.

    When Python starts, the wheels' bootstrapper sets the library path, and marks that in the
    environment. If a host passes on only the mark, or the path of another virtual environment, this
    process has no library path.
    """
    paths = os.environ.get(_PATH, "").split(os.pathsep)
    if _DONE not in os.environ or os.path.join(sys.prefix, "lib") in paths:
        return
    kept = {name: value for name, value in os.environ.items() if name not in (_DONE, _PATH)}
    if sys.stdout is not None:
        sys.stdout.flush()
    os.execve(sys.executable, sys.orig_argv, kept)
