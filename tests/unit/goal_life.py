"""Drives a goal's state machine, and checks after each event what must hold in every order.

Beside the machine stands a model of what a server may be doing with the goal. It learns from the
events that the machine is told and from the effects that it asks for, and never looks at the fields
of the machine. What others read there (`in_flight`, `may_run`, `settled`) is compared with it.
"""

from __future__ import annotations

import copy
import math
import uuid
from dataclasses import astuple, dataclass, replace
from typing import Any

from actionkit._goal.effects import (
    Arm,
    AskCancel,
    Disarm,
    Effect,
    End,
    Ending,
    LastNews,
    LateResult,
    Record,
    Release,
    Settle,
    Timer,
)
from actionkit._goal.machine import Goal
from actionkit._goal.stages import CONFIRMED_AFTER, CancelReason
from actionkit._model.cancel_answer import CancelAnswer
from actionkit._model.settings import Timeouts
from actionkit._model.values import CancelReport, GoalState

UNTIL_SENT = ("sent",)
UNTIL_ACCEPTED = (*UNTIL_SENT, "accepted")
GIVING_UP = {
    "cancel": CancelReason.CANCELLED,
    "close": CancelReason.CLOSED,
    "deadline": CancelReason.DEADLINE,
}


def sent_to(servers: int, *, accepted: int = 0, at: float = 0.0, **timeouts: Any) -> Goal:
    """Return a goal that so many servers may have got, and so many have accepted."""
    goal = Goal(uuid.uuid4(), Timeouts(**timeouts))
    goal.sent(0.0, servers=servers)
    for _ in range(accepted):
        goal.accepted(at)
    return goal


def on_two(*, accepted: int = 0, at: float = 0.0) -> Goal:
    return sent_to(2, accepted=accepted, at=at)


def endings(effects: list[Effect]) -> list[Ending]:
    return [each.ending for each in effects if isinstance(each, Settle)]


class Broken(AssertionError):
    """The machine did what it must never do."""


@dataclass
class OnServer:
    """What a server may be doing with the goal, by all that was said so far.

    Attributes:
        sent: Whether the request for the goal was sent to the server.
        accepted: Whether the server has shown that it took the goal.
        lost: Whether the server is out of sight, or was and has not shown the goal again.
        back: Whether it is in sight again.
        ended: Whether a terminal state was seen.
        denied: Whether the server did not know it when it was asked last, and may yet take it (R6).
        shown_at: When it has shown that.
        forgotten_at: When it first did not know the goal any more that it had shown to have.
        rejected: Whether its request was rejected.
        over: Whether it is known that the goal does not run and never will.
        others_cancel: Whether it was seen as being cancelled before this side had asked for that.
    """

    sent: bool = False
    accepted: bool = False
    lost: bool = False
    back: bool = False
    ended: bool = False
    denied: bool = False
    shown_at: float = -math.inf
    forgotten_at: float | None = None
    rejected: bool = False
    over: bool = False
    others_cancel: bool = False

    @property
    def has_it(self) -> bool:
        """Whether a server may be running the goal, or may yet come to run it."""
        return self.sent and not self.over

    @property
    def news(self) -> LastNews:
        """What the caller may be told of it."""
        if self.ended or not self.has_it:
            return LastNews.STOPPED
        if self.lost:
            return LastNews.SERVER_GONE
        return LastNews.UNKNOWN_TO_SERVER if self.denied else LastNews.NOTHING

    def learn(
        self, event: str, args: tuple[Any, ...], now: float, asked_at: float, *, own: bool
    ) -> None:
        """Take in an event, before the machine is told of it."""
        if event == "sent":
            self.sent = True
        elif not self.has_it:
            return
        elif event == "server_lost" and self.lost:
            self.back = False
        elif event == "server_lost":
            self.lost, self.back = True, False
            self.over = self.ended  # its result went with it
        elif event == "server_back":
            self.back = self.lost
            self.lost = self.lost and self.accepted
        elif event == "rejected" and not self.accepted:
            self.rejected = self.over = True
        elif event == "result" and args[0] is None:
            if self.lost or not self.accepted:
                self._unknown()
            elif own:
                self._forgotten(now, asked_at)
        elif (event, args) == ("cancel_answered", (CancelAnswer.UNKNOWN_GOAL,)):
            if self.lost or not self.accepted:
                self._unknown()
            elif own and asked_at >= self.shown_at and not self.ended:
                self._forgotten(now, asked_at)
        elif event in ("accepted", "feedback", "status", "result", "cancel_answered"):
            # Whatever else a server says of a goal proves that it took it.
            if self.lost or not self.accepted:
                self.shown_at = now
            self.accepted, self.lost, self.denied = True, False, False
            self.over = event == "result"
            self.ended |= self.over or (event == "status" and args[0].is_terminal)

    def _forgotten(self, now: float, asked_at: float) -> None:
        """A server may say so of a goal that it is just accepting: it counts when said again."""
        if self.forgotten_at is None:
            self.forgotten_at = now
        elif asked_at >= self.forgotten_at + CONFIRMED_AFTER:
            self.over = True

    def _unknown(self) -> None:
        """Of a lost goal only the server that had it can say so (C5.7)."""
        self.over = self.lost and self.back
        self.denied = self.denied or not self.lost


class Life:
    """One goal with a clock that the test moves; timers fire when it passes them."""

    def __init__(self, deadline: float | None = None, **timeouts: float | None) -> None:
        self.now = 0.0
        self.others_confirmed_at = -math.inf
        self.deadline = deadline
        if deadline is not None:
            timeouts["result"] = None
        self.timeouts = Timeouts(**timeouts)  # type: ignore[arg-type]
        self.goal = Goal(uuid.uuid4(), self.timeouts)
        self.timers: dict[Timer | str, float] = {}
        """Those of the goal, and the deadline, which its call tells it of."""
        self.all: list[Effect] = []
        self.told: list[tuple[Any, ...]] = []
        self.ending: Ending | None = None
        self.server = OnServer()
        self.started = self.released = self.abandoned = self.broke = False
        self.cancel_asked = self.cancel_accepted = self.cancelling = False
        self.refused = self.refused_lately = self.refusal_meant = False
        self.cancelled_before = False  # by an earlier call
        self.refused_at: float | None = None

    # --- driving ---------------------------------------------------------------------------

    def see(self, *events: str) -> list[Effect]:
        """Let events without arguments happen; return what the last one asks for."""
        effects: list[Effect] = []
        for event in events:
            effects = self.tell(event)
        return effects

    def after(self, *events: str, until: float | None = None) -> Life:
        """Let events without arguments happen, wait, and return itself."""
        self.see(*events)
        if until is not None:
            self.wait_until(until)
        return self

    def tell(self, event: str, *args: Any, **options: Any) -> list[Effect]:
        """Let an event happen now; return what it asks for."""
        before = replace(self.server)
        asks_again = self.ending is not None and event in GIVING_UP
        if event in ("result", "cancel_answered"):
            options.setdefault("asked_at", self.now)
        if event == "status":
            options.setdefault("ours", True)
        self._note(event, args, options)
        given = (GIVING_UP[event],) if event in GIVING_UP else args
        last = (1,) if event == "attached_again" else ()  # how many servers may have it
        happens = getattr(self.goal, "give_up" if event in GIVING_UP else event)
        try:
            effects: list[Effect] = happens(*given, self.now, *last, **options)
        except AssertionError as error:
            raise Broken(f"the machine takes every event: {self.told}") from error
        self.all += effects
        if not self.cancelling and any(
            isinstance(each, Arm) and each.timer is Timer.CANCEL for each in effects
        ):
            # Given up: what counts is what is said from now on.
            self.server.denied = self.refusal_meant = False
            self.refused_at = None
        for effect in effects:
            self._carry_out(effect, event, args)
        self.cancelling = Timer.CANCEL in self.timers
        if asks_again and AskCancel() in effects:
            self.refusal_meant, self.refused_at = False, None
        self._check(event, before, effects)
        if asks_again and not options.get("abandon") and self.in_flight:
            asked = AskCancel() in effects or self.server.lost or self.server.ended
            self._require(asked, "who has left can ask again")
        return effects

    def attach_again(self) -> None:
        """Let another call attach to the goal, if the one that it was of is over."""
        if self.ending is None or not self.in_flight:
            return
        self.ending = self.deadline = None
        self.cancelled_before = self.cancel_accepted
        if self.server.back or not self.server.lost:  # else there is nothing to follow
            self.server.lost = self.server.denied = self.cancel_asked = False
            self.refused = self.refused_lately = self.refusal_meant = self.cancelling = False
            self.server.forgotten_at = self.refused_at = None
        self.tell("attached_again", self.timeouts, left_alone=False)

    def fire(self, timer: Timer | str) -> list[Effect]:
        """Let an armed timer fire, at its time."""
        self.now = max(self.now, self.timers.pop(timer))
        if isinstance(timer, str):
            return self.tell(timer)
        # What was confirmed is known up to now, and not from the future.
        confirmed_at = min(self.others_confirmed_at, self.now)
        effects = self.tell("timer", timer, others_confirmed_at=confirmed_at)
        self._require(self.timers.get(timer, math.inf) > self.now, "no timer fires for ever")
        return effects

    def wait_until(self, moment: float) -> None:
        """Move the clock, firing the timers due on the way."""
        while self.timers and min(self.timers.values()) <= moment:
            self.fire(min(self.timers, key=lambda timer: self.timers[timer]))
        self.now = max(self.now, moment)

    # --- what happened ---------------------------------------------------------------------

    @property
    def ended(self) -> Ending:
        assert self.ending is not None
        return self.ending

    @property
    def end(self) -> End | None:
        return self.ending and self.ending.end

    @property
    def report(self) -> CancelReport | None:
        assert self.ending is not None
        return self.ending.cancel

    @property
    def states(self) -> list[GoalState]:
        return [each.state for each in self.all if isinstance(each, Record)]

    def count(self, effect: type) -> int:
        return sum(isinstance(each, effect) for each in self.all)

    @property
    def left_alone(self) -> bool:
        """Whether this side takes care of the goal no more, whatever it does."""
        return self.abandoned or self.broke

    @property
    def in_flight(self) -> bool:
        return self.server.has_it and not self.left_alone and not self.released

    # --- what must hold --------------------------------------------------------------------

    def _note(self, event: str, args: Any, options: Any) -> None:
        given = () if event == "timer" or options.get("asked_at") == self.now else options.values()
        self.told.append((event, *args, *given))
        in_flight, ended = self.in_flight, self.ending is not None
        self.started |= event == "sent"
        if event == "sent" and self.deadline is not None:
            self.timers["deadline"] = self.deadline
        if in_flight:
            if event == "cancel_answered":
                self.cancel_accepted |= args[0] is CancelAnswer.ACCEPTED
                if args[0] is not CancelAnswer.UNKNOWN_GOAL:
                    self.refused_lately = args[0] is CancelAnswer.REFUSED
                    self.refused |= self.refused_lately
                    self._count_refusals(ended or self.cancelling, options["asked_at"])
            if event == "server_lost" and not self.server.lost:
                self.refused_lately = False
            if event == "server_lost" or (event == "status" and args[0].is_terminal):
                self.refused_at, self.refusal_meant = None, False
            if event == "close" and not ended and not self.cancelling:
                self.abandoned = options["abandon"]
        self.broke |= event == "fail" and not ended
        if not self.left_alone and not self.released:
            asked_at, own = options.get("asked_at", self.now), options.get("own", True)
            self.server.learn(event, args, self.now, asked_at, own=own)
            if (event, *args) == ("status", GoalState.CANCELING) and in_flight:
                seen_first = not self.cancel_asked and not self.server.ended
                self.server.others_cancel |= seen_first

    def _count_refusals(self, unwanted: bool, asked_at: float) -> None:
        """A refusal says little (R12), before it was said again to what was asked after a while."""
        if not self.refused_lately:
            self.refused_at, self.refusal_meant = None, False
        elif unwanted and not (self.cancel_accepted or self.server.ended):
            if self.refused_at is None:
                self.refused_at = self.now
            self.refusal_meant |= asked_at >= self.refused_at + CONFIRMED_AFTER

    def _require(self, holds: bool, promise: str) -> None:
        if not holds:
            raise Broken(f"{promise}: {self.told}")

    def _carry_out(self, effect: Effect, event: str, args: Any) -> None:
        self._require(not self.released, f"after Release nothing more is done, such as {effect}")
        if isinstance(effect, Arm):
            self._require(effect.at >= self.now, "no timer is armed in the past")
            self.timers[effect.timer] = effect.at
        elif isinstance(effect, Disarm):
            self.timers.pop(effect.timer, None)
        elif isinstance(effect, AskCancel):
            self.cancel_asked = True
        elif isinstance(effect, LateResult):
            self._require(self.ending is not None, "a late result comes after the end")
            news = (effect.state, effect.result) == args
            told = event == "result" and news
            denied = effect == LateResult(GoalState.REJECTED, None)
            self._require(
                told or (denied and event in ("rejected", "result")),
                "a late result is the server's word",
            )
        elif isinstance(effect, Release):
            self.released = True
            self.timers.clear()
        if isinstance(effect, Settle):
            self.timers = {k: at for k, at in self.timers.items() if k is Timer.REASK}
            self._require(self.ending is None, "it ends once")
            self.ending = effect.ending
            self._check_ending(event, args, effect.ending)

    def _check_ending(self, event: str, args: Any, ending: Ending) -> None:
        server, report = self.server, ending.cancel
        success = event == "result" and args[0] is GoalState.SUCCEEDED
        if ending.end is End.SUCCEEDED:
            self._require(success and ending.result is args[1], "success is the server's word")
        elif success:
            self._require(
                ending.end is End.DEADLINE and ending.result is args[1],
                "a success is given to the caller, or with the deadline's error (C2.3)",
            )
        runs = server.has_it and not (server.ended or server.lost or self.left_alone)
        if runs:
            self._require(self.cancel_asked, "nothing is left behind without a cancel (C2.4)")
        if report is CancelReport.CONFIRMED:
            self._require(server.ended, "CONFIRMED means that a terminal state was seen")
        if report is CancelReport.UNKNOWN and not self.left_alone:
            self._require(not server.ended, "UNKNOWN means that no terminal state was seen")
        if report is CancelReport.REFUSED:
            self._require(self.refused, "REFUSED is what the server said")
            self._require(ending.end is not End.LOST, "who is gone refuses nothing")
            if ending.end in (End.DEADLINE, End.CLOSED, End.STALLED, End.NO_ACCEPTANCE):
                runs = self.refused_lately and not server.ended
                self._require(runs, "REFUSED means that it runs on")
        if report is CancelReport.NOT_NEEDED:
            self._require(not server.has_it, "NOT_NEEDED means that nothing was running")
        lost = ending.end is End.LOST and not self.broke
        self._require(not (lost and server.ended), "a goal that ended was not lost with its server")
        others = ending.end is End.CANCELED_BY_OTHER
        ours = self.cancel_accepted and not self.cancelled_before
        self._require(not (others and ours), "our cancel is nobody else's")
        stalled = ending.end is End.STALLED and not self.cancel_asked
        self._require(not stalled, "a stall is told after a cancel")
        self._require((ending.phase != "") == (ending.end is End.DEADLINE), "deadlines have phases")
        self._require((ending.end is End.DEADLINE) <= (report is not None), "(C2.3)")
        self._require(ending.rejected == server.rejected, "it was rejected, and never accepted")
        if self.left_alone and not server.ended:
            self._require(ending.news is not LastNews.STOPPED, "a goal left behind may run on")
        else:
            self._require(ending.news is server.news, f"what is known of it is {server.news}")

    def _check(self, event: str, before: OnServer, effects: list[Effect]) -> None:
        goal, armed, server = self.goal, set(self.timers), self.server
        settled = self.ending is not None
        self._require(goal.settled == settled, "`settled` tells of Settle")
        self._require(goal.in_flight == self.in_flight, "`in_flight`: a server may be running it")
        lost = server.lost and not server.back
        may_run = self.in_flight and not (lost or server.denied or server.ended)
        self._require(goal.may_run == may_run, "`may_run`: a server in sight may be running it")
        known = server.over or server.lost or self.left_alone
        self._require(settled or not known, "no caller is left waiting")
        over = server.over or self.left_alone
        self._require(self.released or not over, "what is over is released")
        # Nobody waits for ever for the result of a goal that ended.
        dropped = server.denied and goal.facts.left and self.now > 600.0
        forgotten = settled and (server.ended or dropped)
        self._require(over or forgotten or not self.released, "what may run is watched on")
        if event == "result" and self.told[-1][1] is not None and settled:
            late = before.has_it and self._was_watched(effects)
            late = late and Settle not in map(type, effects)
            self._require(late == (LateResult in map(type, effects)), "a late result is told of")
        taken = before.has_it and (before.lost or not before.accepted)
        if event == "accepted" and taken and self.in_flight and (settled or self.cancelling):
            self._require(AskCancel() in effects, "a late acceptance is cancelled (C2.4)")
        doubted = self.refused_at is not None and not self.refusal_meant
        if self.told[-1] == ("timer", Timer.REASK) and doubted and self.in_flight:
            wanted = not (settled or self.cancelling)
            self._require(wanted or AskCancel() in effects, "a refusal is asked about once more")
        if self.in_flight and not server.lost:
            self._require(Timer.REASK in armed, "what may have been lost is asked for again")
        taken = server.accepted and not server.lost
        self._require(Timer.ACCEPT not in armed or not taken, "what was accepted is not late")
        quiet = self.cancelling or server.ended
        self._require(Timer.STALL not in armed or not quiet, "what is to end may be silent")
        if settled:
            self._require(armed <= {Timer.REASK}, f"a caller that left has no timers ({armed})")
        elif self.started:
            self._check_limits(armed)

    def _was_watched(self, effects: list[Effect]) -> bool:
        """Whether the goal had not been released, nor left alone, before these effects."""
        return Release in map(type, effects) or self.in_flight

    def _check_limits(self, armed: set[Timer | str]) -> None:
        """An open goal has every timer that the user's limits ask for in its phase."""
        server, limits = self.server, self.timeouts
        if not self.cancelling:
            unanswered = server.has_it and not server.accepted
            # One that a server is cancelling, for others or for an earlier call, may be silent.
            runs = server.accepted and not server.ended
            runs &= not (server.others_cancel or self.cancelled_before)
            needed = {
                Timer.ACCEPT: unanswered and limits.accept is not None,
                Timer.STALL: runs and limits.feedback is not None,
            }
            for timer, wanted in needed.items():
                self._require(not wanted or timer in armed, f"the limit {timer} is kept")
        if self.deadline is not None:
            latest = max(self.deadline, 0.0) + limits.cancel
            self._require(self.now < latest or bool(self._due()), "the deadline is kept (C2.3)")

    def _due(self) -> list[Timer | str]:
        return [timer for timer, at in self.timers.items() if at <= self.now]

    def copy(self) -> Life:
        """Return a life that goes its own way from here."""
        twin = copy.copy(self)
        twin.goal, twin.server = copy.copy(self.goal), copy.copy(self.server)
        twin.goal.facts = copy.copy(self.goal.facts)
        twin.timers, twin.all, twin.told = dict(self.timers), [], list(self.told)
        return twin

    def situation(self) -> tuple[object, ...]:
        """Return what the future depends on: alike for two lives that differ in the time only."""
        fields = [*vars(self.goal).items(), *vars(self.server).items()]
        fields.append(("facts", astuple(self.goal.facts)))
        same = ("_timeouts", "_latest")  # it follows from the deadline
        facts = [
            self._age(*each)
            for each in fields
            if each[0] not in same and each[1] is not self.goal.facts
        ]
        armed = sorted((str(t), max(at - self.now, 0.0)) for t, at in self.timers.items())
        left = None if self.deadline is None else max(self.deadline - self.now, 0.0)
        flags = [v for v in vars(self).values() if isinstance(v, bool)]
        return (*facts, self._age("refused_at", self.refused_at), *armed, left, *flags)

    def _age(self, name: str, value: Any) -> Any:
        """Return how long ago a moment was, as far as it matters; all else as it is."""
        if not name.endswith("_at") or value is None:
            return value
        age = self.now - value
        return age if name == "_cancelled_at" else min(age, CONFIRMED_AFTER)
