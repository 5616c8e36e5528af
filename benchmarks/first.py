"""A program that calls once; prints the seconds from its first import to its first result."""

from __future__ import annotations

import sys
import time

began = time.perf_counter()


def with_actionkit() -> None:
    """Call with ActionKit."""
    from test_msgs.action import Fibonacci

    from actionkit import Client

    client = Client(Fibonacci, "fibonacci")
    assert len(client.call(Fibonacci.Goal(order=5), timeout=30.0).sequence) == 6
    print(time.perf_counter() - began, flush=True)
    client.close()


def with_rclpy() -> None:
    """Call by the tutorial's idiom."""
    import rclpy
    from rclpy.action import ActionClient
    from test_msgs.action import Fibonacci

    rclpy.init()
    node = rclpy.create_node("first")
    client = ActionClient(node, Fibonacci, "fibonacci")
    assert client.wait_for_server(30.0)
    while True:
        future = client.send_goal_async(Fibonacci.Goal(order=5))
        rclpy.spin_until_future_complete(node, future, timeout_sec=1.0)
        if future.done():
            break  # otherwise the server did not know our endpoints, and its answer is lost
    answer = future.result().get_result_async()
    rclpy.spin_until_future_complete(node, answer, timeout_sec=30.0)
    assert len(answer.result().result.sequence) == 6
    print(time.perf_counter() - began, flush=True)
    client.destroy()
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    {"actionkit": with_actionkit, "rclpy": with_rclpy}[sys.argv[1]]()
