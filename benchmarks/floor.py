"""The least that a call can cost in Python: the same three round trips on rclpy's handles.

The thread that calls waits with one wait set for the client's entities. There is no other thread,
no executor, no state and no cancel: nobody should use this for a robot.
"""

from __future__ import annotations

import time
import uuid
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from test_msgs.action import Fibonacci
from unique_identifier_msgs.msg import UUID

from actionkit._ros.workarounds.listener_hang import stop_listening
from benchmarks.clients import DEEP, WINDOW, connect
from benchmarks.variant import PATIENCE, OnFeedback, Variant

_NANOSECONDS = 1_000_000_000


class Floor(Variant):
    """Sends the requests, waits and takes the answers, in the thread that calls."""

    def open(self, name: str) -> None:
        self.context = Context()
        self.context.init(args=[], initialize_logging=False)
        self.node = Node("floor", context=self.context)
        self.client = ActionClient(
            self.node,
            Fibonacci,
            name,
            goal_service_qos_profile=DEEP,
            result_service_qos_profile=DEEP,
            feedback_sub_qos_profile=DEEP,
        )
        executor = SingleThreadedExecutor(context=self.context)
        executor.add_node(self.node)

        def wait(future: Any, timeout: float = PATIENCE) -> Any:
            executor.spin_until_future_complete(future, timeout)
            return future.result() if future.done() else None

        assert self.client.wait_for_server(PATIENCE)
        connect(self.client, wait)
        executor.remove_node(self.node)
        executor.shutdown()
        self._handle = self.client._client_handle
        counts = self._handle.get_num_entities()
        self._waiting = rclpy_implementation.WaitSet(*counts, 0, self.context.handle)

    def close(self) -> None:
        self.client.destroy()
        stop_listening(self.node)
        self.node.destroy_node()
        self.context.shutdown()

    def call(self, order: int, on_feedback: OnFeedback | None) -> Any:
        handle, kinds = self._handle, Fibonacci.Impl
        goal_id, _ = self._send(order)
        until = time.monotonic() + PATIENCE
        while time.monotonic() < until:
            feedback, status, accepted, _, ended = self._wait()
            if status:
                handle.take_status(kinds.GoalStatusMessage)
            if feedback:
                message = handle.take_feedback(kinds.FeedbackMessage)
                if on_feedback is not None and message is not None:
                    on_feedback(message.feedback)
            if accepted:
                _, answer = handle.take_goal_response(kinds.SendGoalService.Response)
                assert answer.accepted
                handle.send_result_request(kinds.GetResultService.Request(goal_id=goal_id))
            if ended:
                _, answer = handle.take_result_response(kinds.GetResultService.Response)
                assert answer.status == GoalStatus.STATUS_SUCCEEDED
                return answer.result.sequence
        raise TimeoutError

    def at_once(self, goals: int, order: int) -> list[float]:
        handle, kinds = self._handle, Fibonacci.Impl
        sent: dict[int, tuple[UUID, float]] = {}
        began: dict[int, float] = {}
        took: list[float] = []
        until = time.monotonic() + PATIENCE
        left = goals
        while time.monotonic() < until:
            while left and len(sent) < WINDOW:
                now = time.perf_counter()
                goal_id, number = self._send(order)
                sent[number] = goal_id, now
                left -= 1
            feedback, status, accepted, _, ended = self._wait()
            if status:
                handle.take_status(kinds.GoalStatusMessage)
            if feedback:
                handle.take_feedback(kinds.FeedbackMessage)
            if accepted:
                number, answer = handle.take_goal_response(kinds.SendGoalService.Response)
                assert answer.accepted
                goal_id, now = sent.pop(number)
                request = kinds.GetResultService.Request(goal_id=goal_id)
                began[handle.send_result_request(request)] = now
            if ended:
                number, answer = handle.take_result_response(kinds.GetResultService.Response)
                assert answer.status == GoalStatus.STATUS_SUCCEEDED
                took.append(time.perf_counter() - began[number])
                if len(took) == goals:
                    return took
        raise TimeoutError

    def _send(self, order: int) -> tuple[UUID, int]:
        """Send a goal; return its id, and the number of the request."""
        goal_id = UUID(uuid=list(uuid.uuid4().bytes))
        goal = Fibonacci.Goal(order=order)
        request = Fibonacci.Impl.SendGoalService.Request(goal_id=goal_id, goal=goal)
        return goal_id, self._handle.send_goal_request(request)

    def _wait(self) -> Any:
        """Return what can be taken: feedback, status, and three kinds of answers."""
        self._waiting.clear_entities()
        self._handle.add_to_waitset(self._waiting)
        self._waiting.wait(int(PATIENCE * _NANOSECONDS))
        return self._handle.is_ready(self._waiting)
