"""Where a goal is, why it is given up on, and the words for both."""

from __future__ import annotations

from enum import Enum, auto

from actionkit._effects import End
from actionkit._values import GoalState


class Stage(Enum):
    """Where the goal is, as far as this side knows."""

    NEW = auto()
    AWAITING_SERVER = auto()
    QUEUED = auto()
    SENT = auto()
    ACCEPTED = auto()
    LOST = auto()
    """The server is gone from view; the goal may run on where it cannot be seen."""
    OVER = auto()
    """Known to run no more, or never to have been sent."""


class GaveUp(Enum):
    """Why the caller no longer wants the goal."""

    CANCELLED = auto()
    DEADLINE = auto()
    UNANSWERED = auto()
    STALLED = auto()
    CLOSED = auto()


PHASE = {
    Stage.NEW: "server",
    Stage.AWAITING_SERVER: "server",
    Stage.QUEUED: "accept",
    Stage.SENT: "accept",
    Stage.ACCEPTED: "execute",
    Stage.LOST: "execute",
    Stage.OVER: "execute",
}
GAVE_UP_END = {
    # The caller's own cancel only ends this way where it could not be confirmed in time.
    GaveUp.CANCELLED: End.DEADLINE,
    GaveUp.DEADLINE: End.DEADLINE,
    GaveUp.UNANSWERED: End.NO_ACCEPTANCE,
    GaveUp.STALLED: End.STALLED,
    GaveUp.CLOSED: End.CLOSED,
}
RANK = {GoalState.ACCEPTED: 1, GoalState.EXECUTING: 2, GoalState.CANCELING: 3}
WAITED_FOR = {
    GaveUp.DEADLINE: "the result",
    GaveUp.UNANSWERED: "acceptance",
    GaveUp.STALLED: "feedback",
}
