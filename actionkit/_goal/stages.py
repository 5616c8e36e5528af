"""Where a goal is, why it is given up on, the words for both, and how long is waited for what."""

from __future__ import annotations

from enum import Enum, auto

from actionkit._goal.effects import End
from actionkit._model.values import GoalState

FIRST_NUDGE = 1.0
"""Seconds until something that may have been lost on the way is asked for again."""
RARELY = 8.0
"""Pause from which on a goal that merely takes long is asked about, too."""
MAX_NUDGE = 30.0
MAX_RESULT_NUDGE = 4.0
"""The longest pause, in seconds, between two requests for the result of a goal that has ended."""
NOBODY_WAITS = 4.0
"""Pause, the fourth, after which nobody asks any more for the result of a goal that has ended and
whose caller is gone."""
DOUBT = 0.3
"""Seconds until a server that refused to cancel a goal, or does not know one that it has accepted,
is asked once more. rclpy's servers say both of a goal that they are just accepting, too, and refuse
in the same words where it has just ended (R12); then the second answer, or the result, says so."""


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
WITH_END = {End.SUCCEEDED, End.ABORTED, End.CANCELED_BY_OTHER, End.RESULT_LOST}
"""The ends of calls whose goal came to an end of its own."""
RANK = {GoalState.ACCEPTED: 1, GoalState.EXECUTING: 2, GoalState.CANCELING: 3}
WAITED_FOR = {
    GaveUp.DEADLINE: "the result",
    GaveUp.UNANSWERED: "acceptance",
    GaveUp.STALLED: "feedback",
}
