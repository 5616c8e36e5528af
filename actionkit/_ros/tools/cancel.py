"""Asks the servers of an action to cancel goals by their ids, also goals of other clients.

The request has the same type for all actions, so the package that defines the action is not needed.
"""

from __future__ import annotations

import uuid
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from action_msgs.srv import CancelGoal
from rclpy.qos import QoSProfile

from actionkit._model.cancel_answer import CancelAnswer
from actionkit._ros import runtimes
from actionkit._ros.cancels import CancelQueue, CancelWindow
from actionkit._ros.codes import cancel_answer
from actionkit._ros.native import ResponseSource

_DEPTH = 100
"""Depth of the queue of answers; the window lets far fewer requests be unanswered."""
_JOIN = 5.0
"""Seconds for the communication thread to end; it takes some ten milliseconds."""


@dataclass(frozen=True)
class CancelSaid:
    """What a server answered to a request to cancel a goal; `goal_id` has dashes."""

    goal_id: str
    answer: CancelAnswer


class GoalCanceller:
    """Sends requests to cancel goals, a few at a time, until they are answered or `close`."""

    def __init__(self, action_name: str, on_answer: Callable[[CancelSaid], None]) -> None:
        """Make the client of the servers' cancel service.

        `on_answer` gets each answer, on another thread. Each server on the name answers; after an
        answer that the goal is not known, the request is repeated.
        """
        self._name = action_name
        self._on_answer = on_answer
        self._asked: dict[int, tuple[bytes, float]] = {}
        """Request -> goal, also for answered requests: another server may answer, too."""
        self._runtime = runtimes.acquire(None, self)
        self._runtime.run(self._begin)

    def cancel(self, goal_id: str) -> None:
        """Ask for the goal's cancellation until it is answered."""
        key = uuid.UUID(goal_id).bytes
        self._runtime.call_soon(lambda: self._queue.ask(key))

    def stop(self, goal_id: str) -> None:
        """Stop asking for a goal."""
        key = uuid.UUID(goal_id).bytes
        self._runtime.call_soon(lambda: self._queue.stop(key))

    def close(self) -> None:
        """Send nothing more, and give the node back."""
        self._runtime.run(self._end)
        runtimes.release(self._runtime, self)
        self._runtime.join_if_stopping(_JOIN)

    def _begin(self) -> None:
        self._client = self._runtime.node.create_client(
            CancelGoal, f"{self._name}/_action/cancel_goal", qos_profile=QoSProfile(depth=_DEPTH)
        )
        self._source = ResponseSource(self._client, self._take)
        self._runtime.enable(self._source)
        self._queue = CancelQueue(
            self._runtime,
            self._runtime.window(CancelWindow, self._name),
            send=self._send,
            cancel_timer=self._runtime.cancel_timer,
        )

    def _end(self) -> None:
        self._queue.close()
        self._runtime.disable(self._source)
        self._runtime.node.destroy_client(self._client)

    def _send(self, key: bytes) -> None:
        if not self._client.service_is_ready():
            return  # no server would get it; the queue repeats it soon
        request = CancelGoal.Request()
        request.goal_info.goal_id.uuid = list(key)
        self._asked[self._source.send(request)] = key, self._runtime.now()

    def _take(self, seq: int, response: Any) -> None:
        if seq not in self._asked:
            return
        key, asked_at = self._asked[seq]
        canceling = {bytes(info.goal_id.uuid) for info in response.goals_canceling}
        answer = cancel_answer(response, key, canceling)
        self._queue.answered(key, answer, asked_at)
        self._on_answer(CancelSaid(str(uuid.UUID(bytes=key)), answer))
