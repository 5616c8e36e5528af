"""Records the timeline of a call, with a limit on its length (C6.1)."""

from __future__ import annotations

import uuid

from actionkit._model.values import GoalEvent, GoalState, Timeline

_MOST = 200
"""Events that are kept, enough for thirty attempts. Longer calls keep the first and last half."""


class Recorder:
    """The growing timeline of one call. One thread writes it, any thread may read it."""

    def __init__(self) -> None:
        self._events: tuple[GoalEvent, ...] = ()
        self._counted: uuid.UUID | None = None
        self._count = 0

    def count_feedback(self, goal_id: uuid.UUID, messages: int) -> range:
        """Count feedback messages of this goal; return their numbers, from 1."""
        if goal_id != self._counted:
            self._counted, self._count = goal_id, 0
        self._count += messages
        return range(self._count - messages + 1, self._count + 1)

    def add(self, event: GoalEvent) -> None:
        """Append an event. Of a goal's feedback, only the first and the last event are kept."""
        kept = self._events
        if event.state is GoalState.FEEDBACK:
            kept = _without_the_last_of_two(kept, event.goal_id)
        if len(kept) >= _MOST:
            kept = kept[: _MOST // 2] + kept[_MOST // 2 + 1 :]
        self._events = (*kept, event)

    def events(self) -> Timeline:
        """Return what is kept, oldest first."""
        return Timeline(self._events)


def _without_the_last_of_two(
    events: tuple[GoalEvent, ...], goal_id: uuid.UUID
) -> tuple[GoalEvent, ...]:
    """Return the events without the goal's last feedback, unless that is also its first."""
    places = [
        place
        for place, event in enumerate(events)
        if event.state is GoalState.FEEDBACK and event.goal_id == goal_id
    ]
    if len(places) < 2:
        return events
    return events[: places[-1]] + events[places[-1] + 1 :]
