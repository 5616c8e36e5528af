"""An action server whose goals have as much feedback, and as large a result, as it is told."""

from __future__ import annotations

import threading
import time
from array import array
from typing import Any

from rclpy.action import ActionServer
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from test_msgs.action import Fibonacci

from actionkit._ros.workarounds.listener_hang import stop_listening
from benchmarks import child

NAME = "bulk"
_FORGETFUL = 0.5


class Server:
    """One action, served by a thread; feedback is published by another, one for each goal."""

    def __init__(self) -> None:
        self._context = Context()
        self._context.init(args=[], initialize_logging=False)
        self._node = Node("bulk_server", context=self._context, start_parameter_services=False)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._server = ActionServer(
            self._node,
            Fibonacci,
            NAME,
            execute_callback=self._execute,
            handle_accepted_callback=self._on_accepted,
            result_timeout=_FORGETFUL,
        )
        self._feedback, self._result = Fibonacci.Feedback(), Fibonacci.Result()
        self._messages, self._rate = 0, 1.0
        self._spinner = threading.Thread(target=self._executor.spin, daemon=True)
        self._spinner.start()

    def load(
        self, feedback: int = 0, messages: int = 0, rate: float = 1.0, result: int = 0
    ) -> None:
        """Say how many bytes each message and the result of the next goals have."""
        self._feedback = Fibonacci.Feedback(sequence=array("i", bytes(feedback)))
        self._result = Fibonacci.Result(sequence=array("i", bytes(result)))
        self._messages, self._rate = messages, rate

    def close(self) -> None:
        """Leave the ROS graph."""
        self._executor.shutdown()
        self._spinner.join()
        self._server.destroy()
        stop_listening(self._node)
        self._node.destroy_node()
        self._context.shutdown()

    def _on_accepted(self, handle: Any) -> None:
        threading.Thread(target=self._run, args=(handle,), daemon=True).start()

    def _run(self, handle: Any) -> None:
        due = time.monotonic()
        for _ in range(self._messages):
            handle.publish_feedback(self._feedback)
            due += 1 / self._rate
            time.sleep(max(0.0, due - time.monotonic()))
        handle.execute()

    def _execute(self, handle: Any) -> Any:
        handle.succeed()
        return self._result


if __name__ == "__main__":
    answers = child.claim_stdout()
    server = Server()
    try:
        child.serve(answers, {"load": server.load})
    finally:
        server.close()
