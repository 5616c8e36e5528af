"""The status topic, read only while a goal needs it, and then at a bounded rate.

A server publishes its whole memory of goals at every change. A goal that ends within a second
never needs that: its acceptance and result say all. One that lasts is looked for in the raw
bytes (see wire), a few times a second at most, whatever the traffic of others.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from rclpy.exceptions import InvalidHandle

from actionkit._ros.entities import Entities, StatusSubscription
from actionkit._ros.native import RCLError
from actionkit._ros.runtime import Runtime
from actionkit._ros.wire import goal_states
from actionkit._threads.clock import TimerHandle

_PERIOD = 0.1
"""Seconds between two readings; the topic keeps only its latest message."""


class StatusWatch:
    """Tells the status codes of the goals in a table while it is on."""

    def __init__(
        self,
        runtime: Runtime,
        entities: Entities,
        goals: Mapping[bytes, Any],
        on_state: Callable[[bytes, int], None],
    ) -> None:
        """Be off.

        Args:
            runtime: Whose thread this is.
            entities: What makes the subscription.
            goals: The goals wanted, by id; read at each message.
            on_state: Called with a goal's id and its status code.
        """
        self._runtime = runtime
        self._entities = entities
        self._goals = goals
        self._on_state = on_state
        self._subscription: StatusSubscription | None = None
        self._timer: TimerHandle | None = None

    def start(self) -> None:
        """Be on. Where the context was shut down nothing new can be made, so it stays off (R10)."""
        if self._subscription is not None:
            return
        try:
            self._subscription = self._entities.subscribe_status(self._take)
        except (RCLError, InvalidHandle):
            if self._runtime.context.ok():
                raise
        else:
            self._runtime.enable(self._subscription.source)

    def stop(self) -> None:
        """Be off."""
        if self._subscription is None:
            return
        if self._timer is not None:
            self._runtime.timers.cancel(self._timer)
            self._timer = None
        self._runtime.disable(self._subscription.source)
        self._subscription.destroy()
        self._subscription = None

    def take_now(self) -> None:
        """Read what has come, though the period is not over."""
        if self._subscription is None:
            return
        for message in self._subscription.source.take()[-1:]:  # each tells all
            for goal_id, code in list(goal_states(message, self._goals.keys())):
                self._on_state(goal_id, code)

    def _take(self) -> None:
        if self._subscription is None:
            return
        # Not waited for until the period is over, so that a busy server cannot keep us busy.
        self._runtime.disable(self._subscription.source)
        self._timer = self._runtime.call_at(self._runtime.now() + _PERIOD, self._resume)
        self.take_now()

    def _resume(self) -> None:
        self._timer = None
        if self._subscription is not None:
            self._runtime.enable(self._subscription.source)
