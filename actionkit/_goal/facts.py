"""Keeps the facts about one goal, and derives from them whether it may run, and its fate.

Code that has to know whether a goal may run asks here; nothing else decides. Most facts are only
added. But an acceptance may come after the goal seemed to be over, and a lost server may come back.
"""

from __future__ import annotations

import uuid
from dataclasses import dataclass

from actionkit._model.values import GoalFate, GoalReport


@dataclass(slots=True)
class GoalFacts:
    """What is known about a goal that was sent. The communication thread writes, any reads."""

    goal_id: uuid.UUID
    servers: int = 1  # how many may have got the one request for it; nearly always one
    away: int = 0  # how many of these have left the graph
    noes: int = 0  # rejections
    yeses: int = 0  # acceptances: each is from a server that runs the goal, or did
    accepted: bool = False  # a server has shown that it has the goal
    ends: int = 0  # how many servers have reported its end
    ended: bool = False  # one of them has: then it is over for its caller
    rejected: bool = False  # it is over for its caller because a server rejected it
    over: bool = False  # each server that may have got it is known not to run it
    given_up: bool = False  # its caller gave up on it before it was over for the caller
    lost: bool = False  # its server seems to be gone, which may be a guess
    servers_gone: bool = False  # each server that may run it has left the graph, which is a fact
    left: bool = False  # nobody tracks it any more
    refused: bool = False  # the server refused the last cancel request
    user_knows: bool = False  # the user was told that it may run
    others_cancel: bool = False  # it was CANCELING before we had asked for that (C4.4)
    attached: bool = False  # somebody else has sent it, so no server answers us whether it accepts

    @property
    def undecided(self) -> bool:
        """Whether one of several servers has not answered yet whether it accepts the goal."""
        answers = self.yeses + self.noes
        shown = max(self.yeses, self.ends)
        return shown < self.servers > 1 and answers < self.servers and not self.attached

    @property
    def runs_seen(self) -> bool:
        """Whether a server has shown that it has the goal, but not that it has ended it."""
        return max(self.yeses, int(self.accepted)) > self.ends

    @property
    def is_over(self) -> bool:
        """Whether it is certain that no server runs it or will accept it.

        Users are told `known_to_run`, which leaves out what is only a guess.
        """
        return self.over or not (self.accepted or self.noes < self.servers)

    @property
    def is_lost_with_server(self) -> bool:
        """Whether it was lost, and its servers have left the graph: nobody may ever hear of it.

        A server that is only silent, or only seems to have been replaced, may go on with it. So
        this, and not `lost`, decides whether another goal may be sent.
        """
        return self.lost and self.servers_gone and not self.left

    def blocks_another(self, *, unless_gone: bool = False, unless_unseen: bool = False) -> bool:
        """Whether no other goal may be sent now (C4.2). Each who may send one asks this.

        `docs/architecture.md` has a table of those who ask, and why they differ.

        Args:
            unless_gone: It does not block if each server that may run it has left the graph.
            unless_unseen: It does not block if one server's answer has ended it, and another one
                has never shown that it has it.
        """
        if self.is_over or (unless_gone and self.is_lost_with_server):
            return False
        return self.may_run or not unless_unseen

    @property
    def may_run(self) -> bool:
        """Whether it may run, or may still be accepted, as the user is told (C2.8).

        If one server's answer has ended it for its caller, a second server that has never shown
        that it has the goal does not count: naming the goal would only be a guess. It does count if
        the caller gave up on the goal, because the caller relies on the cancellation, or if
        somebody else has sent the goal: then no server says whether it has accepted it.
        """
        if self.is_over:
            return False
        if self.attached or not (self.ended or self.rejected):
            return True
        return self.runs_seen or (self.given_up and self.undecided)

    @property
    def known_to_run(self) -> bool | None:
        """Whether a server has it and has not ended it; `None` if that is not known."""
        if not self.may_run:
            return False
        return True if self.runs_seen and not (self.lost or self.left) else None

    @property
    def fate(self) -> GoalFate:
        """The same as one value."""
        if not self.may_run:
            return GoalFate.ENDED if self.ended else GoalFate.REJECTED
        if self.left or self.lost:
            return GoalFate.LEFT if self.left else GoalFate.LOST
        return GoalFate.RUNNING if self.runs_seen else GoalFate.UNANSWERED

    @property
    def report(self) -> GoalReport:
        """What the user is told about it."""
        return GoalReport(self.goal_id, self.fate, cancel_refused=self.refused)
