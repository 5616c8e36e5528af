"""rclpy under asyncio, by the two bridges that forums pass on.

Both send and wait by rclpy's own futures. "spin_once" spins in a task of the event loop, a little
at a time, and awaits rclpy's futures there, which asyncio takes for a coroutine that always wants
to go on. "run_in_executor" lets a thread of the loop's pool spin once, again and again.
"""

from __future__ import annotations

import asyncio
import time
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from test_msgs.action import Fibonacci

from actionkit._ros.workarounds.listener_hang import stop_listening
from benchmarks.clients import connect
from benchmarks.variant import PATIENCE, OnFeedback, Variant

_SPIN = 0.01
_PAUSE = 0.001
"""Seconds of each, as they are copied."""


class SpinningTask(Variant):
    """`spin_once` and `asyncio.sleep` in a task, by turns."""

    def open(self, name: str) -> None:
        self.context = Context()
        self.context.init(args=[], initialize_logging=False)
        self.node = Node("bridge", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.client = ActionClient(self.node, Fibonacci, name)
        assert self.client.wait_for_server(PATIENCE)
        connect(self.client, self._spin)
        self._loop = asyncio.new_event_loop()

    def _spin(self, future: Any, timeout: float) -> Any:
        self.executor.spin_until_future_complete(future, timeout)
        return future.result() if future.done() else None

    def close(self) -> None:
        self._loop.run_until_complete(self._loop.shutdown_default_executor())
        self._loop.close()
        self.executor.shutdown()
        self.client.destroy()
        stop_listening(self.node)
        self.node.destroy_node()
        self.context.shutdown()

    def in_a_row(self, calls: int, order: int, on_feedback: OnFeedback | None) -> list[float]:
        async def main() -> list[float]:
            spinning = asyncio.create_task(self.spin())
            try:
                return [await self._timed(order, on_feedback) for _ in range(calls)]
            finally:
                spinning.cancel()
                await asyncio.wait([spinning])

        return self._loop.run_until_complete(main())

    async def spin(self) -> None:
        """Keep rclpy going until cancelled."""
        while True:
            self.executor.spin_once(timeout_sec=_SPIN)
            await asyncio.sleep(_PAUSE)

    async def wait(self, future: Any) -> Any:
        """Wait for a future of rclpy's."""
        return await future

    async def _timed(self, order: int, on_feedback: OnFeedback | None) -> float:
        began = time.perf_counter()
        callback = None if on_feedback is None else lambda msg: on_feedback(msg.feedback)
        goal = Fibonacci.Goal(order=order)
        handle = await asyncio.wait_for(
            self.wait(self.client.send_goal_async(goal, callback)), PATIENCE
        )
        assert handle.accepted
        answer = await asyncio.wait_for(self.wait(handle.get_result_async()), PATIENCE)
        assert answer.status == GoalStatus.STATUS_SUCCEEDED
        assert len(answer.result.sequence) == order + 1
        return time.perf_counter() - began


class SpinningThread(SpinningTask):
    """`spin_once` by `run_in_executor`; what is done is handed to the loop."""

    async def spin(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            # Shielded: a spin that was left alone would meet the next one.
            spun = loop.run_in_executor(None, self.executor.spin_once, _SPIN)
            try:
                await asyncio.shield(spun)
            except asyncio.CancelledError:
                await spun
                raise

    async def wait(self, future: Any) -> Any:
        loop = asyncio.get_running_loop()
        done: asyncio.Future[Any] = loop.create_future()

        def hand_over(ended: Any) -> None:
            loop.call_soon_threadsafe(done.set_result, ended.result())

        future.add_done_callback(hand_over)
        return await done
