"""Asks the servers of an action to cancel goals, also those of other clients.

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

from actionkit._model.cancel_answer import CancelAnswer
from actionkit._ros.answers.codes import cancel_answer
from actionkit._ros.cancelling.cancels import CancelQueue, CancelWindow
from actionkit._ros.communication import runtimes
from actionkit._ros.endpoints.names import ActionNames
from actionkit._ros.rclpy_private.native import RCLError
from actionkit._ros.rclpy_private.wait_set import ResponseSource
from actionkit._threads.clock import TimerHandle

_DEPTH = 100
"""Depth of the queue of answers; the window lets far fewer requests be unanswered."""
_NOT_READY = 0.05
"""Seconds between two checks whether a server that has just come into sight takes requests."""
_JOIN = 5.0
"""Seconds for the communication thread to end; it takes some ten milliseconds."""


@dataclass(frozen=True)
class CancelSaid:
    """What a server answered to a request to cancel a goal; `goal_id` has dashes."""

    goal_id: str
    answer: CancelAnswer
    request: int = 0  # the number of the request; each server on the name answers it


@dataclass(frozen=True)
class AllSaid:
    """What one server answered to a request to cancel all goals."""

    request: int  # the number of the request
    canceling: tuple[str, ...]  # the ids of the goals that it is cancelling now, with dashes
    code: int = 0  # `return_code`; 0 is consent; some servers cannot cancel all


class GoalCanceller:
    """Sends requests to cancel goals of one action, from any thread, until `close`."""

    def __init__(
        self,
        names: ActionNames,
        on_answer: Callable[[CancelSaid | AllSaid], object],
        place: runtimes.Place | None = None,
    ) -> None:
        """Make the client of the servers' cancel service; `place` is that of `runtimes.acquire`.

        `on_answer` gets each answer, on another thread. Each server on the name answers.
        """
        self._names = names
        self._on_answer = on_answer
        self._asked: dict[int, tuple[bytes, float]] = {}
        """Request -> goal, also for answered requests: another server may answer, too."""
        self._asked_all: dict[int, int] = {}
        """Request to cancel all goals -> its number."""
        self._timer: TimerHandle | None = None
        self._client: Any = None
        self._runtime = runtimes.acquire(place, self)
        try:
            self._runtime.run(self._begin)
        except BaseException:  # also after Ctrl-C: nobody would call `close`
            self._runtime.call_soon(self._end)
            runtimes.release(self._runtime, self)
            raise

    def cancel(self, goal_id: str) -> None:
        """Ask for the goal's cancellation until it is answered, a few goals at a time.

        After an answer that the goal is not known, the request is repeated.
        """
        key = uuid.UUID(goal_id).bytes
        self._runtime.call_soon(lambda: self._queue.ask(key))

    def cancel_all(self, number: int, *, until: float = 0.0) -> None:
        """Ask once for the cancellation of all goals, when a server can take the request.

        With `until`, only of those that were accepted until then: seconds since the epoch, by the
        server's clock. A busy server may take the request later.
        """
        self._runtime.call_soon(lambda: self._send_all(number, until))

    def stop(self, goal_id: str) -> None:
        """Stop asking for a goal."""
        key = uuid.UUID(goal_id).bytes
        self._runtime.call_soon(lambda: self._queue.stop(key))

    def close(self) -> None:
        """Send nothing more, ignore further answers, and release the node."""
        self._runtime.run(self._end)
        runtimes.release(self._runtime, self)
        self._runtime.join_if_stopping(_JOIN)

    def _begin(self) -> None:
        client = self._runtime.node.create_client(
            CancelGoal, self._names.cancel_goal, qos_profile=QoSProfile(depth=_DEPTH)
        )
        self._source = ResponseSource(client, self._take)
        self._runtime.enable(self._source)
        self._queue = CancelQueue(
            self._runtime,
            self._runtime.window(CancelWindow, self._names.action),
            send=self._send,
            cancel_timer=self._runtime.cancel_timer,
        )
        self._client = client

    def _end(self) -> None:
        if self._client is None:
            return
        self._queue.close()
        self._stop_waiting()
        self._runtime.disable(self._source)
        self._runtime.node.destroy_client(self._client)

    def _is_ready(self) -> bool:
        try:
            return bool(self._client.service_is_ready())
        except (RCLError, InvalidHandle):
            # In a context that was shut down the graph cannot be asked, but requests work (R10).
            return True

    def _send(self, key: bytes) -> None:
        if not self._is_ready():
            return  # no server would get it; the queue repeats it soon
        request = CancelGoal.Request()
        request.goal_info.goal_id.uuid = list(key)
        self._asked[self._source.send(request)] = key, self._runtime.now()

    def _send_all(self, number: int, until: float) -> None:
        self._stop_waiting()
        if self._is_ready():
            request = CancelGoal.Request()  # all zeros, in the id and in the stamp, mean all goals
            stamp = request.goal_info.stamp
            stamp.sec, stamp.nanosec = int(until), int(until % 1 * 1e9)
            self._asked_all[self._source.send(request)] = number
        else:
            again = self._runtime.now() + _NOT_READY
            self._timer = self._runtime.call_at(again, lambda: self._send_all(number, until))

    def _stop_waiting(self) -> None:
        if self._timer is not None:
            self._runtime.cancel_timer(self._timer)
            self._timer = None

    def _take(self, seq: int, response: Any) -> None:
        canceling = [bytes(info.goal_id.uuid) for info in response.goals_canceling]
        if seq in self._asked_all:
            told = tuple(str(uuid.UUID(bytes=key)) for key in canceling)
            self._on_answer(AllSaid(self._asked_all[seq], told, int(response.return_code)))
        elif seq in self._asked:
            key, asked_at = self._asked[seq]
            answer = cancel_answer(response, key, canceling)
            self._queue.answered(key, answer, asked_at)
            self._on_answer(CancelSaid(str(uuid.UUID(bytes=key)), answer, seq))
