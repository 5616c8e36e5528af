"""The facts about one goal id, and what follows from them: whether it may run, and its fate.

Facts are only added. Code that has to know whether a goal may run asks here; nothing else decides.
"""

from __future__ import annotations

import uuid
from dataclasses import dataclass

from actionkit._model.values import GoalFate, GoalReport


@dataclass(slots=True)
class GoalFacts:
    """What is known of one goal that was sent. Written by the communication thread, read by any.

    Attributes:
        goal_id: The id.
        servers: How many servers may have got the one request for it; nearly always one.
        away: How many of those are out of sight.
        noes: How many answers were "no".
        yeses: How many were "yes": each is a server that runs it, or did.
        accepted: Whether a server has shown that it has it.
        ends: How many servers have told that it has ended there.
        ended: Whether one has. It is over for its caller then.
        rejected: Whether it is over for its caller because a server rejected it.
        over: Whether every server that may have got it is known not to run it.
        given_up: Whether its caller gave up on it before it was over for him.
        lost: Whether the server that it was sent to is out of sight.
        gone: Whether that server had left the graph when the goal was lost, and not only fallen
            silent, or been taken for one that another has replaced.
        left: Whether nobody looks after it any more.
        refused: Whether the server has refused to cancel it, the last time that it was asked.
        told: Whether its user has been told that it may run.
    """

    goal_id: uuid.UUID
    servers: int = 1
    away: int = 0
    noes: int = 0
    yeses: int = 0
    accepted: bool = False
    ends: int = 0
    ended: bool = False
    rejected: bool = False
    over: bool = False
    given_up: bool = False
    lost: bool = False
    gone: bool = False
    left: bool = False
    refused: bool = False
    told: bool = False

    @property
    def undecided(self) -> bool:
        """Whether one of several servers has not said yet whether it takes the goal."""
        answers = self.yeses + self.noes
        shown = max(self.yeses, self.ends)
        return shown < self.servers > 1 and answers < self.servers

    @property
    def runs_seen(self) -> bool:
        """Whether a server has shown that it has it, and not that it has ended it."""
        return max(self.yeses, int(self.accepted)) > self.ends

    @property
    def is_over(self) -> bool:
        """Whether it is sure that no server runs it, or accepts it yet.

        This decides whether the same work may be sent again (C4.2).
        """
        return self.over or not (self.accepted or self.noes < self.servers)

    @property
    def may_run(self) -> bool:
        """Whether it may run, or be accepted yet, as far as its user is told (C2.8).

        If one server's answer has ended it for its caller, another one that has never shown that it
        has the goal does not count: to name it would only be a guess. It does count if the caller
        gave up on the goal, because the caller relies on the cancellation.
        """
        if self.is_over:
            return False
        if not (self.ended or self.rejected):
            return True
        return self.runs_seen or (self.given_up and self.undecided)

    @property
    def known_to_run(self) -> bool | None:
        """Whether a server has it and has not ended it; `None` where that is not known."""
        if not self.may_run:
            return False
        return True if self.runs_seen and not (self.lost or self.left) else None

    @property
    def fate(self) -> GoalFate:
        """The same in a word."""
        if not self.may_run:
            return GoalFate.ENDED if self.ended else GoalFate.REJECTED
        if self.left or self.lost:
            return GoalFate.LEFT if self.left else GoalFate.LOST
        return GoalFate.RUNNING if self.runs_seen else GoalFate.UNANSWERED

    @property
    def report(self) -> GoalReport:
        """What its user is told of it."""
        return GoalReport(self.goal_id, self.fate, cancel_refused=self.refused)
