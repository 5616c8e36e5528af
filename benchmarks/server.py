"""The server that all clients are measured against: rclpy's own, by the tutorial, and lean.

The reference servers of `actionkit.servers` keep journals and gates, which cost time. This one
runs a goal at once in its only thread, and can be told to

- forget all goals, by a new action server (`reset`; `renew` for one action of many);
- hold accepted goals until so many are there, and then run them all (`hold=`);
- go on publishing feedback of long goals a hundred times a second (`STREAM`, `stream`).
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import Any

from rclpy.action import ActionServer
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from test_msgs.action import Fibonacci

from actionkit._ros.workarounds.listener_hang import stop_listening
from benchmarks import child

NAME = "fibonacci"
ELSEWHERE = "elsewhere"
"""The name of a second action, for traffic that does not concern clients of the first."""
STREAM = 1000
"""The order of goals that never end, and have feedback only while `stream` is on."""
RATE = 100.0
"""Feedback messages of each such goal per second."""
_INT32 = 2**31


class Server:
    """The process's action servers, or none."""

    def __init__(self) -> None:
        self._context = Context()
        self._context.init(args=[], initialize_logging=False)
        self._node = Node(
            "benchmark_server",
            context=self._context,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._servers: dict[str, ActionServer] = {}
        self._hold = 0
        self._held: list[Any] = []
        self._streams: dict[str, list[Any]] = {NAME: [], ELSEWHERE: []}
        self._flowing: list[Any] = []
        self._streaming = threading.Event()
        threading.Thread(target=self._stream, daemon=True).start()
        self._stopping = False
        self._spinner = threading.Thread(target=self._spin, daemon=True)
        self._spinner.start()

    # --- commands --------------------------------------------------------------------------

    def reset(self, result_timeout: float = 900.0, hold: int = 0) -> float:
        """Replace the action servers; return the monotonic time at which the new were there."""
        return self._on_spinner(lambda: self._make(result_timeout, hold))

    def renew(self, name: str, result_timeout: float = 900.0) -> None:
        """Replace the server of one action, or make it."""
        self._on_spinner(lambda: self._make_one(name, result_timeout))

    def hold(self, goals: int) -> None:
        """Hold accepted goals from now on until so many are there."""
        self._hold = goals

    def leave(self) -> None:
        """Have no action server any more."""
        self._on_spinner(self._destroy)

    def stream(self, name: str | None) -> int:
        """Publish feedback of an action's endless goals, or of none; return how many there are."""
        self._flowing = [] if name is None else self._streams[name]
        (self._streaming.clear if name is None else self._streaming.set)()
        return len(self._flowing)

    def close(self) -> None:
        """Leave the ROS graph."""
        self._streaming.clear()
        self.leave()
        self._stopping = True
        self._executor.create_task(lambda: None)
        self._spinner.join()
        self._executor.shutdown()
        stop_listening(self._node)
        self._node.destroy_node()
        self._context.shutdown()

    # --- on the spinning thread ------------------------------------------------------------

    def _spin(self) -> None:
        while not self._stopping:
            self._executor.spin_once()

    def _on_spinner(self, function: Callable[[], Any]) -> Any:
        done: Future[Any] = Future()

        def call() -> None:
            try:
                done.set_result(function())
            except Exception as error:  # noqa: BLE001  raised where it is waited for
                done.set_exception(error)

        self._executor.create_task(call)
        return done.result(30)

    def _destroy(self) -> None:
        for server in self._servers.values():
            server.destroy()
        self._servers.clear()
        self._held, self._flowing = [], []
        self._streams = {NAME: [], ELSEWHERE: []}

    def _make(self, result_timeout: float, hold: int) -> float:
        self._destroy()
        self._hold = hold
        for name in (NAME, ELSEWHERE):
            self._make_one(name, result_timeout)
        return time.monotonic()

    def _make_one(self, name: str, result_timeout: float) -> None:
        if name in self._servers:
            self._servers.pop(name).destroy()
        self._servers[name] = ActionServer(
            self._node,
            Fibonacci,
            name,
            execute_callback=_execute,
            handle_accepted_callback=partial(self._on_accepted, name),
            result_timeout=result_timeout,
        )

    def _on_accepted(self, name: str, handle: Any) -> None:
        if handle.request.order >= STREAM:
            self._streams[name].append(handle)
            return
        self._held.append(handle)
        if len(self._held) >= self._hold:
            held, self._held = self._held, []
            for one in held:
                one.execute()

    def _stream(self) -> None:
        feedback = Fibonacci.Feedback(sequence=[0] * 10)
        due = time.monotonic()
        number = 0
        while True:
            self._streaming.wait()
            streams = self._flowing
            if streams:
                # One message at a time, evenly, as from goals that know nothing of each other.
                number += 1
                streams[number % len(streams)].publish_feedback(feedback)
            due = max(due + 1 / (RATE * max(1, len(streams))), time.monotonic() - 0.1)
            time.sleep(max(0.0, due - time.monotonic()))


def _execute(handle: Any) -> Any:
    sequence = [0, 1]
    feedback = Fibonacci.Feedback()
    for _ in range(1, handle.request.order):
        sequence.append((sequence[-1] + sequence[-2]) % _INT32)
        feedback.sequence = sequence
        handle.publish_feedback(feedback)
    handle.succeed()
    return Fibonacci.Result(sequence=sequence)


if __name__ == "__main__":
    answers = child.claim_stdout()
    server = Server()
    try:
        commands = (server.reset, server.renew, server.hold, server.leave, server.stream)
        child.serve(answers, {command.__name__: command for command in commands})
    finally:
        server.close()
