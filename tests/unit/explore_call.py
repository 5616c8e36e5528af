"""Visits every state that a call, its goals and its servers can reach, and checks the promises.

The call's machine and the goals' machines are the real ones. Beside them stands the truth: what
each server does with each goal. Promises are checked against the truth. Time is only an order: each
armed timer may fire at any time; there is one moment after which the call's deadline has passed.
"""

from __future__ import annotations

import copy
import random
import uuid
from dataclasses import astuple, dataclass, field
from types import SimpleNamespace
from typing import Any

from actionkit import CancelReport, Timeouts
from actionkit._calls.retries import retry
from actionkit._calls.retries.budget import RetryBudget
from actionkit._calls.sending import effects as cx
from actionkit._calls.sending.machine import CallMachine, Phase
from actionkit._goal import effects as fx
from actionkit._goal.machine import Goal
from actionkit._goal.stages import CancelReason, Stage
from actionkit._model.cancel_answer import CancelAnswer
from actionkit._model.values import GoalState, Verdict
from tests.unit import exploring
from tests.unit.exploring import Broken

NO, UNSEEN, SEEN, ENDED, STOPPED = "-uret"
"""What a server does with a goal: nothing, runs it (untold, or told), has ended it and not told,
does not run it any more."""
ABSENT, UP, HUNG, DEAD = "aUHD"
DEADLINE = 1000.0
LONGEST_WALK = 60
JUDGED = (fx.End.SUCCEEDED, fx.End.ABORTED, fx.End.REJECTED, fx.End.CANCELED_BY_OTHER)
TRANSIENT = (fx.End.NO_ACCEPTANCE, fx.End.LOST, fx.End.STALLED)


UNIMPORTANT = (
    "_timeouts",
    "_latest",
    "_reask_after",
    "facts",
    "state",
    "_phase",
    "_denied_lately",
)


NOT_MINE = ("goal_id", "goal", "asked_now")


@dataclass(frozen=True)
class Replacement:
    """What a call asks the one that replaces it; by then, that one is over."""

    name: str
    goals: SimpleNamespace = field(compare=False)
    goal_id: int = 7
    phase: Phase = Phase.ENDED

    def __str__(self) -> str:
        return self.name


TAKEN = Replacement("taken", SimpleNamespace(accepted=True))
REFUSED = Replacement("refused", SimpleNamespace(accepted=False))


def may_run(undecided: int, does: str) -> bool:
    """Whether a server runs a goal or may yet take it; it takes an id only once (R5)."""
    return does in (UNSEEN, SEEN) or (undecided > 0 and does == NO)


class Attempt:
    """What `_calls.sending.attempt` does, without a link."""

    def __init__(self, goal_id: uuid.UUID, goal: Goal, number: int) -> None:
        self.goal_id, self.goal, self.number = goal_id, goal, number
        self.sent_to: frozenset[int] = frozenset()
        self.given_to: frozenset[int] = frozenset()
        """Those, and the servers that seem to have been replaced."""
        self.told_end: frozenset[int] = frozenset()
        """The servers that have told its end."""
        self.shown: frozenset[int] = frozenset()
        """The servers that have answered that they accept it."""
        self.timers: frozenset[fx.Timer] = frozenset()
        self.asked = self.released = False
        self.asked_now = False  # by the latest event

    @property
    def cancel_is_ours(self) -> bool:
        return self.asked

    def key(self, truth: Any) -> tuple[Any, ...]:
        if self.released:
            return (self.goal.facts.fate, self.sent_to, tuple(map(tuple, truth)))
        fields = [
            (value is None) if name.endswith("_at") else value
            for name, value in vars(self.goal).items()
            if name not in UNIMPORTANT
        ]
        facts = astuple(self.goal.facts)[1:]
        mine = tuple(v for n, v in vars(self).items() if n not in NOT_MINE)
        return (*fields, facts, mine, tuple(map(tuple, truth)))


class World:
    """The truth, with the machines in it."""

    attaches = rejoins = left_alone = may_be_replaced = False

    def __init__(self, resend: str, attempts: int, servers: int, returns: int = 1) -> None:
        self.ids = iter(uuid.UUID(int=number + 1) for number in range(100))
        ids = (next(self.ids), resend, 5.0, DEADLINE, lambda: next(self.ids))
        self.m = CallMachine(*ids, attaches=self.attaches, keyed=self.rejoins)
        self.most = attempts
        self.servers = [ABSENT] * servers
        self.attempts: list[Attempt] = []
        self.truth: dict[uuid.UUID, list[list[Any]]] = {}
        if self.attaches:  # somebody has sent it, and the first server runs it
            self.truth[self.m.goal_id] = [[0, NO if s else UNSEEN] for s in range(servers)]
        self.asked: Any = None  # what is judged or planned
        self.pause = self.awaiting = self.queued = False
        self.fails = self.hurried = False  # the next to be sent; to cancel, and was not told so far
        self.had_server = False
        self.grace = self.closed = self.late = False
        self.expired = False  # the timer of the deadline has fired
        self.settled, self.returns = 0, returns
        self.guesses = 1  # how often a server may be taken for restarted
        self.told_success = False  # a success was told, and nobody has judged it so far
        self.replacement: Replacement | None = None
        self.replaced_in_time = False  # before its goal had ended
        self.ended_well = False
        self.waited = False  # for confirmations, as long as there was time, or until it was closed
        self.do(self.m.begin(None, self.now))

    def copy(self) -> World:
        twin = copy.copy(self)
        twin.servers = self.servers[:]
        twin.truth = {key: [each[:] for each in goal] for key, goal in self.truth.items()}
        twins: dict[int, Attempt] = {}
        facts: dict[int, Any] = {}
        twin.attempts = []
        for each in self.attempts:
            mine = copy.copy(each)
            mine.goal = copy.copy(each.goal)
            known = facts.get(id(each.goal.facts)) or copy.copy(each.goal.facts)
            facts[id(each.goal.facts)] = mine.goal.facts = known
            twins[id(each)] = mine
            twin.attempts.append(mine)
        m = twin.m = copy.copy(self.m)
        m._new_id = lambda: next(twin.ids)
        twin.ids = iter(uuid.UUID(int=n) for n in range(2 * len(self.truth) + 50, 10**6))
        m.goals = copy.copy(m.goals)
        m.goals._goals = [facts.get(id(each), each) for each in m.goals._goals]
        m.earlier = [twins[id(each)] for each in m.earlier]
        m.attempt = twins.get(id(m.attempt))
        m.previous = twins.get(id(m.previous))
        return twin

    def key(self) -> tuple[Any, ...]:
        m = self.m
        nothing = [[0, NO]] * len(self.servers)
        goals = tuple(each.key(self.truth.get(each.goal_id, nothing)) for each in self.attempts)
        if m.phase is Phase.ENDED:
            return self.settled, self.returns, self.guesses, goals, tuple(self.servers)
        ended = m.ending and (m.ending.end, m.ending.may_run != ())
        last = m._last and m._last.end
        asked = self.asked and (self.asked.end, self.asked.rejected, self.asked.news)
        time = (self.grace, self.late, self.expired)
        flags = (
            time,
            self.closed,
            m.unwanted,
            bool(m.closes_because),
            self.told_success,
            self.replacement,
        )
        waits = (self.pause, self.awaiting, self.queued, m._wait_until, self.hurried)
        waits += (m.attaches, m.seen_running)
        told = (
            self.settled,
            self.returns,
            self.guesses,
            self.ended_well,
            self.waited,
            self.had_server,
        )
        told += (self.replaced_in_time,)
        rest = (m.attempts, waits, told)
        return m.phase, ended, last, asked, flags, rest, goals, tuple(self.servers)

    # --- the driver ------------------------------------------------------------------------

    @property
    def now(self) -> float:
        return DEADLINE + 1 if self.late else 0.0

    @property
    def up(self) -> frozenset[int]:
        return frozenset(s for s, state in enumerate(self.servers) if state == UP)

    def do(self, effects: list[cx.Effect]) -> None:
        m = self.m
        for effect in effects:
            if isinstance(effect, cx.AwaitServer):
                self.awaiting, self.queued = True, False
                self.had_server |= bool(self.up)
                if self.up and not effect.another:
                    self.do(m.server_ready())
            elif isinstance(effect, cx.Queue):
                self.awaiting, self.queued = False, True
            elif isinstance(effect, cx.Send):
                self.queued = False
                self.send()
            elif isinstance(effect, (cx.Judge, cx.Plan)):
                self.asked = effect.ending
            elif isinstance(effect, cx.CutJudging):
                self.grace = True
            elif isinstance(effect, cx.Pause):
                self.pause = True
            elif isinstance(effect, cx.StopRetrying):
                self.asked, self.pause = None, False
                self.awaiting = self.queued = False
            elif isinstance(effect, cx.AwaitEarlier):
                self.grace = True
            elif isinstance(effect, cx.StopAwaiting):
                self.grace = False
            elif isinstance(effect, cx.Finish):
                self.settled += 1
                self.grace = False
                self.check_ending(effect.ending)

    def apply(self, attempt: Attempt, effects: list[fx.Effect]) -> None:
        for effect in effects:
            if isinstance(effect, fx.Record) and attempt.number == 1:
                running = (GoalState.EXECUTING, GoalState.CANCELING)
                self.m.seen_running |= effect.state in running
            elif isinstance(effect, fx.Arm):
                attempt.timers |= {effect.timer} - {fx.Timer.REASK}
            elif isinstance(effect, fx.Disarm):
                attempt.timers -= {effect.timer}
            elif isinstance(effect, fx.AskCancel):
                attempt.asked |= bool(attempt.given_to)
                attempt.asked_now = True
            elif isinstance(effect, fx.Settle):
                attempt.timers = frozenset()
                if attempt is self.m.attempt:
                    self.do(self.m.ended(attempt, effect.ending))
            elif isinstance(effect, fx.LateResult):
                self.do(self.m.late_result(attempt, effect.state, effect.result))
            elif isinstance(effect, fx.Release):
                attempt.released, attempt.timers = True, frozenset()
                self.over()

    def over(self) -> None:
        self.do(self.m.earlier_over())
        if self.up:
            self.do(self.m.server_ready())

    def ready(self, attempt: Attempt) -> None:
        back, goal = attempt.sent_to & self.up, attempt.goal
        if len(attempt.sent_to) > 1:
            back = attempt.sent_to <= self.up
        self.apply(attempt, (goal.server_back if back else goal.server_ready)(self.now))

    # --- what can happen -------------------------------------------------------------------

    def events(self) -> Any:
        m = self.m
        over = m.phase is Phase.ENDED
        for each in self.attempts:
            for timer in sorted(each.timers):
                yield "timer", (each.number, timer)
        if self.queued and self.up:
            for how in ("fine", "fails", "late"):
                yield "turn", how
            if not m.unwanted:
                yield "hurries", None
        if self.awaiting:
            yield "waited", None
            yield "other type", None
        if not over:
            if not self.expired:
                yield "deadline", None
            if not m.unwanted or self.hurried:
                yield "cancel", None
            if self.may_be_replaced and m._replacement is None:
                yield "is replaced", TAKEN
                yield "is replaced", REFUSED
            if not self.closed:
                yield "close", False
                yield "close", True
            else:
                yield "end grace", None
            if self.grace:
                yield "grace", None
        if m.phase is Phase.JUDGING and self.asked:
            if self.asked.end in JUDGED:
                yield "verdict", Verdict.TRANSIENT
                yield "verdict", Verdict.PERMANENT
                if self.asked.end is fx.End.SUCCEEDED:
                    yield "verdict", Verdict.SUCCESS
            else:
                transient = self.asked.end in TRANSIENT
                yield "verdict", Verdict.TRANSIENT if transient else Verdict.PERMANENT
        if m.phase is Phase.PLANNING and self.asked:
            yield "plan", None
        if self.pause:
            yield "resume", None
        for s, state in enumerate(self.servers):
            if state == UP:
                yield "hangs", s
                yield "dies", s
                if self.guesses and len(self.up) > 1 and self.attempts:
                    yield "seems restarted", s
            elif state == ABSENT or (state == HUNG and self.returns):
                yield "comes", s
            if state in (UP, HUNG):
                for key, goal in self.truth.items():
                    for event in self.at_server(key, goal[s], True):
                        yield event, (key, s)

    def at_server(self, key: uuid.UUID, truth: list[Any], up: bool) -> Any:
        undecided, does = truth
        asked = any(each.asked for each in self.attempts if each.goal_id == key)
        if undecided:
            if does == NO:
                yield "accepts unseen"
                if up:
                    yield "accepts"
            yield "drops"
            if up:
                yield "rejects"
        if does in (UNSEEN, SEEN):
            yield "ends unseen"
            if up:
                yield from ("succeeds", "aborts", "is canceled")
                if does == UNSEEN:
                    yield "shows"
                if asked:
                    yield "refuses"
        elif up and does == ENDED:
            yield from ("tells success", "shows success", "forgot")
        if up and does in (NO, STOPPED):
            yield "unknown"

    def number(self, number: int) -> Attempt:
        return next(each for each in self.attempts if each.number == number)

    def happens(self, event: str, arg: Any) -> None:
        m = self.m
        if event == "timer":
            attempt, timer = self.number(arg[0]), arg[1]
            attempt.timers -= {timer}
            self.waited |= timer is fx.Timer.CANCEL
            self.apply(attempt, attempt.goal.timer(timer, self.now))
        elif event == "waited":
            self.do(m.waited(self.now, ready=bool(self.up), cancels=not self.left_alone))
        elif event == "deadline":
            self.late = self.expired = True
            self.give_up(CancelReason.DEADLINE)
        elif event == "other type":
            self.do(m.type_mismatch(("a/action/B",)))
            if m.phase is not Phase.ENDED:
                raise Broken("nobody is told of another type")
        elif event == "turn":
            self.fails = arg == "fails"
            self.late |= arg == "late"  # the timer is about to fire
            self.do(m.turn(self.now))
        elif event == "hurries":
            m.unwanted = self.hurried = True  # the thread will come to it
        elif event == "cancel":
            m.unwanted, self.hurried = True, False
            self.give_up(CancelReason.CANCELLED)
        elif event == "is replaced":
            self.replaced_in_time = m.phase is not Phase.JUDGING
            self.replacement = arg
            self.do(m.replace_by(arg))
        elif event == "close":
            self.closed, m.closes_because = True, "closed"
            self.waited |= arg
            self.give_up(CancelReason.CLOSED, abandon=arg)
        elif event in ("end grace", "grace"):
            self.waited = True
            current = m.attempt
            if m.phase is Phase.JUDGING:
                self.verdict(Verdict.PERMANENT)  # the function was cut short
            elif current is not None:
                self.apply(current, current.goal.timer(fx.Timer.CANCEL, self.now))
            else:
                self.do(m.end_grace("why"))
        elif event == "verdict":
            self.verdict(arg)
        elif event == "plan":
            ending, self.asked = self.asked, None
            too_late = m.attempts >= self.most or self.late
            plan = retry.plan(0.1, ending, m._resend, RetryBudget(), too_late=too_late)
            self.do(m.planned(ending, plan))
        elif event == "resume":
            self.pause = False
            self.do(m.resume(self.now))
            for each in list(m.earlier):
                if each.goal.stage is Stage.LOST and self.up:
                    self.ready(each)
        elif event in ("hangs", "dies", "comes"):
            self.at_graph(event, arg)
        elif event == "seems restarted":
            self.seems_restarted(arg)
        else:
            self.at(event, *arg)

    def give_up(self, why: CancelReason, *, abandon: bool = False) -> None:
        if (current := self.m.attempt) is not None:
            self.apply(current, current.goal.give_up(why, self.now, abandon=abandon))
        elif why is CancelReason.DEADLINE:
            self.do(self.m.waited(self.now, ready=bool(self.up), cancels=not self.left_alone))
        else:
            self.do(self.m.give_up(why))

    def verdict(self, verdict: Verdict) -> None:
        ending, self.asked = self.asked, None
        self.told_success = False
        self.do(self.m.judged(ending, None, verdict))

    def attach(self) -> None:
        m = self.m
        goal = Goal(m.goal_id, Timeouts(feedback=3.0, result=None))
        made = Attempt(m.goal_id, goal, len(self.attempts) + 1)
        made.given_to = made.sent_to = self.up
        self.attempts.append(made)
        m.sent(made)
        self.apply(made, goal.attached(self.now, len(self.up), left_alone=self.left_alone))
        if m.unwanted and m.attempt is made:
            self.give_up(CancelReason.CANCELLED)
        if m.is_late and m.attempt is made:
            self.give_up(CancelReason.DEADLINE)

    def send(self) -> None:
        m = self.m
        if m.attaches and not self.fails:
            self.attach()
            return
        if self.fails:
            self.do(m.send_failed(ValueError()))
            return
        if m.unwanted or m.closes_because or m.ending:
            raise Broken("sent though nobody wants it")
        if self.replacement is not None:
            raise Broken("sent though another goal was sent in its place (C1.15)")
        if self.told_success:
            raise Broken("sent though an earlier goal has succeeded (C4.3)")
        succeeded = (e.goal.awaits_result_of is GoalState.SUCCEEDED for e in self.attempts)
        if m._resend != "always" and any(succeeded):
            raise Broken("sent while the result of an earlier goal may come (C4.3)")
        for goal in self.truth.values():
            there = [may_run(*t) for t in goal]
            if m._resend == "always" or not any(there):
                continue
            if m._resend != "server_gone" or any(t and s in self.up for s, t in enumerate(there)):
                raise Broken("sent while an earlier goal may run (C4.2)")
        if m.goal_id in self.truth:
            raise Broken("an id is sent twice (R5)")
        if not self.up or self.late:
            raise Broken("sent where no server is, or no time is left")
        truth = self.truth[m.goal_id] = [[0, NO] for _ in self.servers]
        for s in self.up:
            truth[s][0] += 1
        goal = Goal(m.goal_id, Timeouts(feedback=3.0, result=None))
        made = Attempt(m.goal_id, goal, len(self.attempts) + 1)
        made.given_to = made.sent_to = self.up
        self.attempts.append(made)
        m.sent(made)
        self.apply(made, goal.sent(self.now, len(made.sent_to)))

    def at_graph(self, event: str, s: int) -> None:
        before = self.up
        self.returns -= self.servers[s] == HUNG and event == "comes"
        self.servers[s] = {"hangs": HUNG, "dies": DEAD, "comes": UP}[event]
        up = self.up
        self.had_server |= bool(up)
        if event == "dies":
            for goal in self.truth.values():
                goal[s][:] = [0, STOPPED if goal[s] != [0, NO] else NO]
        for each in list(self.attempts):
            if each.released:
                continue
            servers, away = len(each.given_to), len(each.given_to - up)
            self.apply(each, each.goal.servers_changed(servers, away))
            if event == "comes":
                self.ready(each)
            elif s in each.given_to & before and not each.sent_to & up:
                self.apply(each, each.goal.server_lost("gone", self.now))
                self.over()
                if up:
                    self.apply(each, each.goal.server_ready(self.now))
        if event == "comes" and self.awaiting:
            self.do(self.m.server_ready())
        elif self.queued and not up:
            self.do(self.m.server_lost(self.now))

    def seems_restarted(self, s: int) -> None:
        """It is busy, and the other servers on nodes of its name answer."""
        self.guesses -= 1
        for each in list(self.attempts):
            if not each.released and each.sent_to & self.up == {s}:
                each.sent_to -= {s}
                self.apply(each, each.goal.server_lost("it seems restarted", self.now))
                self.over()
                self.apply(each, each.goal.server_ready(self.now))

    def at(self, event: str, key: uuid.UUID, s: int) -> None:
        truth, now = self.truth[key][s], self.now
        heard = [e for e in self.attempts if e.goal_id == key and not e.released]
        listener = heard[-1] if heard else None
        goal = listener and listener.goal
        others = [t for i, t in enumerate(self.truth[key]) if i in self.up and i != s]
        everybody = all(t[1] in (NO, STOPPED) for t in others)  # none waits for its end
        # What comes from one that is out of sight was asked before that.
        asked_at = now + 9 if s in self.up else now - 9
        tell: Any = None
        if event in ("accepts", "accepts unseen"):
            truth[0] -= 1
            truth[1] = SEEN if event == "accepts" and goal else UNSEEN
            tell = event == "accepts" and goal and (lambda: goal.accepted(now))
        elif event in ("drops", "rejects"):
            truth[0] -= 1
            tell = event == "rejects" and goal and (lambda: goal.rejected(now))
        elif event == "shows":
            truth[1] = SEEN
            tell = goal and (lambda: goal.status(GoalState.EXECUTING, now, ours=True))
        elif event == "ends unseen":
            truth[1] = ENDED
        elif event == "shows success":
            tell = goal and (lambda: goal.status(GoalState.SUCCEEDED, now, ours=True))
        elif event == "refuses":
            truth[1] = SEEN
            answer = CancelAnswer.REFUSED
            tell = goal and (lambda: goal.cancel_answered(answer, now, asked_at=asked_at))
        elif event in ("unknown", "forgot"):
            if event == "forgot":
                truth[1] = STOPPED
                if listener:
                    listener.told_end |= {s}
            # Else another one is asked, and the link tells nobody.
            own = bool(listener and listener.sent_to & self.up)
            tell = (
                goal
                and everybody
                and (lambda: goal.result(None, None, now, asked_at=asked_at, own=own))
            )
        else:
            truth[1] = STOPPED
            states = {"aborts": GoalState.ABORTED, "is canceled": GoalState.CANCELED}
            state = states.get(event, GoalState.SUCCEEDED)
            if goal and goal.in_flight:
                self.ended_well |= state is GoalState.SUCCEEDED
                self.told_success |= (
                    state is GoalState.SUCCEEDED and self.m.phase is not Phase.ENDED
                )
                ours = listener.cancel_is_ours
                listener.told_end |= {s}
                told = {"ours": ours, "everybody": everybody, "ends": len(listener.told_end)}
                tell = lambda: goal.result(state, 1, now, asked_at=asked_at, **told)  # noqa: E731
        if tell and event == "accepts":
            listener.shown |= {s}
        if tell:
            listener.asked_now = False
            seen = goal.stage is not Stage.LOST
            self.apply(listener, tell())
            if seen and goal.stage is Stage.LOST:
                self.over()
        if tell and event == "accepts" and not listener.released and not listener.asked_now:
            gave_up = self.m.unwanted and not self.hurried
            if gave_up or listener is not self.m.attempt:
                raise Broken("a server takes a goal that nobody wants, and is not asked to cancel")

    # --- what must hold --------------------------------------------------------------------

    def check_ending(self, ending: fx.Ending) -> None:
        left = {key for key in self.truth if any(self.there(key)) and not self.is_guess(key)}
        gave_up = ending.phase == "cancel" or ending.end in (
            fx.End.CANCELLED_BY_CALLER,
            fx.End.REPLACED,
            fx.End.CLOSED,
        )
        confirming = any(e.goal.may_run and not e.released for e in self.attempts)
        if gave_up and confirming and not self.waited:
            raise Broken("it ended before a server in sight could confirm that all goals stopped")
        if ending.phase == "cancel" and not ending.lost_because and not self.waited:
            raise Broken("its text says that a server was waited for, and nobody waited")
        earlier_call = 1 if self.rejoins and not self.m.attaches else 0
        if ending.end is fx.End.NO_SERVER and (self.attempts[earlier_call:] or self.up):
            raise Broken("there was a server (C2.7)")
        cancels = self.attaches and ending.phase == "cancel"
        if ending.end is fx.End.DEADLINE and not (self.had_server or cancels):
            raise Broken("the deadline's error, and there was no server (C2.7)")
        if ending.end is fx.End.SUCCEEDED and not self.ended_well:
            raise Broken("a failure became a success")
        if ending.end is fx.End.CANCELLED_BY_CALLER and left:
            raise Broken("CancelledError, and a goal may run")
        if ending.end is fx.End.REPLACED and (left or self.replacement is not TAKEN):
            raise Broken("replaced, and it may run, or no other goal has taken its place")
        taken = self.replacement is TAKEN and self.replaced_in_time
        if ending.end is fx.End.ABORTED and taken:
            raise Broken("it looks like a failure, and it was replaced (C1.15)")
        if ending.end is fx.End.REJECTED and self.m.goal_id in left:
            raise Broken("rejected, it never ran; but it may run")
        if left - set(ending.may_run):
            raise Broken("a goal may run, and the error does not name it")
        if left and ending.cancel in (CancelReport.NOT_NEEDED, CancelReport.CONFIRMED):
            raise Broken(f"{ending.cancel}, and a goal may run")

    def there(self, key: uuid.UUID) -> list[bool]:
        """Return for each server whether it runs a goal or may yet take it.

        Of a goal that is attached to, those count that were asked about it.
        """
        told = [e.sent_to for e in self.attempts if e.goal_id == key]
        asked = told[-1] if told and self.attaches else range(0 if self.attaches else 99)
        return [may_run(*t) and s in asked for s, t in enumerate(self.truth[key])]

    def is_guess(self, key: uuid.UUID) -> bool:
        """One that is over for its caller by what one server said, and no other has accepted it.

        No answer names its server. So where one has told its end whose acceptance was lost, another
        that has accepted it counts as that one.
        """
        mine = [each for each in self.attempts if each.goal_id == key][-1]
        facts, unseen = mine.goal.facts, len(mine.shown) <= len(mine.told_end)
        return (facts.ended or facts.rejected) and not facts.given_up and unseen

    def check(self, *, ends: bool = True) -> None:
        running = 0
        for key, goal in self.truth.items():
            there = self.there(key)
            mine = [each for each in self.attempts if each.goal_id == key]
            if not mine:
                continue  # not attached to it so far
            if self.left_alone and mine[-1].asked and not self.m.unwanted:
                raise Broken("a goal is cancelled that was to be left alone (C1.16)")
            running += any(t[1] in (UNSEEN, SEEN) for t in goal)
            if self.is_guess(key):
                continue
            facts = mine[-1].goal.facts
            if any(there) and not facts.may_run:
                raise Broken("a goal may run, and is not reported")
            if any(there) and all(e.released for e in mine) and not facts.left:
                raise Broken("a goal may run, and is forgotten")
            seen = any(t[1] == SEEN and s in self.up for s, t in enumerate(goal))
            given_up = self.m.phase is Phase.ENDED or mine[-1] is not self.m.attempt
            if seen and given_up and not facts.left and not any(e.asked for e in mine):
                raise Broken("a goal runs, nobody wants it, and it is not cancelled (C2.4)")
        if self.m._resend in ("never_accepted", "confirmed_stopped") and running > 1:
            raise Broken("two goals of one call run at the same time")
        if self.settled != (self.m.phase is Phase.ENDED):
            raise Broken(f"it has ended {self.settled} times in {self.m.phase}")
        m = self.m
        if (self.awaiting, self.queued) != (m.phase is Phase.WAITING, m.phase is Phase.QUEUED):
            raise Broken("a wait is forgotten")
        if self.expired and m.attempt and m.attempt.goal.cancel_reason is None:
            raise Broken("the deadline has passed, and the goal is still wanted (C2.3)")
        if self.queued and not self.up:
            raise Broken("it waits for its turn, and no server is there")
        if self.awaiting and self.up and m.may_send() and not (self.hurried or self.late):
            raise Broken("it waits for a server that is there")
        if ends:
            self.check_that_it_ends()

    def check_that_it_ends(self) -> None:
        """From here it ends by its own clock, whatever servers do not say."""
        world = self.copy()
        for _ in range(12):
            m = world.m
            if m.phase is Phase.ENDED:
                return
            world.late = True
            timers = [(e.number, t) for e in world.attempts for t in e.timers]
            if m.phase is Phase.JUDGING:
                world.verdict(Verdict.PERMANENT)
            elif m.phase is Phase.PLANNING:
                world.happens("plan", None)
            elif world.pause:
                world.happens("resume", None)
            elif not world.expired:
                world.happens("deadline", None)
            elif world.grace:
                world.happens("grace", None)
            elif timers:
                timer = next((t for t in timers if t[1] is fx.Timer.CANCEL), timers[0])
                world.happens("timer", timer)
            else:
                break
        if world.m.phase is not Phase.ENDED:
            raise Broken(f"it does not end: {world.m.phase}")


class Replaced(World):
    """Another goal may be sent in its place."""

    may_be_replaced = True


class Refused(World):
    """Each server was sent the goal, and the first one refuses to cancel it."""

    def __init__(self, resend: str, attempts: int, servers: int) -> None:
        super().__init__(resend, attempts, servers)
        for server in range(servers):
            self.happens("comes", server)
        self.happens("turn", "fine")
        self.happens("cancel", None)
        for event in ("accepts unseen", "refuses", "refuses"):
            self.happens(event, (self.m.goal_id, 0))


class Attached(World):
    """The call follows a goal that somebody else has sent, and that it cancels when it gives up."""

    attaches = True


class Rejoined(Attached):
    """An earlier call with its key has sent the goal; another one is sent if that has failed."""

    rejoins = True


class LeftAlone(Attached):
    """The same, but it lets the goal run when it gives up."""

    left_alone = True


def explore(
    resend: str, attempts: int, servers: int, most: int = 2_000_000, kind: type[World] = World
) -> tuple[int, int]:
    """Return how many states and transitions there are."""
    return exploring.explore(kind(resend, attempts, servers), most)


def _weight(event: tuple[str, Any]) -> float:
    """Let a walk be long: what ends a call comes seldom."""
    name, arg = event
    if name == "timer":
        return 0.3
    if name in ("waited", "deadline", "other type", "hurries") or arg in ("fails", "late"):
        return 0.01
    if name in ("turn", "plan", "resume") or arg is Verdict.TRANSIENT:
        return 4.0  # the goals of one call meet
    if name == "is replaced":
        return 0.5
    ends = name in ("cancel", "close", "end grace", "grace", "dies")
    return 0.02 if ends or arg in (Verdict.PERMANENT, Verdict.SUCCESS) else 1.0


def hunt(
    resend: str,
    attempts: int,
    servers: int,
    walks: int,
    seed: int = 0,
    kind: type[World] = World,
) -> int:
    """Walk at random, deeper than all states can be visited; return how many steps it were."""
    chance, steps = random.Random(seed), 0
    for _ in range(walks):
        world, way = kind(resend, attempts, servers), []
        while len(way) < LONGEST_WALK and (events := list(world.events())):
            ((event, arg),) = chance.choices(events, list(map(_weight, events)))
            way.append(exploring.step_of((event, arg)))
            steps += 1
            try:
                world.happens(event, arg)
                world.check(ends=len(way) % 8 == 0)  # that takes longer than all others
            except Broken as problem:
                raise Broken(f"{problem}\n   after: " + "; ".join(way)) from None
    return steps


if __name__ == "__main__":
    import sys
    import time

    case = (sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4]))
    began = time.process_time()
    print(case, explore(*case), f"{time.process_time() - began:.1f} s")
