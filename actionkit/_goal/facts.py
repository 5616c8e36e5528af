"""The facts about one goal id, and what follows from them: whether it may run, and its fate.

Facts are only added. Whoever has to know whether a goal may run asks here, and nobody else decides.
"""

from __future__ import annotations

import uuid
from dataclasses import dataclass

from actionkit._model.values import GoalFate, GoalReport


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
        refused: Whether the server has refused to cancel it, the last time that it was asked.
        told: Whether its user has been told that it may run.
    """

    goal_id: uuid.UUID | None = None
    requests: int = 0
    noes: int = 0
    accepted: bool = False
    ended: bool = False
    lost: bool = False
    gone: bool = False
    left: bool = False
    refused: bool = False
    told: bool = False

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
    def fate(self) -> GoalFate | None:
        """The same in a word; `None` where no request was sent."""
        if not self.requests:
            return None
        if not self.may_run:
            return GoalFate.ENDED if self.ended else GoalFate.REJECTED
        if self.left or self.lost:
            return GoalFate.LEFT if self.left else GoalFate.LOST
        return GoalFate.RUNNING if self.accepted else GoalFate.UNANSWERED

    @property
    def report(self) -> GoalReport | None:
        """What its user is told of it; `None` where no request was sent."""
        if self.goal_id is None or (fate := self.fate) is None:
            return None
        return GoalReport(self.goal_id, fate, cancel_refused=self.refused)
