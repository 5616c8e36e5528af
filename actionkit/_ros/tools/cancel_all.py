"""Asks the servers of an action to cancel all their goals with one request.

The request has the same type for all actions, so the package that defines the action is not needed.
"""

from __future__ import annotations

import uuid
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from action_msgs.srv import CancelGoal
from rclpy.exceptions import InvalidHandle
from rclpy.qos import QoSProfile

from actionkit._ros import runtimes
from actionkit._ros.native import RCLError, ResponseSource
from actionkit._threads.clock import TimerHandle

_DEPTH = 100
"""Depth of the queue of answers; far more than there are servers on one name."""
_NOT_READY = 0.05
"""Seconds between two checks whether a server that has just come into sight takes requests."""
_JOIN = 5.0
"""Seconds for the communication thread to end; it takes some ten milliseconds."""


@dataclass(frozen=True)
class AllSaid:
    """What one server answered."""

    request: int  # the number of the request, from 1
    canceling: tuple[str, ...]  # the ids of the goals that it is cancelling now, with dashes


class AllGoalsCanceller:
    """Sends requests to cancel all goals of one action, from any thread, until `close`."""

    def __init__(self, action_name: str, on_answer: Callable[[AllSaid], object]) -> None:
        """Make the client of the cancel service; `on_answer` is called on another thread."""
        self._name = action_name
        self._on_answer = on_answer
        self._numbers: dict[int, int] = {}
        self._timer: TimerHandle | None = None
        self._runtime = runtimes.acquire(None, self)
        self._runtime.run(self._begin)

    def ask(self, number: int) -> None:
        """Send the request `number` when a server can take it. Returns at once."""
        self._runtime.call_soon(lambda: self._ask(number))

    def close(self) -> None:
        """Ignore further answers, and release the node."""
        self._runtime.run(self._end)
        runtimes.release(self._runtime, self)
        self._runtime.join_if_stopping(_JOIN)

    def _begin(self) -> None:
        self._client = self._runtime.node.create_client(
            CancelGoal, f"{self._name}/_action/cancel_goal", qos_profile=QoSProfile(depth=_DEPTH)
        )
        self._source = ResponseSource(self._client, self._take)
        self._runtime.enable(self._source)

    def _end(self) -> None:
        self._stop_waiting()
        self._runtime.disable(self._source)
        self._runtime.node.destroy_client(self._client)

    def _ask(self, number: int) -> None:
        self._stop_waiting()
        try:
            ready = self._client.service_is_ready()
        except (RCLError, InvalidHandle):
            # In a context that was shut down the graph cannot be asked, but requests work (R10).
            ready = True
        if ready:
            # All zeros, in the id and in the stamp, mean all goals.
            self._numbers[self._source.send(CancelGoal.Request())] = number
        else:
            again = self._runtime.now() + _NOT_READY
            self._timer = self._runtime.call_at(again, lambda: self._ask(number))

    def _stop_waiting(self) -> None:
        if self._timer is not None:
            self._runtime.cancel_timer(self._timer)
            self._timer = None

    def _take(self, seq: int, response: Any) -> None:
        number = self._numbers.get(seq)
        if number is not None:
            ids = [bytes(info.goal_id.uuid) for info in response.goals_canceling]
            told = tuple(str(uuid.UUID(bytes=goal_id)) for goal_id in ids)
            self._on_answer(AllSaid(number, told))
