"""Drives a goal's state machine, and checks after each event what must hold in every order."""

from __future__ import annotations

import copy
import math
from typing import Any

from actionkit._goal.effects import (
    Arm,
    AskCancel,
    Disarm,
    Effect,
    End,
    Ending,
    Known,
    LateResult,
    Reached,
    Record,
    Release,
    SendGoal,
    Settle,
    Timer,
    Withdraw,
)
from actionkit._goal.machine import Goal, Stage
from actionkit._goal.stages import DOUBT
from actionkit._model.cancel_answer import CancelAnswer
from actionkit._model.settings import Timeouts
from actionkit._model.values import CancelReport, GoalState

UNTIL_SENT = ("start", "server_ready", "sent")
UNTIL_ACCEPTED = (*UNTIL_SENT, "accepted")


class Broken(AssertionError):
    """The machine did what it must never do."""


class Life:
    """One goal with a clock that the test moves; timers fire when it passes them."""

    def __init__(
        self, deadline: float | None = None, *, resent: bool = False, **timeouts: float | None
    ) -> None:
        self.now = 0.0
        self.others_confirmed_at = -math.inf
        self.deadline = deadline
        self.timeouts = Timeouts(**timeouts)  # type: ignore[arg-type]
        self.goal = Goal(self.timeouts, deadline, resent=resent)
        self.timers: dict[Timer, float] = {}
        self.all: list[Effect] = []
        self.told: list[tuple[Any, ...]] = []
        self.ending: Ending | None = None
        self.queued = self.released = self.abandoned = self.broke = self.superseded = False
        self.cancel_asked = self.cancel_accepted = False
        self.denied = self.rejected = self.unknown = self.stopped = False
        self.refused = self.refused_lately = False
        self.missed = False
        self.missed_at: float | None = None
        self.resent = resent
        self.sent = False
        # What the caller may be told of the goal, from what was told so far alone.
        self.reached = Reached.UNANSWERED if resent else Reached.NEVER_SENT
        self.known = Known.NOTHING if resent else Known.STOPPED

    # --- driving ---------------------------------------------------------------------------

    def see(self, *events: str) -> list[Effect]:
        """Let events without arguments happen; return what the last one asks for."""
        effects: list[Effect] = []
        for event in events:
            effects = self.tell(event)
        return effects

    def tell(self, event: str, *args: Any, **options: Any) -> list[Effect]:
        """Let an event happen now; return what it asks for."""
        before, wanted = self.goal.stage, self.goal.gave_up is None
        self._note(event, args, options, before)
        try:
            effects: list[Effect] = getattr(self.goal, event)(*args, self.now, **options)
        except AssertionError as error:
            raise Broken(f"the machine takes every event: {self.told}") from error
        self.all += effects
        if wanted and self.goal.gave_up is not None and self.known is Known.UNKNOWN_TO_SERVER:
            self.known = Known.NOTHING  # what counts is what the server says from now on
        for effect in effects:
            self._carry_out(effect, event, args, before)
        self._check(event, before, effects)
        return effects

    def fire(self, timer: Timer) -> list[Effect]:
        """Let an armed timer fire, at its time."""
        self.now = max(self.now, self.timers.pop(timer))
        # What was confirmed is known up to now, and not from the future.
        confirmed_at = min(self.others_confirmed_at, self.now)
        return self.tell("timer", timer, others_confirmed_at=confirmed_at)

    def wait_until(self, moment: float) -> None:
        """Move the clock, firing the timers due on the way."""
        while self.timers and min(self.timers.values()) <= moment:
            self.fire(min(self.timers, key=lambda timer: self.timers[timer]))
        self.now = max(self.now, moment)

    # --- what happened ---------------------------------------------------------------------

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

    # --- what must hold --------------------------------------------------------------------

    def _note(self, event: str, args: Any, options: Any, before: Stage) -> None:
        given = () if event == "timer" else options.values()
        self.told.append((event, *args, *given))
        in_flight = self._on_server(before)
        if event == "sent" and before is Stage.QUEUED:
            self.sent = True
        if before is Stage.SENT:
            # A server that was sent the same id twice denies the second of them (R5).
            no = event == "rejected" or (self.denied and event == "result" and args[0] is None)
            self.rejected |= no and (self.denied or not self.resent)
            self.denied |= no
        if event == "result" and in_flight:
            self.stopped |= args[0] is not None
            sure = args[0] is None and self._sure_of_unknown(before)
            self.unknown |= sure
            self.missed |= sure and before is Stage.ACCEPTED
        if event == "status" and in_flight:
            self.stopped |= args[0].is_terminal
        if event == "cancel_answered" and in_flight:
            self.cancel_accepted |= args[0] is CancelAnswer.ACCEPTED
            if args[0] is not CancelAnswer.UNKNOWN_GOAL:
                self.refused_lately = args[0] is CancelAnswer.REFUSED
                self.refused |= self.refused_lately
        if event == "close" and options["abandon"] and in_flight and self.goal.gave_up is None:
            self.abandoned = True
        if event == "server_lost" and before in (Stage.SENT, Stage.ACCEPTED):
            self.refused_lately = False
        self.broke |= event == "fail"
        self.superseded |= event == "supersede"
        self._learn(event, args, before)

    def _on_server(self, stage: Stage) -> bool:
        """Whether a server may have the goal; one that is sent again may be there already."""
        waits = stage in (Stage.AWAITING_SERVER, Stage.QUEUED)
        return stage in (Stage.SENT, Stage.ACCEPTED, Stage.LOST) or (self.resent and waits)

    def _learn(self, event: str, args: Any, before: Stage) -> None:
        """Keep the books of how far the goal got, and of what is known of it now."""
        in_flight = self._on_server(before)
        unknown = (event == "cancel_answered" and args[0] is CancelAnswer.UNKNOWN_GOAL) or (
            event == "result" and args[0] is None
        )
        if event == "sent" and before is Stage.QUEUED:
            self.reached, self.known = Reached.UNANSWERED, Known.NOTHING
        elif self.rejected and before is Stage.SENT:
            self.reached, self.known = Reached.REJECTED, Known.STOPPED
        elif in_flight and unknown:
            if before not in (Stage.ACCEPTED, Stage.LOST):
                self.known = Known.UNKNOWN_TO_SERVER
            elif before is Stage.LOST or (event == "result" and self.missed):
                self.known = Known.STOPPED
        elif in_flight and event in ("accepted", "feedback", "status", "result", "cancel_answered"):
            # Whatever a server says of a goal proves that it took it.
            self.reached = Reached.ACCEPTED
            ended = event == "result" or (event == "status" and args[0].is_terminal)
            if self.known is not Known.STOPPED:
                self.known = Known.STOPPED if ended else Known.NOTHING
        elif event == "server_lost" and in_flight and self.known is not Known.STOPPED:
            self.known = Known.SERVER_GONE

    def _sure_of_unknown(self, before: Stage) -> bool:
        """Whether a server that does not know a goal means it; an accepted one, only if twice."""
        if before is not Stage.ACCEPTED:
            return True
        if self.missed_at is None:
            self.missed_at = self.now
            return False
        return self.now >= self.missed_at + DOUBT

    def _require(self, holds: bool, promise: str) -> None:
        if not holds:
            raise Broken(f"{promise}: {self.told}")

    def _carry_out(self, effect: Effect, event: str, args: Any, before: Stage) -> None:
        late = event == "accepted" and before is Stage.OVER
        self._require(
            not self.released or (late and isinstance(effect, AskCancel)),
            f"after Release nothing more is done, such as {effect}",
        )
        if isinstance(effect, Arm):
            self._require(effect.at >= self.now, "no timer is armed in the past")
            self.timers[effect.timer] = effect.at
        elif isinstance(effect, Disarm):
            self.timers.pop(effect.timer, None)
        elif isinstance(effect, SendGoal):
            wanted = self.ending is None and self.goal.gave_up is None
            self._require(wanted, "nothing is sent that nobody wants")
            self._require(not self.sent and not self.queued, "nothing is sent twice")
            self.queued = True
        elif isinstance(effect, Withdraw):
            self.queued = False
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
        elif isinstance(effect, Settle):
            self._require(self.ending is None, "it ends once")
            self.ending = effect.ending
            self._check_ending(event, args, effect.ending)

    def _check_ending(self, event: str, args: Any, ending: Ending) -> None:
        success = event == "result" and args[0] is GoalState.SUCCEEDED
        if ending.end is End.SUCCEEDED:
            self._require(success and ending.result is args[1], "success is the server's word")
        elif success:
            self._require(
                ending.end is End.DEADLINE and ending.result is args[1],
                "a success is given to the caller, or with the deadline's error (C2.3)",
            )
        stage, report = self.goal.stage, ending.cancel
        if stage in (Stage.SENT, Stage.ACCEPTED) and not self.abandoned:
            self._require(self.cancel_asked, "nothing is left behind without a cancel (C2.4)")
        if report is CancelReport.CONFIRMED:
            self._require(self.stopped, "CONFIRMED means that a terminal state was seen")
        if report is CancelReport.UNKNOWN and not self.abandoned and not self.broke:
            self._require(not self.stopped, "UNKNOWN means that no terminal state was seen")
        if report is CancelReport.REFUSED:
            self._require(self.refused, "REFUSED is what the server said")
            self._require(ending.end is not End.LOST, "who is gone refuses nothing")
            if ending.end in (End.DEADLINE, End.CLOSED, End.STALLED, End.NO_ACCEPTANCE):
                runs = self.refused_lately and not self.stopped
                self._require(runs, "REFUSED means that it runs on")
        if report is CancelReport.NOT_NEEDED:
            idle = not self.sent or self.rejected or self.unknown
            self._require(idle, "NOT_NEEDED means that nothing was running")
        lost = ending.end is End.LOST and not self.broke
        self._require(not (lost and self.stopped), "a goal that ended was not lost with its server")
        others = ending.end is End.CANCELED_BY_OTHER
        self._require(not (others and self.cancel_accepted), "our cancel is nobody else's")
        self._require((ending.phase != "") == (ending.end is End.DEADLINE), "deadlines have phases")
        self._require((ending.end is End.DEADLINE) <= (report is not None), "(C2.3)")
        self._require(ending.reached is self.reached, f"it reached {self.reached}")
        if (self.broke or self.abandoned) and not self.stopped:
            self._require(ending.known is not Known.STOPPED, "a goal left behind may run on")
        else:
            self._require(ending.known is self.known, f"what is known of it is {self.known}")

    def _check(self, event: str, before: Stage, effects: list[Effect]) -> None:
        goal, armed = self.goal, set(self.timers)
        self._require(goal.settled == (self.ending is not None), "`settled` tells of Settle")
        self._require(before is not Stage.OVER or goal.stage is Stage.OVER, "OVER is for good")
        self._require(
            goal.settled or goal.stage not in (Stage.OVER, Stage.LOST), "no caller is left waiting"
        )
        over = goal.stage is Stage.OVER
        if self.superseded:  # what the link holds is another's now, with the same id
            self._require(over and not armed, "who is superseded leaves all to another")
        else:
            self._require(self.released == over, "what is over is released")
        if event == "result" and self.told[-1][1] is not None and self.ending is not None:
            late = before in (Stage.SENT, Stage.ACCEPTED, Stage.LOST) and Settle not in map(
                type, effects
            )
            self._require(late == (LateResult in map(type, effects)), "a late result is told of")
        if event == "accepted" and before in (Stage.SENT, Stage.LOST):
            unwanted = goal.settled or goal.gave_up is not None
            self._require(
                not unwanted or AskCancel() in effects, "a late acceptance is cancelled (C2.4)"
            )
        if goal.stage in (Stage.SENT, Stage.ACCEPTED):
            self._require(Timer.NUDGE in armed, "what may have been lost is asked for again")
        if goal.settled:
            self._require(armed <= {Timer.NUDGE}, f"a caller that left has no timers ({armed})")
        else:
            self._check_limits(armed)

    def _check_limits(self, armed: set[Timer]) -> None:
        """An open goal has every timer that the user's limits ask for in its phase."""
        goal, limits = self.goal, self.timeouts
        if goal.stage is Stage.NEW:
            return
        needed: dict[Timer, bool]
        if goal.gave_up is not None:
            needed = {Timer.CANCEL: True}
        else:
            needed = {
                Timer.DEADLINE: self.deadline is not None,
                Timer.SERVER: goal.stage is Stage.AWAITING_SERVER and limits.server is not None,
                Timer.ACCEPT: goal.stage is Stage.SENT and limits.accept is not None,
                Timer.STALL: goal.stage is Stage.ACCEPTED and limits.feedback is not None,
            }
        for timer, wanted in needed.items():
            self._require(not wanted or timer in armed, f"the limit {timer} is kept")
        if self.deadline is not None:
            latest = max(self.deadline, 0.0) + limits.cancel
            self._require(self.now < latest or bool(self._due()), "the deadline is kept (C2.3)")

    def _due(self) -> list[Timer]:
        return [timer for timer, at in self.timers.items() if at <= self.now]

    def copy(self) -> Life:
        """Return a life that goes its own way from here."""
        twin = copy.copy(self)
        twin.goal = copy.copy(self.goal)
        twin.timers, twin.all, twin.told = dict(self.timers), [], list(self.told)
        return twin

    def situation(self) -> tuple[object, ...]:
        """Return what the future depends on: alike for two lives that differ in the time only."""
        goal = {k: v for k, v in vars(self.goal).items() if k not in ("_timeouts", "_deadline")}
        armed = sorted((t.value, max(at - self.now, 0.0)) for t, at in self.timers.items())
        left = None if self.deadline is None else max(self.deadline - self.now, 0.0)
        flags = [v for v in vars(self).values() if isinstance(v, bool)]
        return (*goal.values(), *armed, left, self.reached, self.known, *flags)
