"""Visits every state that one goal and its servers can reach, and checks the promises in each.

The goal's machine is the real one. Beside it stands the truth: what each server does with the goal.
Around it, `World` does what an attempt and its link do. Time is only an order: each armed timer may
fire at any time, and an answer may come late.

`python -m tests.unit.explore_goal 2 30000 attach` prints how many states and transitions there are.
"""

from __future__ import annotations

import copy
import random
import uuid
from dataclasses import astuple, dataclass, replace
from typing import Any, NamedTuple

from actionkit import CancelReport, Timeouts
from actionkit._goal import effects as fx
from actionkit._goal.machine import Goal
from actionkit._goal.stages import CONFIRMED_AFTER, CancelReason, Stage
from actionkit._model.cancel_answer import CancelAnswer
from actionkit._model.values import GoalState
from tests.unit.exploring import Broken, explore, step_of

NONE, TAKING, RUNS, CANCELING, ENDED, CANCELED, FORGOTTEN = "-trceCf"
"""What a server does with the goal. While one of its threads takes it, the others do not know it
(R12)."""
HERE = (TAKING, RUNS, CANCELING)
STATES = {
    TAKING: GoalState.ACCEPTED,
    RUNS: GoalState.EXECUTING,
    CANCELING: GoalState.CANCELING,
    ENDED: GoalState.SUCCEEDED,
    CANCELED: GoalState.CANCELED,
}
ABSENT, UP, HUNG, DEAD = "aUHD"
"""Where a server is: it comes later, in sight, out of sight and working, dead."""
YES, NO = "yn"
"""An answer to the request for the goal."""
AT_ONCE = 2
"""Requests of a kind with answers that may still come; older ones were lost with their answers."""
PAUSES = (4, 8, 30, 60, 120, 240, 300)
"""Pauses between requests, from which on the goal's machine does something else."""
LONGEST_WALK = 60
NOT_IN_KEY = ("facts", "_timeouts", "_reask_after", "_waiting_end", "_phase", "state", "_latest")
NOBODY: frozenset[int] = frozenset()


class Server(NamedTuple):
    """One server: what it does, and what of that has come to our side."""

    graph: str = UP
    undecided: bool = True  # it has the request for the goal, and has not looked at it
    does: str = NONE
    answer: str = ""  # to the request for the goal, on its way
    said_yes: bool = False  # its acceptance has come
    shown: bool = False  # something has come that shows that it has the goal
    asked: bool = False  # to cancel the goal, since it has it and since the caller gave up
    told_end: bool = False
    taking: int = (
        0  # events since it began to take it: of 0.1 s, so together less than `CONFIRMED_AFTER`
    )


class Request(NamedTuple):
    """One request for the result, or to cancel the goal; as in `_ros.sending.requests`."""

    at: float
    sent_to: frozenset[int]
    waiting: frozenset[int]  # servers that have not answered it
    unknown: frozenset[int] = NOBODY  # those with the answer "unknown goal" on its way
    heard: int = 0
    knowing: int = 0
    outdated: bool = False


@dataclass
class World:
    """The truth, with the goal's machine in it."""

    goal: Goal
    servers: list[Server]
    due: frozenset[fx.Timer] = frozenset()
    now: float = 0.0
    results: tuple[Request, ...] = ()
    cancels: tuple[Request, ...] = ()
    cancelling: bool = False  # its cancellation is asked for until it is answered
    cancel_at: float = 0.0  # when the machine last asked for that
    sent_cancels: int = 0  # as `Attempt._cancels`
    first_cancel_at: float = 0.0
    # The servers that may have it, as in `_ros.servers_in_sight.monitor`.
    staying: frozenset[int] = NOBODY
    sent_to: frozenset[int] = NOBODY
    given_to: frozenset[int] = NOBODY
    were_given: frozenset[int] = NOBODY
    """Those, and the ones that were out of sight when it was taken back."""
    was_away: bool = False
    """Whether one of its servers was out of sight when it was taken back. It is not known whether
    that one has come back, so it stays lost."""
    settled: int = 0
    released: bool = False
    gave_up: frozenset[CancelReason] = frozenset()
    left_alone: bool = False
    hangs: int = 1  # how many more servers may go out of sight, or die
    guesses: int = 1  # how often a server may be taken for restarted, or for silent
    silent: bool = False

    def copy(self) -> World:
        goal = copy.copy(self.goal)
        goal.facts = copy.copy(goal.facts)
        return replace(self, goal=goal, servers=self.servers[:])

    def key(self) -> tuple[Any, ...]:
        goal, forgotten = self.goal, self.goal._forgotten_at
        mine = [
            (value is None) if name.endswith("_at") else value
            for name, value in vars(goal).items()
            if name not in NOT_IN_KEY
        ]
        forgotten = self.now if forgotten is None else forgotten
        limit = goal._timeouts.accept
        times = (
            sum(goal._reask_after >= pause for pause in PAUSES),
            limit is not None and self.now >= goal._shown_at + limit,
            [
                (
                    r.at >= goal._shown_at + CONFIRMED_AFTER,
                    r.at >= forgotten + CONFIRMED_AFTER,
                    r[1:],
                )
                for r in self.results
            ],
            [
                (
                    r.at >= goal._shown_at,
                    r.at >= goal._asked_all_at,
                    r.at >= forgotten + CONFIRMED_AFTER,
                    r.at >= goal._refused_at + CONFIRMED_AFTER,
                    r.at >= self.cancel_at,
                    r.at <= self.first_cancel_at,
                    r[1:],
                )
                for r in self.cancels
            ],
        )
        driver = (
            self.due,
            self.cancelling,
            min(self.sent_cancels, 2),
            (self.staying, self.sent_to, self.given_to),
            (self.settled, self.released, self.gave_up, self.silent),
            (self.hangs, self.guesses, self.was_away),
        )
        held = goal._waiting_end and goal._waiting_end[0]
        return (*mine, held, astuple(goal.facts)[1:], repr(times), driver, tuple(self.servers))

    # --- the driver: `_calls.sending.attempt` -----------------------------------------------------

    def apply(self, effects: list[fx.Effect]) -> None:
        for effect in effects:
            if isinstance(effect, fx.Arm):
                self.due |= {effect.timer}
            elif isinstance(effect, fx.Disarm):
                self.due -= {effect.timer}
            elif isinstance(effect, fx.AskResult):
                self.ask_result(anew=effect.anew)
            elif isinstance(effect, fx.AskCancel):
                self.ask_cancel()
            elif isinstance(effect, fx.StopCancel):
                self.cancelling = False
            elif isinstance(effect, fx.Settle):
                self.settled += 1
                self.due &= {fx.Timer.REASK}
                self.check_ending(effect.ending)
            elif isinstance(effect, fx.Release):
                self.due, self.released, self.cancelling = frozenset(), True, False
                self.results = self.cancels = ()

    def tell(self, event: str, *args: Any, **told: Any) -> None:
        """Tell the goal, if it is still in the link's table."""
        if self.released:
            return
        self.speaks()
        seen = self.goal.stage is not Stage.LOST
        self.apply(getattr(self.goal, event)(*args, **told))
        if seen and self.goal.stage is Stage.LOST:
            self.cancelling = False  # `_look_whether_lost`

    def speaks(self) -> None:
        """As `Liveness.heard`: something came from a server."""
        if self.silent:
            self.silent = False
            self.ready()

    def give_up(self, why: CancelReason, *, abandon: bool = False) -> None:
        goal = self.goal
        if goal.settled or goal.cancel_reason is None:  # so it is to be asked again
            for i, server in enumerate(self.servers):
                if server.does in (RUNS, TAKING):
                    self.change(i, asked=False)
        self.gave_up |= {why}
        self.apply(goal.give_up(why, self.now, abandon=abandon))

    def accepted(self) -> None:
        if not self.released:
            self.tell("accepted", self.now)
        elif not self.goal.abandoned:
            self.take_back(self.goal)

    def take_back(self, earlier: Goal) -> None:
        """As `Session._take_back`."""
        self.goal, self.released = Goal(earlier.facts.goal_id, earlier._timeouts), False
        self.staying = self.sent_to = self.given_to = self.up
        self.sent_cancels = 0
        self.was_away = earlier.facts.away > 0
        self.apply(self.goal.taken_back(earlier.facts, len(self.up), self.now))

    def lose(self, reason: str) -> None:
        if not self.released:
            self.apply(self.goal.server_lost(reason, self.now))
            if self.goal.stage is Stage.LOST:
                self.cancelling = False

    def ready(self) -> None:
        """As `on_server_ready`, for the goals of `ServerMonitor.tell_sent_goals`."""
        if self.released or not (self.staying or self.given_to & self.up):
            return
        facts = self.goal.facts
        back = self.sent_to & self.up and not (facts.servers > 1 and facts.away)
        self.apply((self.goal.server_back if back else self.goal.server_ready)(self.now))

    # --- the driver: `_ros.sending.requests`, `_ros.cancelling.cancels`, `_ros.sending.link` ------

    @property
    def up(self) -> frozenset[int]:
        return frozenset(i for i, server in enumerate(self.servers) if server.graph == UP)

    def change(self, i: int, **fields: Any) -> None:
        self.servers[i] = self.servers[i]._replace(**fields)

    def ask_result(self, *, anew: bool) -> None:
        earlier = self.results
        if anew:
            earlier = tuple(request._replace(outdated=True) for request in earlier)
        if up := self.up:
            earlier = (*earlier, Request(self.now, up, up))
        self.results = earlier[-AT_ONCE:]

    def ask_cancel(self) -> None:
        if self.released:
            return
        self.cancelling, self.cancel_at = True, self.now
        if not (self.cancels and self.cancels[-1].waiting & self.up):
            self.send_cancel()  # else it is repeated once that one was answered, or later

    def send_cancel(self) -> None:
        if not self.sent_cancels:
            self.first_cancel_at = self.now
        self.sent_cancels += 1
        if up := self.up:
            self.cancels = (*self.cancels, Request(self.now, up, up))[-AT_ONCE:]
        for i in up:
            if self.servers[i].does in HERE:
                self.change(i, asked=True)

    def answered(self, kind: str, i: int, number: int, *, knows: bool) -> tuple[Request, bool]:
        """Count an answer; return its request, and whether each server in sight has answered."""
        requests = list(getattr(self, kind))
        was = requests[number]
        now = requests[number] = was._replace(
            waiting=was.waiting - {i},
            unknown=was.unknown - {i},
            heard=was.heard + 1,
            knowing=was.knowing + knows,
        )
        everybody = now.heard >= len(now.sent_to | self.up)
        if everybody or not (now.waiting or now.unknown):
            del requests[number]
        setattr(self, kind, tuple(requests))
        return now, everybody

    def answers_result(self, i: int, number: int, state: GoalState | None) -> None:
        # As in `Link._take_result`: what speaks again is asked anew first.
        asked_anew = self.silent and self.goal.stage is Stage.LOST
        ended = state is not None
        self.change(i, told_end=self.servers[i].told_end or ended)
        request, everybody = self.answered("results", i, number, knows=ended)
        outdated = request.outdated or asked_anew
        if not ended and ((not everybody and len(self.up) > 1) or outdated):
            self.speaks()
            return
        self.tell(
            "result",
            state,
            None,
            self.now,
            asked_at=request.at,
            ours=self.sent_cancels > 0,
            own=bool(self.sent_to & self.up),
            everybody=everybody and not outdated,
            ends=request.knowing,
            answers=request.heard,
        )

    def answers_cancel(self, i: int, number: int, answer: CancelAnswer) -> None:
        unknown = answer is CancelAnswer.UNKNOWN_GOAL
        own = bool(self.sent_to & self.up)
        elsewhere = unknown and own and len(self.up) > 1
        request, everybody = self.answered("cancels", i, number, knows=not unknown)
        if elsewhere and (request.knowing or not everybody):
            return
        if not unknown and (answer is CancelAnswer.ACCEPTED or request.at >= self.cancel_at):
            self.cancelling = False
        seems_replaced = self.given_to & self.up and not self.sent_to & self.up
        if unknown and not seems_replaced:
            self.sent_cancels = max(0, self.sent_cancels - 1)
        first = self.sent_cancels == 1 or request.at <= self.first_cancel_at
        if answer is CancelAnswer.TERMINATED and first and self.goal.facts.servers == 1:
            self.sent_cancels = max(0, self.sent_cancels - 1)
        self.tell("cancel_answered", answer, self.now, asked_at=request.at, own=own)

    # --- what can happen -------------------------------------------------------------------

    def events(self) -> list[tuple[str, Any]]:
        found: list[tuple[str, Any]] = []
        for i, server in enumerate(self.servers):
            if server.taking >= 2 and server.does == TAKING:
                return [(event, i) for event in self.of_server(i, server) if "accepts" in event]
        if not self.released:
            found += self.of_caller()
            # A server in sight that has answered for a minute has read the request.
            unread = any(s.undecided and s.graph == UP for s in self.servers)
            too_soon = unread and self.goal._reask_after >= 30
            for timer in sorted(self.due):
                if timer is not fx.Timer.REASK:
                    found.append(("timer", timer))
                elif not too_soon:
                    found += [("timer", timer), ("long silence", None)]
            if self.cancelling and self.up:
                found.append(("cancel again", None))
            if self.silent and self.up:
                found.append(("is not silent any more", None))
        for i, server in enumerate(self.servers):
            found += ((event, i) for event in self.of_server(i, server))
            if server.undecided and self.goal._reask_after >= 30:
                continue  # it reads the goal's request before one that is a minute younger
            for kind, requests in (("result", self.results), ("cancel", self.cancels)):
                for number, request in enumerate(requests):
                    if i in request.waiting and server.graph == UP:
                        found += ((e, (i, number)) for e in self.answers(kind, server))
                    if i in request.unknown and server.graph == UP:
                        found.append((f"{kind}: the late answer comes", (i, number)))
        return found

    def of_caller(self) -> list[tuple[str, Any]]:
        goal, found = self.goal, []
        if goal.settled or goal.cancel_reason is None:
            found.append(("give up", CancelReason.CANCELLED))
            if not goal.settled:
                found.append(("leave", CancelReason.CLOSED))
        for why in (CancelReason.DEADLINE, CancelReason.CLOSED):
            if why not in self.gave_up:
                found.append(("give up", why))
        return found

    def of_server(self, i: int, server: Server) -> list[str]:
        found: list[str] = []
        graph, does = server.graph, server.does
        if graph == DEAD:
            return found
        if graph == ABSENT:
            return ["comes"]
        if server.undecided:
            found += ["accepts unseen", "rejects unseen"]
            found += ["accepts", "takes", "rejects"] if graph == UP else []
        elif does == TAKING:
            found += ["accepts unseen"]
            found += ["accepts"] if graph == UP else []
        elif does in HERE:
            found.append("ends")
        elif does in STATES:
            found.append("forgets")
        if server.answer and graph == UP:
            found.append("its answer comes")
        if graph == UP and does in STATES and not self.released:
            found.append("status")
        if graph == UP and self.hangs:
            found += ["hangs", "dies"]
        if graph == HUNG:
            found += ["comes", "dies"]
        if graph == UP and self.guesses and not self.released:
            if not self.silent and self.goal.stage is not Stage.LOST:
                found.append("is silent")
            if i in self.staying and self.up - self.staying:
                found.append("seems restarted")
        return found

    def answers(self, kind: str, server: Server) -> list[str]:
        """What it can answer to a request that waits for it."""
        does = server.does
        if kind == "result":
            if does in (RUNS, CANCELING):
                return []  # it answers when the goal has ended
            ended = does in (ENDED, CANCELED)
            return ["result"] if ended else ["result", "result: the answer is late"]
        found = ["answers cancel"]
        if does in (RUNS, ENDED):
            found.append("refuses to cancel")
        elif does == TAKING:
            found.append("calls it ended")  # micro-ROS
        elif does == NONE:
            found.append("cancel: the answer is late")
        return found

    def happens(self, event: str, arg: Any) -> None:
        taking = [i for i, server in enumerate(self.servers) if server.does == TAKING]
        self.now += 0.1 if taking or event == "takes" else 1.0
        for i in taking:
            self.change(i, taking=self.servers[i].taking + 1)
        if event in ("give up", "leave"):
            self.give_up(arg, abandon=event == "leave")
        elif event == "timer":
            self.fire(arg)
        elif event == "long silence":
            self.long_silence()
        elif event == "cancel again":
            self.send_cancel()
        elif event == "is not silent any more":
            self.speaks()
        elif event in ("hangs", "dies", "comes", "is silent", "seems restarted"):
            self.at_graph(event, arg)
        elif isinstance(arg, tuple):
            self.answer(event, *arg)
        else:
            self.at(event, arg)

    def fire(self, timer: fx.Timer) -> None:
        self.due -= {timer}
        self.apply(self.goal.timer(timer, self.now))

    def long_silence(self) -> None:
        """Fire the timer until the pause is one of the next kind."""
        goal = self.goal
        longer = min((pause for pause in PAUSES if pause > goal._reask_after), default=0)
        for _ in range(6):
            if fx.Timer.REASK not in self.due or goal._reask_after >= longer:
                break
            self.fire(fx.Timer.REASK)

    def at(self, event: str, i: int) -> None:
        server = self.servers[i]
        if event == "takes":
            self.change(i, undecided=False, does=TAKING)
        elif event in ("accepts", "accepts unseen", "rejects", "rejects unseen"):
            yes = event.startswith("accepts")
            does = RUNS if yes else NONE
            answer = YES if yes else NO
            attached = self.goal.facts.attached  # then the answer goes to somebody else
            self.change(i, undecided=False, does=does, answer="" if attached else answer)
            if not event.endswith("unseen") and not attached:
                self.answer_comes(i)
        elif event == "its answer comes":
            self.answer_comes(i)
        elif event == "ends":
            self.change(i, does=CANCELED if server.does == CANCELING else ENDED)
        elif event == "forgets":
            self.change(i, does=FORGOTTEN)
        elif event == "status":
            # No status names its server: it shows this one if no other has shown that it has it.
            unproven = self.goal.stage in (Stage.SENT, Stage.LOST)
            self.change(i, shown=server.shown or unproven)
            self.tell("status", STATES[server.does], self.now, ours=self.sent_cancels > 0)

    def answer_comes(self, i: int) -> None:
        server = self.servers[i]
        if server.answer == YES:
            self.change(i, answer="", said_yes=True, shown=True)
            self.accepted()
        else:
            self.change(i, answer="")
            self.tell("rejected", self.now)

    def answer(self, event: str, i: int, number: int) -> None:
        server, kind = self.servers[i], "cancels" if "cancel" in event else "results"
        if event.endswith("the answer is late"):
            requests = list(getattr(self, kind))
            was = requests[number]
            requests[number] = was._replace(waiting=was.waiting - {i}, unknown=was.unknown | {i})
            setattr(self, kind, tuple(requests))
        elif event == "result: the late answer comes":
            self.answers_result(i, number, None)
        elif event == "cancel: the late answer comes":
            self.answers_cancel(i, number, CancelAnswer.UNKNOWN_GOAL)
        elif event == "result":
            state = STATES[server.does] if server.does in (ENDED, CANCELED) else None
            self.change(i, shown=server.shown or state is not None)
            self.answers_result(i, number, state)
        else:
            here = server.does in HERE
            self.change(i, shown=server.shown or server.does in STATES, asked=server.asked or here)
            if event == "calls it ended" or server.does in (CANCELING, CANCELED):
                answer = CancelAnswer.TERMINATED
            elif event == "refuses to cancel" or server.does == TAKING:
                answer = CancelAnswer.REFUSED
            elif server.does == RUNS:
                answer = CancelAnswer.ACCEPTED
                self.change(i, does=CANCELING)
            else:
                ended = server.does == ENDED
                answer = CancelAnswer.TERMINATED if ended else CancelAnswer.UNKNOWN_GOAL
            self.answers_cancel(i, number, answer)

    def at_graph(self, event: str, i: int) -> None:
        if event == "is silent":
            self.guesses -= 1
            self.lose("its server answered nothing for 3 s")
            self.silent = True
            return
        if event == "seems restarted":
            self.guesses -= 1
            self.change(i, shown=False)
            self.sent_to -= {i}
            self.staying -= {i}
            if not self.staying:
                self.lose("it seems restarted")
            self.ready()
            return
        before = self.up
        self.hangs -= before >= {i}
        self.change(i, graph={"hangs": HUNG, "dies": DEAD, "comes": UP}[event])
        if event == "dies":
            self.change(i, undecided=False, does=NONE, answer="")
        if event != "comes":
            for kind in ("results", "cancels"):
                left = [
                    request._replace(waiting=request.waiting - {i}, unknown=request.unknown - {i})
                    for request in getattr(self, kind)
                ]
                setattr(self, kind, tuple(r for r in left if r.waiting or r.unknown))
        elif self.servers[i].undecided and i not in self.given_to:
            # It was sent the goal before it was in sight: `ServerMonitor._reconsider`.
            if self.staying and not (self.released or self.goal.facts.over):
                self.staying |= {i}
                self.sent_to |= {i}
                self.given_to |= {i}
            else:  # it was not, because a server does not come and go so fast
                self.change(i, undecided=False)
        up = self.up
        if up == before:
            return
        if not self.released:
            away = len(self.given_to - up)
            self.apply(self.goal.servers_changed(max(1, len(self.given_to)), away))
        if event == "comes":
            self.ready()
            return
        self.staying -= {i}
        if not self.staying or not up:
            self.lose("its action server is gone")
        if not self.staying and up:
            self.ready()

    # --- what must hold --------------------------------------------------------------------

    @property
    def is_guess(self) -> bool:
        """Whether it is over for its caller by what one server said, and no other has accepted it.

        No answer names its server. So where one has told its end whose acceptance was late, another
        that has accepted it counts as that one.
        """
        facts, servers = self.goal.facts, self.servers
        unseen = sum(s.said_yes for s in servers) <= sum(s.told_end for s in servers)
        return (facts.ended or facts.rejected) and not facts.given_up and unseen

    def check_ending(self, ending: fx.Ending) -> None:
        runs = any(s.does in HERE and s.shown for s in self.servers)
        if not runs or self.is_guess or self.goal.facts.left:
            return
        if ending.own_cancel in (CancelReport.NOT_NEEDED, CancelReport.CONFIRMED):
            raise Broken(f"{ending.own_cancel}, and it runs")

    def check(self) -> None:
        goal, facts = self.goal, self.goal.facts
        self.were_given |= self.given_to
        ours = [server for i, server in enumerate(self.servers) if i in self.were_given]
        runs = any(server.does in HERE for server in ours)
        excused = self.is_guess
        shown = any(s.does in HERE and s.shown for s in ours) and not excused
        if facts.is_over and (runs or any(server.undecided for server in ours)):
            raise Broken("it is over, and a server runs it or may accept it")
        if facts.known_to_run is False and runs and (shown or facts.given_up):
            raise Broken("known not to run, and it runs")
        if self.released and shown and not facts.left:
            raise Broken("it runs, and nobody keeps it")
        excused = excused or facts.left
        for i, server in enumerate(self.servers):
            here = i in self.sent_to and server.graph == UP and server.shown
            here = here and server.does in (RUNS, TAKING)
            cared_for = excused or self.cancelling or server.asked
            cared_for = cared_for or any(i in request.waiting for request in self.cancels)
            if here and goal.unwanted and not (cared_for or self.silent):
                raise Broken("it runs in sight, nobody wants it, and it is not cancelled (C2.4)")
        if self.left_alone and self.sent_cancels and CancelReason.CANCELLED not in self.gave_up:
            raise Broken("a goal is cancelled that was to be left alone (C1.16)")
        if facts.lost and not goal.settled:
            raise Broken("it is lost, and nobody is told")
        if facts.lost and goal.stage not in (Stage.LOST, Stage.OVER):
            raise Broken("its stage and its facts disagree about whether it is lost")
        if facts.known_to_run and not goal.may_run:
            raise Broken("known to run, and it may not run")
        if self.settled != goal.settled:
            raise Broken("told twice, or not")
        self.check_that_waits_end()

    def check_that_waits_end(self) -> None:
        """Once given up, its caller is told; and once all servers have stopped, it is let go."""
        world = self.copy()
        for _ in range(4):
            if not world.settled and fx.Timer.CANCEL in world.due:
                world.now += 100
                world.happens("timer", fx.Timer.CANCEL)
            if not world.settled:
                world.happens("give up", CancelReason.DEADLINE)
        if not world.settled:
            raise Broken("its caller waits for ever")
        for i, server in enumerate(world.servers):
            if server.graph == HUNG:
                world.happens("comes", i)
            if server.undecided:
                world.happens("rejects unseen", i)
            elif server.does == TAKING:
                world.happens("accepts unseen", i)
            if world.servers[i].does in HERE:
                world.happens("ends", i)
        if world.up:
            world.speaks()
        for _ in range(40):
            if world.released:
                return
            for kind in ("cancel", "result"):
                for i in world.up:
                    for number, r in reversed(list(enumerate(getattr(world, f"{kind}s")))):
                        if i in r.waiting and number < len(getattr(world, f"{kind}s")):
                            event = "answers cancel" if kind == "cancel" else kind
                            world.happens(event, (i, number))
            if fx.Timer.REASK in world.due:
                world.happens("timer", fx.Timer.REASK)
        gone = world.goal.stage is Stage.LOST
        gone = gone and (world.was_away or bool(world.were_given - world.up))
        if not (gone or world.given_to - world.sent_to):
            raise Broken("no server runs it, and it is kept for ever")


def begin(
    servers: int,
    kind: str = "",
    *,
    later: str = "",
    timeouts: Timeouts | None = None,
) -> World:
    """Return the world in which the goal was just sent to so many servers, or is attached to.

    Args:
        servers: How many servers are in sight.
        kind: "attach" if somebody else has sent the goal, "left alone" if it is also to be left
            alone; then the first server runs it.
        later: Another server that comes into sight later: "new", or "late" if it was sent the goal.
        timeouts: The limits of the call.
    """
    timeouts = timeouts or Timeouts(accept=2.5, feedback=None, result=None)
    up = frozenset(range(servers))
    goal = Goal(uuid.UUID(int=1), timeouts)
    world = World(
        goal,
        [Server() for _ in up],
        staying=up,
        sent_to=up,
        given_to=up,
        left_alone=kind == "left alone",
    )
    if later:
        world.servers.append(Server(graph=ABSENT, undecided=later == "late"))
    if not kind:
        world.apply(goal.sent(0.0, servers))
        return world
    for i in up:
        world.change(i, undecided=False, does=NONE if i else RUNS)
    world.apply(goal.attached(0.0, servers, left_alone=world.left_alone))
    return world


def _weight(event: tuple[str, Any]) -> float:
    """Let a walk be long: what ends a goal or takes away a server comes seldom."""
    name, arg = event
    if name in ("leave", "dies", "rejects", "rejects unseen", "forgets"):
        return 0.1
    if name in ("hangs", "is silent", "ends", "seems restarted") or arg is CancelReason.DEADLINE:
        return 0.3
    return 1.0


def hunt(first: World, walks: int, seed: int = 0) -> int:
    """Walk at random, deeper than all states can be visited; return how many steps it were."""
    chance, steps = random.Random(seed), 0
    for _ in range(walks):
        world, way = first.copy(), []
        while len(way) < LONGEST_WALK and (events := world.events()):
            ((event, arg),) = chance.choices(events, list(map(_weight, events)))
            way.append(step_of((event, arg)))
            steps += 1
            try:
                world.happens(event, arg)
                world.check()
            except Broken as problem:
                raise Broken(f"{problem}\n   after: " + "; ".join(way)) from None
    return steps


if __name__ == "__main__":
    import sys
    import time

    servers, most, kind = int(sys.argv[1]), int(sys.argv[2]), " ".join(sys.argv[3:])
    began = time.process_time()
    print(
        servers, kind, explore(begin(servers, kind), most), f"{time.process_time() - began:.1f} s"
    )
