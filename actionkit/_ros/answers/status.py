"""Reads the status topic, only while a goal needs it, and at a limited rate.

At every change, a server publishes all goals that it remembers. A goal that ends within a second
does not need this: its acceptance and result say everything. A longer goal is searched for in the
raw bytes (see `wire`), at most ten times a second, even if other clients cause many messages. Each
message counts: the next one may no longer show that somebody cancels the goal, and each of several
servers sends its own goals only.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.exceptions import InvalidHandle

from actionkit._ros.answers.wire import count_goals, goal_states
from actionkit._ros.communication.runtime import Runtime
from actionkit._ros.endpoints.entities import Entities
from actionkit._ros.rclpy_private.native import RCLError
from actionkit._ros.rclpy_private.wait_set import MessageSource
from actionkit._threads.clock import TimerHandle

_PERIOD = 0.1
"""Seconds between two reads, and so the longest delay of a state."""
_CANCELS = (GoalStatus.STATUS_CANCELING, GoalStatus.STATUS_CANCELED)


class StatusWatch:
    """Reports the status codes of goals after `start`. On the communication thread only."""

    def __init__(
        self,
        runtime: Runtime,
        entities: Entities,
        goals: Mapping[bytes, Any],
        on_state: Callable[[bytes, int], None],
        *,
        awaits_cancels: Callable[[], bool],
        on_cancels: Callable[[], None],
    ) -> None:
        """Do nothing until `start` is called.

        Args:
            goals: The goals wanted, by id. Read at each message.
            on_state: Called with a goal's id and its status code.
            awaits_cancels: Whether a request to cancel a goal of ours is unanswered.
            on_cancels: Called when the server has cancelled more goals than before, also goals of
                other clients, while a request of ours is unanswered.
        """
        self._runtime = runtime
        self._entities = entities
        self._goals = goals
        self._on_state = on_state
        self._awaits_cancels = awaits_cancels
        self._on_cancels = on_cancels
        self._canceled: int | None = None
        """How many goals were cancelled at the last check."""
        self._source: MessageSource | None = None
        self._left = False
        self._pause: TimerHandle | None = None

    def start(self) -> None:
        """Subscribe. Do nothing if the context was shut down: then nothing can be made (R10)."""
        if self._source is not None:
            return
        try:
            self._source = self._entities.subscribe_status(self._read)
        except (RCLError, InvalidHandle):
            if self._runtime.context.ok():
                raise
        else:
            self._runtime.enable(self._source)

    def leave(self) -> None:
        """Destroy the subscription, before the node is replaced."""
        self._left = self._source is not None
        self.stop()

    def enter(self) -> None:
        """Subscribe on the new node, if there was a subscription on the old one."""
        if self._left:
            self.start()

    def stop(self) -> None:
        """Destroy the subscription, until `start` is called again."""
        if self._source is None:
            return
        if self._pause is not None:
            self._runtime.cancel_timer(self._pause)
            self._pause = None
        self._runtime.disable(self._source)
        self._entities.unsubscribe_status(self._source)
        self._source = None

    def take_now(self) -> None:
        """Read the messages that have come now, even in the pause."""
        messages = [] if self._source is None else self._source.take()
        for message in messages:
            for goal_id, code in list(goal_states(message, self._goals.keys())):
                self._on_state(goal_id, code)
        if messages:
            self._look_for_cancels(messages[-1])

    def _look_for_cancels(self, message: bytes) -> None:
        """Check whether the server goes on cancelling while our requests wait for their turn."""
        if not self._awaits_cancels():
            self._canceled = None
            return
        before, self._canceled = self._canceled, count_goals(message, _CANCELS)
        if before is not None and self._canceled > before:
            self._on_cancels()
        elif before is not None:  # each of two servers on one name sends its own goals
            self._canceled = max(before, self._canceled)

    def _read(self) -> None:
        if self._source is None:
            return
        # No wait for messages during the pause: so a busy server cannot keep us busy.
        self._runtime.disable(self._source)
        self._pause = self._runtime.call_at(self._runtime.now() + _PERIOD, self._end_pause)
        self.take_now()

    def _end_pause(self) -> None:
        self._pause = None
        if self._source is not None:
            self._runtime.enable(self._source)
