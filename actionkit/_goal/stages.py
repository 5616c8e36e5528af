"""Where a goal is, why it is cancelled, the words for both, and how long is waited for what."""

from __future__ import annotations

from enum import Enum, auto

from actionkit._goal.effects import End
from actionkit._model.values import GoalState

FIRST_REASK = 1.0
"""Seconds until something that may have been lost on the way is asked for again, because nearly
all answers come within a second. Each further pause is twice as long."""
LONG_PAUSE = 8.0
"""Pause, in seconds, from which on a goal that only takes long is asked about, too. The status
topic shows such a goal, and only goals that run for more than 7 s get to this pause."""
LONGEST_PAUSE = 30.0
"""The longest pause, in seconds: two small requests a minute cost nothing, also for hours."""
LONGEST_RESULT_PAUSE = 4.0
"""The same for a goal that has ended: somebody waits for its result, and the result may expire."""
LAST_UNKNOWN_PAUSE = 300.0
"""Pause, in seconds, after which a goal is forgotten if its request was never answered, while its
server answers each time that it does not know the goal. The server has dropped the request. That
is 14 minutes after the caller has gone; a server that answers has read all requests by then."""
LAST_RESULT_PAUSE = 4.0
"""Pause, in seconds, after which the result of a goal that has ended is no longer asked for when
its caller has gone. By then it was asked for at least three times."""
DOUBT = 0.3
"""Seconds until a server that refused to cancel a goal, or does not know one that it has accepted,
is asked once more. rclpy's servers say both of a goal that they are just accepting, too, and refuse
in the same words where it has just ended (R12). Then the second answer, or the result, says so;
0.3 s is enough for both to come from a server that is not busy."""


class Stage(Enum):
    """Where the goal is, as far as this side knows."""

    SENT = auto()
    ACCEPTED = auto()
    ELSEWHERE = auto()
    """Over on one server, and another on the same name may run it: it is cancelled there."""
    LOST = auto()
    """The server is gone from view; the goal may run on where it cannot be seen."""
    OVER = auto()
    """It is not followed any more: it does not run, or is left alone."""


class CancelReason(Enum):
    """Why the caller no longer wants the goal."""

    CANCELLED = auto()
    DEADLINE = auto()
    UNANSWERED = auto()
    STALLED = auto()
    CLOSED = auto()


class CancelReply(Enum):
    """What the server says to our wish that the goal be cancelled."""

    NONE = auto()
    REFUSED_ONCE = auto()
    """It is asked a second time, because it may not have meant it (R12)."""
    REFUSED = auto()
    """The refusal is believed: the goal runs on."""
    ACCEPTED = auto()
    """For good: the server cannot refuse any more."""


class Closing(Enum):
    """Why this side stops taking care of the goal, where it does."""

    CANCELLING = auto()
    """The client closes, and cancels what is in flight."""
    ABANDONED = auto()
    """The client closed, and left the goal to run, as its user had said."""
    BROKEN = auto()
    """This side failed, and cannot follow the goal any more."""


PHASE = {
    Stage.SENT: "accept",
    Stage.ACCEPTED: "execute",
    Stage.ELSEWHERE: "execute",
    Stage.LOST: "execute",
    Stage.OVER: "execute",
}
"""What is being waited for, in the words of `DeadlineExceededError.phase`."""
END_AFTER = {
    # The caller's own cancel ends this way only where it could not be confirmed in time.
    CancelReason.CANCELLED: End.DEADLINE,
    CancelReason.DEADLINE: End.DEADLINE,
    CancelReason.UNANSWERED: End.NO_ACCEPTANCE,
    CancelReason.STALLED: End.STALLED,
    CancelReason.CLOSED: End.CLOSED,
}
"""How an attempt ends if it was given up on before its goal ended."""
WITH_END = {End.SUCCEEDED, End.ABORTED, End.CANCELED_BY_OTHER, End.RESULT_LOST}
"""The ends of attempts if the goal came to an end of its own."""
RANK = {GoalState.ACCEPTED: 1, GoalState.EXECUTING: 2, GoalState.CANCELING: 3}
"""The order of the states in which a goal goes on; a goal never goes back to a lower one."""
WAITED_FOR = {
    CancelReason.DEADLINE: "the result",
    CancelReason.UNANSWERED: "acceptance",
    CancelReason.STALLED: "feedback",
}
"""What did not come in time, where the goal was cancelled for that."""
