"""Measures how long a server takes to be found and to answer, without touching a goal.

It sends probes: requests to cancel a goal that cannot exist. A server answers "unknown goal", and
nothing else happens (R2). The request has the same type for all actions, so the package that
defines the action is not needed.
"""

from __future__ import annotations

import queue
import time
import uuid
from dataclasses import dataclass

from action_msgs.srv import CancelGoal
from rclpy.qos import QoSProfile

from actionkit._ros.communication import runtimes
from actionkit._ros.communication.runtime import Runtime
from actionkit._ros.rclpy_private.wait_set import ResponseSource

_DEPTH = 100
"""Depth of the queue of answers; far more than there are servers on one name."""
_STEP = 0.01
"""Seconds between two checks for a match, and so the precision of that measurement."""
_PATIENCE = 1.0
"""Seconds after which a probe is taken for lost and the next is sent (R4)."""
_TIMES = 5
"""More probes, to see how much the times differ."""


@dataclass(frozen=True)
class RoundTrip:
    """What was measured, in seconds."""

    matched: float | None  # from making the endpoint to its match; `None` if never
    first: float | None  # from the first probe to an answer; `None` if none came
    asked: int  # how many probes this took
    later: tuple[float, ...]  # how long the answers to more probes took
    answers: int  # how many servers answered the last probe


def measure(action_name: str, timeout: float) -> RoundTrip:
    """Probe the servers of an action several times.

    `timeout` is in seconds, for the matching, and again for the first answer. Any error of rclpy
    goes to the caller if the endpoint cannot be made.
    """
    user = object()
    runtime = runtimes.acquire(None, user)
    try:
        prober = _Prober(runtime, action_name)
        try:
            return prober.measure(timeout)
        finally:
            runtime.run(prober.destroy)
    finally:
        runtimes.release(runtime, user)


class _Prober:
    """A service client for cancel requests, and the answers to them."""

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
        self._source = ResponseSource(
            self._client, lambda seq, _: self._answers.put((seq, time.monotonic()))
        )
        runtime.call_soon(lambda: runtime.enable(self._source))

    def measure(self, timeout: float) -> RoundTrip:
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
            first = self._probe()
        if not first:
            return RoundTrip(matched, None, asked, (), 0)
        total = time.monotonic() - began
        later = [seconds for _ in range(_TIMES) for seconds in self._probe()]
        return RoundTrip(matched, total, asked, tuple(later), len(self._probe(everybody=True)))

    def destroy(self) -> None:
        self._runtime.disable(self._source)
        self._runtime.node.destroy_client(self._client)

    def _probe(self, *, everybody: bool = False) -> list[float]:
        """Send a probe; return how long the answers took that came.

        If `everybody`, wait for the answers of all servers, not only for the first.
        """
        request = CancelGoal.Request()
        request.goal_info.goal_id.uuid = list(uuid.uuid4().bytes)
        began = time.monotonic()
        number = self._runtime.run(lambda: self._source.send(request))
        taken: list[float] = []
        while everybody or not taken:
            # The other servers need about as much time as the first.
            patience = min(_PATIENCE, 0.1 + 10 * taken[0]) if taken else _PATIENCE
            try:
                seq, at = self._answers.get(timeout=patience)
            except queue.Empty:
                break
            if seq == number:
                taken.append(at - began)
        return taken
