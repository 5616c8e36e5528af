"""What a future needs to know about its call, while it runs and when it is over."""

from __future__ import annotations

import uuid
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Protocol

from actionkit._goal.facts import GoalFacts
from actionkit._model.timeline import Recorder
from actionkit._model.values import GoalReport, GoalState
from actionkit._threads.function_runner import Scheduler

_KEPT = 100
"""How many goals that do not run any more a call keeps, for `Outcome.goals`."""


class GoalsOfCall:
    """The goals that a call has sent: all that may run, and the latest of the others.

    One thread writes them, any thread reads them.
    """

    def __init__(self, goals: Iterable[GoalFacts] = ()) -> None:
        self._goals = list(goals)

    def add(self, goal: GoalFacts) -> None:
        """Add a goal that was sent."""
        over = [each for each in self._goals if not each.may_run]
        forgotten = [goal, *over[: -(_KEPT - 1)]]
        goals = [each for each in self._goals if not any(each is one for one in forgotten)]
        goals = [each for each in goals if each.goal_id != goal.goal_id]
        self._goals = [*goals, goal]

    @property
    def facts_left(self) -> list[GoalFacts]:
        """What is known about the goals that may run."""
        return [goal for goal in self._goals if goal.may_run]

    @property
    def reports(self) -> tuple[GoalReport, ...]:
        """What is known about each goal, oldest first (C2.8)."""
        return tuple(goal.report for goal in self._goals)

    @property
    def may_run(self) -> tuple[uuid.UUID, ...]:
        """The ids of the goals that may run, oldest first (C2.8)."""
        return tuple(goal.goal_id for goal in self.facts_left)

    def block_another(self, **unless: bool) -> bool:
        """Whether no other goal may be sent beside them, as in `GoalFacts.blocks_another`."""
        return any(goal.blocks_another(**unless) for goal in self._goals)

    @property
    def accepted(self) -> bool:
        """Whether a server has shown that it has, or had, one of them."""
        return any(goal.accepted for goal in self._goals)

    @property
    def others_cancel(self) -> bool:
        """Whether somebody else was seen to cancel one of them (C4.4)."""
        return any(goal.others_cancel for goal in self._goals)

    def left(self) -> GoalsOfCall:
        """Return the goals that are not known to have stopped."""
        return GoalsOfCall(goal for goal in self._goals if not goal.is_over)

    def tell(self) -> None:
        """Record that the user knows about the goals that may run."""
        for goal in self.facts_left:
            goal.user_knows = True

    @property
    def user_knows(self) -> bool:
        """Whether the user knows about each goal that may run."""
        return all(goal.user_knows for goal in self.facts_left)

    @property
    def known_to_run(self) -> bool | None:
        """True if a goal is known to run, False if all are known not to run; else `None`."""
        known = {goal.known_to_run for goal in self._goals}
        return True if True in known else None if None in known else False


class GoalsKeeper(Scheduler, Protocol):
    """What a future needs of its session."""

    action_name: str

    def cancel_again(self, goal_ids: tuple[uuid.UUID, ...]) -> None: ...


class CallView(Protocol):
    """What a future needs to know about its call."""

    goals: GoalsOfCall
    state: GoalState
    timeline: Recorder
    cancel_grace: float
    left_alone: bool

    @property
    def to_replace(self) -> tuple[Any, ...]:
        """The futures of the calls with goals that this one was to replace, and that may run."""
        ...

    @property
    def goal_id(self) -> uuid.UUID:
        """The id of the current goal, or of the goal that the outcome describes."""
        ...

    def request_cancel(self) -> None:
        """Cancel soon. From any thread; never blocks."""

    def replace_by(self, call: Any) -> None:
        """Count as replaced if the goal stops now. On the communication thread."""


@dataclass
class CallIsOver:
    """The few facts that a future keeps about its call when it is over.

    If the future kept the call, the two would refer to each other. Then the result would not be
    freed with the last reference to the future, but at some later garbage collection.
    """

    goals: GoalsOfCall
    goal_id: uuid.UUID
    state: GoalState
    timeline: Recorder
    cancel_grace: float
    to_replace: tuple[Any, ...]
    session: GoalsKeeper
    left_alone: bool = False

    def request_cancel(self) -> None:
        """Ask once more to cancel the goals that may run. From any thread; never blocks."""
        if left := self.goals.may_run:
            self.session.cancel_again(left)

    def replace_by(self, call: Any) -> None:
        """Do nothing: it is too late."""
