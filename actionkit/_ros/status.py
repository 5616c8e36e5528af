"""Reads the status topic, only while a goal needs it, and then at a limited rate.

At every change a server publishes all goals that it remembers. A goal that ends within a second
does not need that: its acceptance and result say everything. A goal that lasts is looked for in
the raw bytes (see `wire`), a few times a second at most, however much others send.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.exceptions import InvalidHandle

from actionkit._ros.entities import Entities
from actionkit._ros.native import MessageSource, RCLError
from actionkit._ros.runtime import Runtime
from actionkit._ros.wire import count_goals, goal_states
from actionkit._threads.clock import TimerHandle

_PERIOD = 0.1
"""Seconds between two reads. No state is missed for longer: the topic keeps its latest message,
which tells all."""
_CANCELS = (GoalStatus.STATUS_CANCELING, GoalStatus.STATUS_CANCELED)


class StatusWatch:
    """Tells the status codes of goals while it is started. On the communication thread only."""

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
            runtime: All this happens on its thread.
            entities: What makes the subscription.
            goals: The goals wanted, by id. Read at each message.
            on_state: Called with a goal's id and its status code.
            awaits_cancels: Whether a request to cancel a goal of ours is unanswered.
            on_cancels: Called when the server has cancelled more goals than before, those of other
                clients too, while one of ours awaits that.
        """
        self._runtime = runtime
        self._entities = entities
        self._goals = goals
        self._on_state = on_state
        self._awaits_cancels = awaits_cancels
        self._on_cancels = on_cancels
        self._canceled: int | None = None
        """How many goals were cancelled when that was last looked at."""
        self._source: MessageSource | None = None
        self._left = False
        self._pause: TimerHandle | None = None

    def start(self) -> None:
        """Subscribe. After the context was shut down nothing new can be made: do nothing (R10)."""
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
        """Subscribe on the node that has replaced the earlier one, if there was a subscription."""
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
        """Read the latest message now, also within the pause."""
        if self._source is None:
            return
        for message in self._source.take()[-1:]:  # each message tells all
            for goal_id, code in list(goal_states(message, self._goals.keys())):
                self._on_state(goal_id, code)
            self._look_for_cancels(message)

    def _look_for_cancels(self, message: bytes) -> None:
        """See whether the server goes on cancelling while ours have to wait for their turn."""
        if not self._awaits_cancels():
            self._canceled = None
            return
        before, self._canceled = self._canceled, count_goals(message, _CANCELS)
        if before is not None and self._canceled > before:
            self._on_cancels()
        elif before is not None:  # of two servers on one name each tells its own
            self._canceled = max(before, self._canceled)

    def _read(self) -> None:
        if self._source is None:
            return
        # It is not waited for during the pause, so that a busy server cannot keep us busy.
        self._runtime.disable(self._source)
        self._pause = self._runtime.call_at(self._runtime.now() + _PERIOD, self._end_pause)
        self.take_now()

    def _end_pause(self) -> None:
        self._pause = None
        if self._source is not None:
            self._runtime.enable(self._source)
