"""Where ROS comes from wheels: a process that was started with half of their environment."""

from __future__ import annotations

import os
import sys

_DONE = "_ROS_WHEELS_BOOTSTRAP_COMPLETE"
_PATH = "LD_LIBRARY_PATH"


def find_libraries() -> None:
    """Start this program again where it would not find the libraries of ROS.

    The wheels' bootstrapper does that once, at Python's start, and marks it in the environment. A
    host that passes on the mark alone, or both of another virtual environment, leaves us without.
    """
    paths = os.environ.get(_PATH, "").split(os.pathsep)
    if _DONE not in os.environ or os.path.join(sys.prefix, "lib") in paths:
        return
    kept = {name: value for name, value in os.environ.items() if name not in (_DONE, _PATH)}
    if sys.stdout is not None:
        sys.stdout.flush()
    os.execve(sys.executable, sys.orig_argv, kept)
