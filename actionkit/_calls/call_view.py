"""What a future sees of its call, while that runs and when it is over."""

from __future__ import annotations

import uuid
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

from actionkit._goal.facts import GoalFacts
from actionkit._model.timeline import Recorder
from actionkit._model.values import GoalFate, GoalReport, GoalState

_KEPT = 100
"""How many goals of a call that do not run any more are kept, for `Outcome.goals`."""


class GoalsOfCall:
    """The goals of a call that were sent: each that may run, and the last of the others.

    Written by one thread, read by any.
    """

    def __init__(self, goals: Iterable[GoalFacts] = ()) -> None:
        self._goals = list(goals)

    def add(self, goal: GoalFacts) -> None:
        """Take in one that was sent."""
        over = [each for each in self._goals if not each.may_run]
        forgotten = [goal, *over[: -(_KEPT - 1)]]
        goals = [each for each in self._goals if not any(each is one for one in forgotten)]
        self._goals = [*goals, goal]

    @property
    def _left(self) -> list[GoalFacts]:
        return [goal for goal in self._goals if goal.may_run]

    @property
    def reports(self) -> tuple[GoalReport, ...]:
        """What is known of each, oldest first (C2.8)."""
        return tuple(goal.report for goal in self._goals)

    @property
    def may_run(self) -> tuple[uuid.UUID, ...]:
        """The ids of those that may run, oldest first (C2.8)."""
        return tuple(goal.goal_id for goal in self._left)

    @property
    def gone(self) -> bool:
        """Whether each that may run was lost with a server that has left the graph."""
        return all(goal.fate is GoalFate.LOST and goal.gone for goal in self._left)

    def left(self) -> GoalsOfCall:
        """Return those that may run."""
        return GoalsOfCall(self._left)

    def tell(self) -> None:
        """Note that their user has been told of those that may run."""
        for goal in self._left:
            goal.told = True

    @property
    def known_to_run(self) -> bool | None:
        """True if a goal is known to run, False if none runs any more; else `None`."""
        known = {goal.known_to_run for goal in self._goals}
        return True if True in known else None if None in known else False


class CallView(Protocol):
    """What a future needs of its call."""

    goals: GoalsOfCall
    state: GoalState
    timeline: Recorder
    cancel_grace: float

    @property
    def goal_id(self) -> uuid.UUID:
        """The id of the goal being tried, or of the one that is told of."""
        ...

    def request_cancel(self) -> None:
        """Cancel soon. From any thread; never blocks."""


@dataclass
class CallIsOver:
    """The few facts of a call that is over, so that its future need not hold the call itself.

    The two would refer to each other, and a result would not be freed when the last reference to
    the future goes, but only at some later garbage collection.
    """

    goals: GoalsOfCall
    goal_id: uuid.UUID
    state: GoalState
    timeline: Recorder
    cancel_grace: float

    def request_cancel(self) -> None:
        """Do nothing: it is too late."""
