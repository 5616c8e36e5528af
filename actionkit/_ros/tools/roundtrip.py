"""How long a server takes to be found and to answer, measured without touching a goal.

What is asked is to cancel a goal whose id was made up this moment. A server answers that with
"unknown goal", and nothing else comes of it (R2). The request has one type for all actions, so
no package of the action's own is needed.
"""

from __future__ import annotations

import queue
import time
import uuid
from dataclasses import dataclass

from action_msgs.srv import CancelGoal
from rclpy.qos import QoSProfile

from actionkit._ros import runtimes
from actionkit._ros.native import ResponseSource
from actionkit._ros.runtime import Runtime

_DEPTH = 100
_STEP = 0.01
_PATIENCE = 1.0
"""Seconds after which a question is taken for lost and asked again (R4)."""
_TIMES = 5


@dataclass(frozen=True)
class RoundTrip:
    """What was measured, in seconds; `None` where it did not come to that.

    Attributes:
        matched: From making the endpoint until the middleware had matched it with a server's.
        first: From the first question to the first answer, lost questions included.
        asked: How many questions that took.
        later: How long the answers to further questions took.
        answers: How many answers the last question got: one from each server.
    """

    matched: float | None
    first: float | None
    asked: int
    later: tuple[float, ...]
    answers: int


def measure(action_name: str, timeout: float) -> RoundTrip:
    """Ask the servers of an action, several times.

    Args:
        action_name: The full name.
        timeout: Seconds for the matching, and again for the first answer.

    Raises:
        Exception: Whatever rclpy raises where the endpoint cannot be made.
    """
    user = object()
    runtime = runtimes.acquire(None, user)
    try:
        return _Asker(runtime, action_name).measure(timeout)
    finally:
        runtimes.release(runtime, user)


class _Asker:
    """One service client for cancel requests, and what comes back to it."""

    def __init__(self, runtime: Runtime, action_name: str) -> None:
        self._runtime = runtime
        self._answers: queue.SimpleQueue[tuple[int, float]] = queue.SimpleQueue()
        self._client = runtime.run(
            lambda: runtime.node.create_client(
                CancelGoal,
                f"{action_name}/_action/cancel_goal",
                qos_profile=QoSProfile(depth=_DEPTH),
            )
        )
        self._source = ResponseSource(self._client, self._take)
        runtime.call_soon(lambda: runtime.enable(self._source))

    def measure(self, timeout: float) -> RoundTrip:
        try:
            return self._measure(timeout)
        finally:
            self._runtime.run(self._destroy)

    def _measure(self, timeout: float) -> RoundTrip:
        began = time.monotonic()
        while not self._runtime.run(self._client.service_is_ready):
            if time.monotonic() - began > timeout:
                return RoundTrip(None, None, 0, (), 0)
            time.sleep(_STEP)
        matched = time.monotonic() - began
        began = time.monotonic()
        asked = 0
        first: list[float] = []
        while not first and time.monotonic() - began < timeout:
            asked += 1
            first = self._ask()
        if not first:
            return RoundTrip(matched, None, asked, (), 0)
        total = time.monotonic() - began
        later = [seconds for _ in range(_TIMES) for seconds in self._ask()]
        return RoundTrip(matched, total, asked, tuple(later), len(self._ask(everybody=True)))

    def _ask(self, *, everybody: bool = False) -> list[float]:
        """Ask once; return how long the answer took, if it came.

        Args:
            everybody: Whether to wait for the answers of all servers, not just the first.
        """
        began = time.monotonic()
        number = self._runtime.run(self._send)
        taken: list[float] = []
        while everybody or not taken:
            # The others take about as long as the first.
            patience = min(_PATIENCE, 0.1 + 10 * taken[0]) if taken else _PATIENCE
            try:
                seq, at = self._answers.get(timeout=patience)
            except queue.Empty:
                break
            if seq == number:
                taken.append(at - began)
        return taken

    def _send(self) -> int:
        request = CancelGoal.Request()
        request.goal_info.goal_id.uuid = list(uuid.uuid4().bytes)
        return self._source.send(request)

    def _take(self, seq: int, response: object) -> None:
        self._answers.put((seq, time.monotonic()))

    def _destroy(self) -> None:
        self._runtime.disable(self._source)
        self._runtime.node.destroy_client(self._client)
