"""The story of a call, in the order seen and bounded in memory (contract C6.1)."""

from __future__ import annotations

import uuid

from actionkit._values import GoalEvent, GoalState

_MOST = 200
"""Events kept; a call that retries for days keeps its beginning and its end."""


class Timeline:
    """Events of one call. Written by one thread, read by any."""

    def __init__(self) -> None:
        self.feedback_count = 0
        self._events: tuple[GoalEvent, ...] = ()
        # By goal: the last feedback event kept beside the first, if there is one.
        self._later_feedback: dict[uuid.UUID, GoalEvent | None] = {}

    def add(self, event: GoalEvent) -> None:
        """Append an event. Of a goal's feedback only the first and the last are kept."""
        kept = self._events
        if event.state is GoalState.FEEDBACK:
            self.feedback_count += 1
            if event.goal_id in self._later_feedback:
                previous = self._later_feedback[event.goal_id]
                kept = tuple(other for other in kept if other is not previous)
                self._later_feedback[event.goal_id] = event
            else:
                self._later_feedback[event.goal_id] = None
        if len(kept) >= _MOST:
            kept = kept[: _MOST // 2] + kept[_MOST // 2 + 1 :]
        self._events = (*kept, event)

    def events(self) -> tuple[GoalEvent, ...]:
        """Return what is kept, oldest first."""
        return self._events
