"""Defines where a goal is, why it is cancelled, their texts, and the times between requests."""

from __future__ import annotations

from enum import Enum, auto

from actionkit._goal.effects import End
from actionkit._model.values import GoalState

FIRST_REASK = 1.0
"""Seconds until a request is repeated, because it or its answer may have been lost: nearly all
answers come within a second. Each further pause is twice as long."""
LONG_PAUSE = 8.0
"""From this pause on, in seconds, the result of a goal that only takes long is requested, too. The
status topic shows such a goal, and only goals that run for more than 7 s reach this pause."""
LONGEST_PAUSE = 30.0
"""The longest pause, in seconds: two small requests a minute cost nothing, even for hours."""
LONGEST_RESULT_PAUSE = 4.0
"""The same for a goal that has ended: somebody waits for its result, and that may expire."""
LAST_UNKNOWN_PAUSE = 300.0
"""Pause, in seconds, after which a goal is forgotten if its request was never answered and its
server has always answered that it does not know the goal. The server has dropped the request. By
then, 14 minutes have passed since the caller left, and a live server has read all requests."""
LAST_RESULT_PAUSE = 4.0
"""Pause, in seconds, after which nobody requests the result of a goal that has ended if its caller
has left. By then it was requested at least three times."""
CONFIRMED_AFTER = 0.3
"""Seconds until a server is asked again if it refused to cancel a goal, or does not know a goal
that it has accepted. rclpy's servers answer both also for a goal that they are just accepting, and
they refuse also if it has just ended (R12). Then the second answer, or the result, shows that; a
server that is not busy sends both within 0.3 s."""

LATE_ACCEPTANCE = 9.0
"""Seconds in which a busy server may still accept a goal that a process sent just before it ended.
The server is asked again and again: after this pause, and those before it, it is 9.3 s."""


class Stage(Enum):
    """Where the goal is, according to what we know."""

    SENT = auto()
    ACCEPTED = auto()
    ANOTHER_MAY_RUN = auto()
    """It is over on one server, but another one on the name may run it: it is cancelled there."""
    LOST = auto()
    """The server is out of sight, and the goal may still run there; or it is back, which clears
    `facts.lost`, and has not answered yet whether it still has the goal."""
    OVER = auto()
    """It is not tracked any more: it does not run, or is left alone."""


class CancelReason(Enum):
    """Why the caller no longer wants the goal."""

    CANCELLED = auto()
    DEADLINE = auto()
    UNANSWERED = auto()
    STALLED = auto()
    CLOSED = auto()


class CancelReply(Enum):
    """The server's answer to our request to cancel the goal."""

    NONE = auto()
    REFUSED_ONCE = auto()
    """It is asked a second time, because the refusal may not be final (R12)."""
    REFUSED = auto()
    """The refusal is believed: the goal runs on."""
    ACCEPTED = auto()
    """Final: the server cannot refuse any more."""


END_AFTER = {
    # After the caller's own cancel: only if it was not confirmed in time.
    CancelReason.CANCELLED: End.DEADLINE,
    CancelReason.DEADLINE: End.DEADLINE,
    CancelReason.UNANSWERED: End.NO_ACCEPTANCE,
    CancelReason.STALLED: End.STALLED,
    CancelReason.CLOSED: End.CLOSED,
}
"""How an attempt ends if its caller gave up before its goal ended."""
FINAL = (CancelReason.DEADLINE, CancelReason.CLOSED)
"""The reasons after which nobody waits for the goal, even if the server refuses to cancel it."""
WITH_END = {End.SUCCEEDED, End.ABORTED, End.CANCELED_BY_OTHER, End.RESULT_LOST}
"""The endings of attempts with a goal that ended by itself."""
RANK = {GoalState.ACCEPTED: 1, GoalState.EXECUTING: 2, GoalState.CANCELING: 3}
"""The order of the states of a running goal; it never returns to a lower one."""
WAITED_FOR = {
    CancelReason.DEADLINE: "the result",
    CancelReason.UNANSWERED: "acceptance",
    CancelReason.STALLED: "feedback",
}
"""What did not come in time, if the goal was cancelled because of that."""
