"""The five servers of ros2/examples (`examples_rclpy_minimal_action_server`), as they are."""

from __future__ import annotations

from collections.abc import Sequence

from tests.field import interfaces
from tests.field.kind import Kind
from tests.field.sources import upstream

_FOLDER = "examples/rclpy/actions/minimal_action_server/examples_rclpy_minimal_action_server"
_FASTER = 4
_LAUNCHER = f"""
import os, runpy, signal, sys, threading, time
def end():
    sys.stdin.read()
    os.kill(os.getpid(), signal.SIGINT)
threading.Thread(target=end, daemon=True).start()
sys.path[:0] = sys.argv[1:2]
sleep = time.sleep
time.sleep = lambda seconds: sleep(seconds / {_FASTER})  # they wait for a second at each number
runpy.run_path(sys.argv[2], run_name="__main__")
"""


def _example(name: str, file: str, second: str) -> Kind:
    def program() -> Sequence[str]:
        script = upstream() / _FOLDER / file
        return "-c", _LAUNCHER, str(interfaces.interfaces()), str(script)

    return Kind(
        name=f"ros2/examples, {name}",
        program=program,
        goals={"short": {"order": 3}, "long": {"order": 45}},
        log={
            "executing": "Executing goal",
            "cancel_requested": "Received cancel request",
            "canceled": "Goal canceled",
            "aborted": "Goal aborted",
            "succeeded": r"Returning result: array\('i', \[(?P<result>.*)\]\)",
        },
        second=second,
        action_type="example_interfaces/action/Fibonacci",
        prepare=interfaces.importable,
    )


KINDS = (
    _example("`server`", "server.py", "runs both"),
    _example("`server_defer`", "server_defer.py", "crashes"),
    _example("`server_not_composable`", "server_not_composable.py", "runs both"),
    _example("`server_queue_goals`", "server_queue_goals.py", "queues it"),
    _example("`server_single_goal`", "server_single_goal.py", "preempts"),
)
