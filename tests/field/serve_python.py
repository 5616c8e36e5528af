"""Starts a server in Python of the shared folder: `serve_python.py PATHS SCRIPT [threads] [SPEED]`.

With `threads`, what the script spins with `rclpy.spin` has several threads. With `fast`, it sleeps
a hundredth of the time, with `slow` three times as long. It ends at the end of its standard input.
"""

from __future__ import annotations

import os
import runpy
import sys
import threading
import time
from importlib import import_module
from typing import Any

_SLEEPS = {"fast": 0.01, "slow": 3.0}


def main() -> None:
    """Run the script, with these folders for its imports."""
    threading.Thread(target=lambda: (sys.stdin.read(), os._exit(0)), daemon=True).start()
    paths, script, *options = sys.argv[1:]
    sys.path[:0] = paths.split(os.pathsep)
    sys.argv[:] = [script]
    if "threads" in options:
        _spin_with_threads()
    for option in _SLEEPS.keys() & {*options}:
        _sleep(_SLEEPS[option])
    if script.endswith("srv_dock.py"):
        _let_the_goal_choose()
    runpy.run_path(script, run_name="__main__")


def _spin_with_threads() -> None:
    from rclpy.executors import MultiThreadedExecutor

    def spin(node: Any) -> None:
        executor = MultiThreadedExecutor(4)
        executor.add_node(node)
        executor.spin()

    rclpy: Any = import_module("rclpy")
    rclpy.spin = spin


def _sleep(times: float) -> None:
    sleep = time.sleep

    def sleep_so_long(seconds: float) -> None:
        sleep(seconds * times)

    module: Any = time
    module.sleep = sleep_so_long


def _let_the_goal_choose() -> None:
    """Dock in half a second, undock in 15 s, and look ten times a second for a cancel."""
    from rclpy.parameter import Parameter

    dock: Any = import_module("py_trees_ros.mock.dock")

    class Dock(dock.Dock):  # type: ignore[misc]
        def __init__(self, duration: float) -> None:
            super().__init__(duration)
            self.frequency = 10.0

        def goal_received_callback(self, goal: Any) -> None:
            super().goal_received_callback(goal)
            seconds = 0.5 if goal.dock else 15.0
            self.node.set_parameters([Parameter("duration", value=seconds)])

    dock.Dock = Dock


if __name__ == "__main__":
    main()
