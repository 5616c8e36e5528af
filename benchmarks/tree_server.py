"""Action servers for the benchmark of trees: goals run until they are cancelled."""

from __future__ import annotations

import threading
from typing import Any

from rclpy.action import ActionServer, CancelResponse
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from test_msgs.action import Fibonacci

from benchmarks import child


class Server:
    """The process's action servers."""

    def __init__(self) -> None:
        context = Context()
        context.init(args=[], initialize_logging=False)
        self._node = Node("tree_server", context=context, start_parameter_services=False)
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self._node)
        self._accepted = 0

    def spin(self) -> None:
        """Serve, on a thread of its own."""
        threading.Thread(target=self._executor.spin, daemon=True).start()

    def make(self, number: int) -> None:
        """Make action servers, before any is served."""
        for each in range(number):
            ActionServer(
                self._node,
                Fibonacci,
                f"action_{each}",
                execute_callback=_canceled,
                handle_accepted_callback=self._on_accepted,
                cancel_callback=self._on_cancel,
            )
        self.spin()

    def accepted(self) -> int:
        """Return how many goals were accepted so far."""
        return self._accepted

    def _on_accepted(self, handle: Any) -> None:
        self._accepted += 1

    def _on_cancel(self, handle: Any) -> CancelResponse:
        # Later, because the goal enters CANCELING only when this has returned.
        self._executor.create_task(handle.execute)
        return CancelResponse.ACCEPT


def _canceled(handle: Any) -> Any:
    handle.canceled()
    return Fibonacci.Result()


if __name__ == "__main__":
    answers = child.claim_stdout()
    server = Server()
    commands = (server.make, server.accepted)
    child.serve(answers, {command.__name__: command for command in commands})
