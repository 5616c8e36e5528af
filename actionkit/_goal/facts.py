"""The facts about one goal id, and what follows from them: whether it may run, and its fate.

Facts are only added. Whoever has to know whether a goal may run asks here, and nobody else decides.
"""

from __future__ import annotations

import uuid
from dataclasses import dataclass
from enum import Enum


class Fate(str, Enum):
    """What is known of a goal."""

    NOT_SENT = "NOT_SENT"
    UNANSWERED = "UNANSWERED"
    """A request for it has not been answered: it may be accepted yet (R6)."""
    RUNNING = "RUNNING"
    REJECTED = "REJECTED"
    """Each request for it was answered "no"."""
    ENDED = "ENDED"
    LOST = "LOST"
    """It may run, and no server that it was sent to is in sight."""
    LEFT = "LEFT"
    """It may run, and nobody looks after it any more."""


@dataclass(slots=True)
class GoalFacts:
    """What is known of one goal id. Written by the communication thread, read by any.

    Attributes:
        goal_id: The id, or `None` before it has one.
        requests: How many requests for it were sent; all to the same server (R5).
        noes: How many of them were answered "no". A duplicate is answered so, too.
        accepted: Whether a server has shown that it has it.
        ended: Whether a server has shown that it does not run it any more.
        lost: Whether the server that it was sent to is out of sight.
        gone: Whether that server had left the graph when the goal was lost, and not only fallen
            silent, or been taken for one that another has replaced.
        left: Whether nobody looks after it any more.
    """

    goal_id: uuid.UUID | None = None
    requests: int = 0
    noes: int = 0
    accepted: bool = False
    ended: bool = False
    lost: bool = False
    gone: bool = False
    left: bool = False

    @property
    def may_run(self) -> bool:
        """Whether it may run, or be accepted yet (C2.8)."""
        return not self.ended and (self.accepted or self.noes < self.requests)

    @property
    def known_to_run(self) -> bool | None:
        """Whether a server has it and has not ended it; `None` where that is not known."""
        if not self.may_run:
            return False
        return True if self.accepted and not (self.lost or self.left) else None

    @property
    def fate(self) -> Fate:
        """The same in a word."""
        if not self.requests:
            return Fate.NOT_SENT
        if not self.may_run:
            return Fate.ENDED if self.ended else Fate.REJECTED
        if self.left or self.lost:
            return Fate.LEFT if self.left else Fate.LOST
        return Fate.RUNNING if self.accepted else Fate.UNANSWERED
