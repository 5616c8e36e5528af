"""What a future sees of its call, while that runs and when it is over."""

from __future__ import annotations

import uuid
from dataclasses import dataclass
from typing import Protocol

from actionkit._model.timeline import Recorder
from actionkit._model.values import GoalState


class CallView(Protocol):
    """What a future needs of its call."""

    goal_id: uuid.UUID
    state: GoalState
    timeline: Recorder
    cancel_grace: float

    def request_cancel(self) -> None:
        """Cancel soon. From any thread; never blocks."""


@dataclass
class CallIsOver:
    """The few facts of a call that is over, so that its future need not hold the call itself.

    The two would refer to each other, and a result would not be freed when the last reference to
    the future goes, but only at some later garbage collection.
    """

    goal_id: uuid.UUID
    state: GoalState
    timeline: Recorder
    cancel_grace: float

    def request_cancel(self) -> None:
        """Do nothing: it is too late."""
