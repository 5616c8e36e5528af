"""Decides which goals to ask a server to cancel, and what happened to each. No clock, no ROS."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from actionkit._model.cancel_answer import CancelAnswer
from actionkit._model.values import CancelReport
from actionkit._ros.others_goals.goal_board import FIRST, Board, WatchedGoal

_AGAIN = 1.0
"""Seconds after which a request without an answer counts as lost and is repeated. This is harmless:
a goal is cancelled only once."""
_SINGLY = 0.5
"""Seconds after the answer until a goal must be seen as canceling. Otherwise it is cancelled by its
id: after each goal that an rclpy server refuses to cancel, it skips the next goal, but answers that
it is cancelling it (`list.remove` in a loop over that list)."""
_SETTLE = 1.0
"""Seconds to wait after a refusal or "unknown goal", because more news may come: the goal's end (if
a goal ends at the same time, a server answers like a refusal), or another server's answer."""
_REJECTED = 1
"""The return code `ERROR_REJECTED` of `action_msgs/srv/CancelGoal`."""
_BEST = (
    CancelAnswer.ACCEPTED,
    CancelAnswer.TERMINATED,
    CancelAnswer.REFUSED,
    CancelAnswer.UNKNOWN_GOAL,
)
"""If several servers answer about one goal, the first of these counts."""


@dataclass(frozen=True)
class Fate:
    """What happened to a goal."""

    goal_id: str  # with dashes
    cancel: str  # the name of a `CancelReport`, or `"NO_SUCH_GOAL"`
    state: str  # the last state that was seen, or `""`
    text: str  # the same as a sentence

    @property
    def report(self) -> CancelReport:
        """The report for programs; a goal that no server knows need not be cancelled."""
        return CancelReport.__members__.get(self.cancel, CancelReport.NOT_NEEDED)


@dataclass
class _Target:
    asked: float | None = None
    """When the first request to cancel it was sent, alone or with all."""
    singly: bool = False
    """Whether it is being cancelled by its id."""
    answer: CancelAnswer | None = None
    since: float = 0.0
    """When that answer came, or it was asked again after that."""
    again: bool = False
    """Whether it was asked again some time after a server answered."""
    unknown: Counter[int] = field(default_factory=Counter)
    """How many servers have answered each request by saying that they do not know it."""
    consents: int = 0
    """How many answers say that it is being cancelled: each server that has it gives one."""
    fate: Fate | None = None


class Cancelling:
    """The goals of one action that are to be cancelled, and what is known about them."""

    def __init__(
        self, name: str, goal_ids: Iterable[str] | None = None, *, may_come: bool = False
    ) -> None:
        """Begin.

        Args:
            name: Of the action.
            goal_ids: The goals to cancel; `None` means all.
            may_come: Whether goals that no server knows may have been sent, and be accepted yet.
        """
        self.name = name
        self._may_come = may_come
        self.board = Board(most=math.inf)  # a goal that is left out would have no known end
        self.servers: tuple[str, ...] = ()
        """The nodes of all servers that were seen, except those not known by name yet."""
        self._most = 0
        """The most servers that were seen at the same time; one node may have several."""
        self.answers = 0
        """How many answers have come."""
        self.every = goal_ids is None
        """Whether all goals are cancelled."""
        self._targets = {goal_id: _Target() for goal_id in goal_ids or ()}
        self.waits_for_status = FIRST
        """Seconds to wait for a status before goals are cancelled by their ids."""
        self._looks_since: float | None = None
        self._number = 0
        self._at = 0.0
        self._want = self.every
        self._first = 1
        """The number of the first request since there was a reason for one. Later requests repeat
        it; an answer to any of them is enough."""
        self._answers: Counter[int] = Counter()
        """How many servers have answered each request."""
        self._consents: Counter[int] = Counter()
        """How many of them have not answered with an error."""
        self._codes: set[int] = set()
        """These errors."""

    # --- what happens ----------------------------------------------------------------------

    def seen(self, servers: Sequence[str]) -> None:
        """Record the servers of the action; servers that have gone are remembered."""
        new = {name for name in servers if name} - set(self.servers)
        if new or len(servers) > self._most:
            self.once_more()  # a new one has had no request
        self._most = max(self._most, len(servers))
        self.servers = tuple(sorted(new | set(self.servers)))

    @property
    def has_server(self) -> bool:
        """Whether a server was seen, even if its node is not known yet."""
        return self._most > 0

    def take_news(self, news: Any, wall: float) -> list[WatchedGoal]:
        """Record news from a `StatusReader`; return the goals with a new state."""
        return self.board.take(news, wall)[0]

    def add(self, goal_id: str, *, runs: bool = False) -> None:
        """Cancel this goal, too. One that is seen to run is cancelled again if it was settled."""
        target = self._targets.setdefault(goal_id, _Target())
        if runs and target.fate is not None:
            self._targets[goal_id] = _Target(consents=target.consents)

    def agreed(self, goal_id: str) -> bool:
        """Whether a server has agreed to cancel a goal: it was running then."""
        return self._targets[goal_id].consents > 0

    def may_come(self, goal_id: str, now: float) -> bool:
        """Whether a goal that no server knows may be accepted yet, or be on one not seen yet."""
        return self._may_come

    def take_all(self, said: Any, now: float) -> None:
        """Record an `AllSaid`, about all goals; `now` is on the monotonic clock."""
        self.answers += 1
        self._answers[said.request] += 1
        self._consents[said.request] += not said.code
        self._codes |= {said.code} - {0}
        for goal_id in said.canceling:
            self._targets.setdefault(goal_id, _Target(asked=now)).consents += 1

    def take(self, said: Any, now: float) -> None:
        """Record a `CancelSaid`, about one goal; `now` is on the monotonic clock."""
        self.answers += 1
        target = self._targets[said.goal_id]
        target.consents += said.answer is CancelAnswer.ACCEPTED
        target.unknown[said.request] += said.answer is CancelAnswer.UNKNOWN_GOAL
        if target.answer is None or _BEST.index(said.answer) < _BEST.index(target.answer):
            target.answer, target.since = said.answer, now

    def once_more(self) -> None:
        """Ask the servers again: they may have accepted goals in the meantime."""
        self._want = self.every

    # --- what is to be done ----------------------------------------------------------------

    def to_ask(self, now: float) -> int | None:
        """Return the number of a request to send now for all goals, or `None`."""
        if not self.every:
            return None
        lost = self._number and self._waits_for_answers and now - self._at >= _AGAIN
        reason = self._want or bool(self._running - self._targets.keys())
        if not (reason or lost):
            return None
        self._want = False
        self._number += 1
        self._at = now
        if reason:
            self._first = self._number
        for goal_id in self._running:
            self._targets.setdefault(goal_id, _Target(asked=now))
        return self._number

    @property
    def _running(self) -> set[str]:
        return {goal.goal_id for goal in self.board.goals.values() if not goal.ended}

    def has_looked(self, now: float) -> bool:
        """Return whether a status has come, or it was waited for since the first call."""
        if self._looks_since is None:
            self._looks_since = now
        return bool(self.board.goals) or self.looks_for(now) >= self.waits_for_status

    def looks_for(self, now: float) -> float:
        """Return the seconds since the first call of `has_looked`."""
        return 0.0 if self._looks_since is None else now - self._looks_since

    def _has_looked_long(self, now: float) -> bool:
        return self.looks_for(now) >= FIRST

    def to_ask_singly(self, now: float) -> list[str]:
        """Return the goals to cancel by their ids now, each once."""
        if not self.has_looked(now) and not self.every:
            return []
        new = []
        for goal_id, target in self._targets.items():
            goal = self.board.goals.get(goal_id)
            if target.singly or (goal is not None and goal.ended):
                continue
            if target.asked is not None:
                stopping = goal is not None and goal.state == "CANCELING"
                if stopping or not self.answers or now - target.asked < _SINGLY:
                    continue
            target.singly = True
            target.asked = now if target.asked is None else target.asked
            new.append(goal_id)
        new.sort(key=lambda goal_id: goal_id not in self.board.goals)  # first those that run
        return new + self._to_ask_again(now)

    def _to_ask_again(self, now: float) -> list[str]:
        """Return the goals that a server has answered about, and that are not seen to stop.

        They may have been accepted after that, or by another server. Or the server shows no status,
        as that of micro-ROS: it answers that it does not know a goal which has ended.
        """
        new = []
        for goal_id, target in self._targets.items():
            goal = self.board.goals.get(goal_id)
            # micro-ROS' server calls a goal ended that it is just accepting.
            known = target.consents or target.answer is CancelAnswer.TERMINATED
            silent = goal is None and known and self._has_looked_long(now)
            runs = goal is not None and not goal.ended and goal.state != "CANCELING"
            answered = target.answer not in (None, CancelAnswer.REFUSED)
            if (silent or (runs and answered)) and now - target.since >= _AGAIN:
                target.since, target.again = now, True
                target.unknown.clear()  # only the answers from now on count
                new.append(goal_id)
        return new

    def settle(self, now: float, *, over: bool) -> list[Fate]:
        """Return the fates that are new since the last call; `now` is on the monotonic clock.

        `over` means that the wait has ended: every goal has a fate then.
        """
        for goal_id in self._running if over and self.every else ():
            self._targets.setdefault(goal_id, _Target())  # seen too late for a request
        new = []
        for goal_id, target in self._targets.items():
            row = self.board.goals.get(goal_id)
            # A goal that was not cancelled, as its server refused that, may end by itself later.
            refused = over and target.fate is not None and target.fate.cancel == "REFUSED"
            told = None
            if row is not None and row.ended and (target.fate is None or refused):
                told = self._ended(row, target, now, over)
            elif target.fate is None:
                told = _running(row, target, now, over, self.may_come(goal_id, now), self._most)
            if told is not None:
                target.fate = Fate(goal_id, told[0], row.state if row else "", told[1])
                new.append(target.fate)
        return new

    def _ended(
        self, row: WatchedGoal, target: _Target, now: float, over: bool
    ) -> tuple[str, str] | None:
        """Return what is known of a goal that each server has ended that has shown it so far."""
        if self._most > 1 and not over and not self._has_looked_long(now):
            return None  # the status of another server may not have come yet
        if len(row.entries) >= min(target.consents, self._most):
            return _ended(row, target)
        elsewhere = (
            "It has ended on one server, and another one cancels it. IT MAY STILL RUN THERE."
        )
        return ("UNKNOWN", elsewhere) if over else None

    @property
    def done(self) -> bool:
        """Whether the fate of every goal is known and, of all goals, all servers have answered."""
        asks = self.every and (self._want or self._waits_for_answers)
        return not asks and all(target.fate is not None for target in self._targets.values())

    @property
    def _waits_for_answers(self) -> bool:
        return self._most_of(self._answers) < max(1, len(self.board.servers))

    def _most_of(self, counts: Counter[int]) -> int:
        """How many servers it is for the last request, or for one that repeats it."""
        numbers = range(self._first, self._number + 1)
        return max((counts[number] for number in numbers), default=0)

    # --- what happened to it ---------------------------------------------------------------

    @property
    def fates(self) -> list[Fate]:
        """The fates of the goals that are settled."""
        return [target.fate for target in self._targets.values() if target.fate is not None]

    def gets_more(self, now: float) -> bool:
        """Return whether new goals came in until now, so that more will come."""
        asked = [target.asked for target in self._targets.values() if target.asked is not None]
        return bool(asked) and asked[-1] - asked[0] >= _AGAIN and now - asked[-1] < _AGAIN

    @property
    def silent(self) -> bool:
        """Whether no server has answered."""
        return not self.answers

    @property
    def missing(self) -> int:
        """How many servers in sight have not consented to cancel all; some may be unknown."""
        servers = max(len(self.board.servers), min(1, self.answers))
        return max(0, servers - self._most_of(self._consents)) if self.every else 0

    @property
    def unheard(self) -> str:
        """Which servers have not consented to cancel all goals, as a sentence; `""` if all have."""
        if not self.every or not (self.silent or self.missing):
            return ""
        servers = len(self.board.servers)
        told = f"{self.missing} of {servers} servers did not answer"
        if self.silent:
            told = "no server answered"
        elif not self._waits_for_answers:
            if self._codes == {_REJECTED} and any(f.cancel == "REFUSED" for f in self.fates):
                return ""  # servers in C++ answer with this error if they refuse for each goal
            codes = ", ".join(map(str, sorted(self._codes)))
            told = (
                f"{self.missing} of {max(1, servers)} servers cannot, or will not, cancel all goals"
                f" (return code {codes}, of {', '.join(self.servers) or 'unknown nodes'}):"
                " cancel each by its id"
            )
        return f"{self.name}: {told}. GOALS MAY STILL BE RUNNING."


def _ended(row: WatchedGoal, target: _Target) -> tuple[str, str]:
    if row.state == "LOST":
        return "UNKNOWN", "Its last server went away; whether it runs on is not known."
    if row.state == "CANCELED" and target.asked is not None:
        return "CONFIRMED", "It was canceled, and runs no more."
    if row.state == "ABORTED" and target.consents:
        return "CONFIRMED", "Its server agreed to cancel it, and ended it as ABORTED."
    before = "in the meantime" if target.asked is not None else "before"
    return "NOT_NEEDED", f"It had ended {before}: {row.state}."


def _running(
    row: WatchedGoal | None, target: _Target, now: float, over: bool, may_come: bool, servers: int
) -> tuple[str, str] | None:
    """Return what is known of a goal without a seen end, or `None` if that may still change."""
    settled = over or now - target.since >= _SETTLE
    canceling = row is not None and row.state == "CANCELING"
    if target.answer is CancelAnswer.REFUSED and not canceling and settled:
        return "REFUSED", "The server refused to cancel it. IT IS STILL RUNNING."
    unknown = row is None and max(target.unknown.values(), default=0) >= max(1, servers)
    if unknown and target.again and servers <= 1:
        return (
            "CONFIRMED",
            "Its server agreed to cancel it, and no longer knows it: it has stopped.",
        )
    if unknown and not target.consents and (over if may_come else settled):
        return "NO_SUCH_GOAL", "No server in sight knows it: it ended long ago, or never was here."
    if not over:
        return None
    if target.asked is None and not canceling:
        return "UNKNOWN", "No request to cancel it was sent. IT MAY STILL BE RUNNING."
    if target.answer in (CancelAnswer.ACCEPTED, CancelAnswer.TERMINATED) or canceling:
        return (
            "UNKNOWN",
            "The server is cancelling it, and did not end it. IT MAY STILL BE RUNNING.",
        )
    return "UNKNOWN", "The server did not answer. IT MAY STILL BE RUNNING."
