"""A plain rclpy server that needs a long time to accept goals: its argument, in seconds.

While one thread of an rclpy server accepts a goal, there is a moment in which the middleware knows
the goal and the server's own table does not. Other threads then answer as if it refused to cancel
the goal, and as if it had never heard of it. On a busy machine that moment may last; here it lasts
as long as one likes. A line is printed when it begins, and when a goal begins and ends.
"""

from __future__ import annotations

import os
import sys
import threading
import uuid
from typing import Any

import rclpy
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from test_msgs.action import Fibonacci


class SlowTable(dict[bytes, Any]):
    """Takes its time before it knows something new."""

    def __setitem__(self, key: bytes, value: Any) -> None:
        print("accepting", flush=True)
        threading.Event().wait(float(sys.argv[1]))
        super().__setitem__(key, value)


def execute(handle: Any) -> Any:
    """Run until it is cancelled."""
    goal_id = uuid.UUID(bytes=bytes(handle.goal_id.uuid))
    print("executing", goal_id, flush=True)
    while not handle.is_cancel_requested:
        threading.Event().wait(0.005)
    handle.canceled()
    print("canceled", goal_id, flush=True)
    return Fibonacci.Result()


def end_with_parent() -> None:
    """Wait for the end of standard input, which the test's end brings, however it ends."""
    sys.stdin.read()
    os._exit(0)


def main() -> None:
    threading.Thread(target=end_with_parent, daemon=True).start()
    rclpy.init(domain_id=int(os.environ["ROS_DOMAIN_ID"]))
    node = rclpy.create_node("accepting")
    server = ActionServer(
        node,
        Fibonacci,
        "fibonacci",
        execute,
        cancel_callback=lambda _: CancelResponse.ACCEPT,
        callback_group=ReentrantCallbackGroup(),
    )
    server._goal_handles = SlowTable()
    executor = MultiThreadedExecutor(8)
    executor.add_node(node)
    print("up", flush=True)
    executor.spin()


if __name__ == "__main__":
    main()
