"""Drives a call over a link and a clock of the test's, and checks what must hold in every order.

The link keeps books as the real one does: who waits for a server, who waits for his turn, and
who is told what is said of a goal. Beside it stands what is known of each goal on the servers'
side: a goal that was sent may be running until somebody said that it does not.
"""

from __future__ import annotations

import concurrent.futures
import math
import uuid
from collections import OrderedDict, deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any
from unittest import mock

from actionkit import (
    CancelReport,
    GoalState,
    Outcome,
    RetryBudget,
    RetryPolicy,
    Timeouts,
    Verdict,
)
from actionkit._calls.errors.graph_snapshot import GraphSnapshot
from actionkit._calls.sending import call as call_module
from actionkit._calls.sending import call_record as record_module
from actionkit._calls.sending.attempt import Attempt
from actionkit._calls.sending.call import Call
from actionkit._calls.sending.machine import Phase
from actionkit._calls.sending.request import Request
from actionkit._goal.facts import GoalFacts
from actionkit._goal.stages import CONFIRMED_AFTER
from actionkit._model import errors
from actionkit._model.cancel_answer import CancelAnswer
from actionkit._threads.clock import TimerHandle, TimerQueue
from actionkit._threads.pool import Pool

GRACE = 0.05
"""Seconds that a result waits for callbacks."""


class Broken(AssertionError):
    """The call did what it must never do."""


@dataclass
class OnServers:
    """What was said of one goal, and what was asked of it.

    `server` is the number of the server that it was sent to: one process, from start to end.
    """

    copies: int = 0
    answered: int = 0
    denied: int = 0
    results_asked: int = 0
    cancels_asked: int = 0
    results_answered: int = 0
    cancels_answered: int = 0
    cancels_in_vain: int = 0
    accepted: bool = False
    lost: bool = False
    unknown_since: float | None = None  # when its server first did not know it any more
    server: int = 0
    may_run: bool = False
    finished: bool = False

    @property
    def asked(self) -> int:
        return self.results_asked + self.cancels_asked


class Link:
    """Remembers who is to be told what, as the real link does; sends nothing anywhere."""

    def __init__(self, life: CallLife) -> None:
        self.life = life
        self.runtime = life
        self.ready = self.busy = False
        self.in_sight: set[int] = set()
        self.awaiting: dict[Call, None] = {}
        self.queue: OrderedDict[bytes, Call] = OrderedDict()
        self.listeners: dict[bytes, Attempt] = {}
        self.other_types: tuple[str, ...] = ()

    def await_server(self, waiter: Call) -> None:
        if self.ready:
            waiter.on_server_ready()
        else:
            self.awaiting[waiter] = None

    def await_next_ready(self, waiter: Call) -> None:
        self.awaiting[waiter] = None

    def look_again(self) -> None:
        if self.other_types:
            for waiter in list(self.awaiting):
                waiter.on_type_mismatch(self.other_types)

    def enqueue(self, waiter: Call, goal_id: uuid.UUID) -> None:
        self.awaiting.pop(waiter, None)
        self.queue[goal_id.bytes] = waiter
        self.flush()

    def flush(self) -> None:
        while self.ready and not self.busy and self.queue:
            self.queue.popitem(last=False)[1].on_turn()

    def send_goal(self, listener: Attempt, goal: Any) -> int:
        key = listener.goal_id.bytes
        self.listeners[key] = listener
        self.life.note_sent(key)
        return 1

    def dequeue(self, waiter: Call, goal_id: uuid.UUID) -> None:
        self.awaiting.pop(waiter, None)
        self.queue.pop(goal_id.bytes, None)

    def leave_outbox(self, listener: Attempt) -> None:
        self.queue.pop(listener.goal_id.bytes, None)

    def sees_server_of(self, listener: Attempt) -> bool:
        goal = self.life.goals.get(listener.goal_id.bytes)
        return goal is not None and self.life.may_have_it(goal)

    def seems_replaced(self, listener: Attempt) -> bool:
        return False

    def ask_result(self, listener: Attempt, *, supersedes_earlier: bool = False) -> None:
        if listener.goal_id.bytes in self.listeners:
            asked = self.life.goals[listener.goal_id.bytes]
            if supersedes_earlier:
                asked.results_answered = asked.results_asked
            asked.results_asked += 1

    others_confirmed_at = -math.inf
    urgent = False
    """Whether the last request to cancel was urgent."""

    def ask_cancel(self, listener: Attempt, *, urgent: bool) -> None:
        if listener.goal_id.bytes in self.listeners:
            self.life.goals[listener.goal_id.bytes].cancels_asked += 1
            self.urgent = urgent
            listener.on_cancel_sent()

    def stop_cancel(self, listener: Attempt) -> None:
        pass

    def watch_status(self) -> None:
        pass

    def forget(self, listener: Attempt, keep: GoalFacts | None = None) -> None:
        key = listener.goal_id.bytes
        if self.listeners.pop(key, None) is not None:
            self.life.note_forgotten(key, keep)


class CallLife:
    """One call, its session, its clock, and the servers' side of its goals."""

    action_name = "/fibonacci"
    type_name = "test_msgs/action/Fibonacci"

    def __init__(
        self,
        timeout: float | None = None,
        *,
        retry: RetryPolicy = RetryPolicy(jitter=0.0),  # noqa: B008  frozen
        budget: RetryBudget | None = None,
        judged: bool = False,
        strategies: bool = False,
        callbacks: Any = None,
        begin: bool = True,
        **timeouts: float | None,
    ) -> None:
        self.clock = 1000.0
        self.timers = TimerQueue()
        self.soon: deque[Callable[[], None]] = deque()
        self.jobs: deque[Callable[[], None]] = deque()
        self.verdict: Verdict | str | None = Verdict.SUCCESS
        self.strategy = "fine"
        self.judged = judged
        if strategies:
            retry = replace(retry, stop=self._stop, wait=self._wait)
        self.told: list[tuple[Any, ...]] = []
        self.goals: dict[bytes, OnServers] = {}
        self.link = Link(self)
        self.had_server = False
        self.began = self.clock
        self.retry = retry
        if timeout is not None:
            timeouts["result"] = None
        self.timeouts = Timeouts(**timeouts)  # type: ignore[arg-type]
        self.settled = self.finishes = self.servers = 0
        self.seem_replaced: set[int] = set()
        self.wanted, self.closed, self.abandon, self.broke = True, False, False, False
        self.cancelled_by_others = False
        self.broken: Broken | None = None
        with self.patched():
            self.call = Call(
                self,  # type: ignore[arg-type]
                Request(
                    goal=object(),
                    invalid=None,
                    timeout=timeout,
                    timeouts=self.timeouts,
                    retry=retry,
                    budget=budget or RetryBudget(1000.0),
                    classify=self._classify if judged else None,
                    callbacks=callbacks,
                    pool=Pool(),
                    function_pool=self,  # type: ignore[arg-type]
                ),
            )
        self.deadline = None if timeout is None else self.clock + timeout
        settle = self.call.future._settle

        def count(*args: Any) -> None:
            self.settled += 1
            self.require(self.settled == 1, "it ends once")
            settle(*args)

        self.call.future._settle = count  # type: ignore[method-assign]
        if begin:
            self.does(self.call.start)

    # --- the user's functions --------------------------------------------------------------

    def _classify(self, _: object) -> Any:
        if self.verdict == "raises":
            raise ValueError("from classify")
        return self.verdict

    def _stop(self, state: Any) -> Any:
        if self.strategy == "stop raises":
            raise ValueError("from stop")
        return None if self.strategy == "nonsense" else state.attempt_number >= self.retry.attempts

    def _wait(self, _: object) -> Any:
        if self.strategy == "wait raises":
            raise ValueError("from wait")
        return 0.2

    # --- the session, and the thread's clock -----------------------------------------------

    def send(self, goal_id: uuid.UUID, request: Request, owner: Call) -> Attempt:
        forget = lambda _: None  # noqa: E731
        attempt = Attempt(self.link, goal_id, request.timeouts, owner, on_change=forget)
        attempt.send(request.goal)
        return attempt

    def now(self) -> float:
        return self.clock

    monotonic = now
    time = now

    def call_soon(self, callback: Callable[[], None]) -> None:
        self.soon.append(callback)

    def call_at(self, at: float, callback: Callable[[], None]) -> TimerHandle:
        return self.timers.arm(at, callback)

    def cancel_timer(self, handle: TimerHandle) -> None:
        self.timers.cancel(handle)

    def submit(self, job: Callable[[], None], label: object) -> str:
        self.jobs.append(job)
        return ""

    def server_is_ready(self) -> bool:
        return self.link.ready

    def decode_feedback(self, message: bytes) -> Any:
        return message

    def graph_snapshot(self) -> GraphSnapshot:
        return GraphSnapshot({}, 0, "none")

    def finished(self, call: Call) -> None:
        self.finishes += 1

    # --- driving ---------------------------------------------------------------------------

    @contextmanager
    def patched(self) -> Iterator[None]:
        record_time = mock.patch.object(record_module, "time", self)
        with mock.patch.object(call_module, "time", self), record_time:
            yield

    def does(self, action: Callable[..., object], *args: Any, **options: Any) -> None:
        """Let something happen on the thread, and all that follows at once."""
        with self.patched():
            action(*args, **options)
            while self.soon:
                self.soon.popleft()()
        if self.broken is not None:  # the call takes it for an error of rclpy's
            raise self.broken
        self.check()

    def happens(self, *event: Any) -> None:
        """Let an event happen where it can."""
        name, *args = event
        self.told.append(event)
        getattr(self, name)(*args)

    def wait_until(self, moment: float) -> None:
        """Move the clock, firing the timers due on the way."""
        while (due := self.timers.next_due()) is not None and due <= moment:
            self.clock = max(self.clock, due)
            callback = self.timers.pop_due(self.clock)
            assert callback is not None
            self.does(callback)
        self.clock = max(self.clock, moment)

    # --- events: servers -------------------------------------------------------------------

    def ready(self) -> None:
        """A server is ready: a new one where there was none, else one of those in sight."""
        if not self.link.in_sight:
            self._new_server()
        self._ready()

    def _new_server(self) -> None:
        self.servers += 1
        self._in_sight({self.servers})

    def _in_sight(self, servers: set[int]) -> None:
        self.link.in_sight = servers
        for key, listener in list(self.link.listeners.items()):
            away = not self.is_in_sight(self.goals[key])
            self.does(listener.on_servers_changed, 1, int(away))

    def back(self) -> None:
        """The server that was the last to go was only out of reach, and can be talked to again."""
        if self.servers and not self.link.in_sight:
            self._in_sight({self.servers})
            for goal in self.goals.values():
                # It may have the request, and take it yet; what it took, it may have lost.
                goal.lost = goal.lost and (goal.accepted or goal.server != self.servers)
            self._ready()

    def _ready(self) -> None:
        self.link.ready = True
        self.had_server |= not self.done
        before = {key: goal.asked for key, goal in self.goals.items() if goal.lost}
        self.does(self._tell_ready)
        for key, asked in before.items():
            goal = self.goals[key]
            forgotten = key not in self.link.listeners
            self.require(
                forgotten or not goal.lost or goal.asked > asked,
                "a goal that was lost is asked about when a server is ready",
            )

    def _tell_ready(self) -> None:
        awaiting, self.link.awaiting = self.link.awaiting, {}
        for waiter in awaiting:
            waiter.on_server_ready()
        for listener in list(self.link.listeners.values()):
            listener.on_server_ready()
        self.link.flush()

    def settling(self) -> None:
        """Another server comes, and is not ready so far; nobody is lost."""
        self.link.ready = False

    def gone(self) -> None:
        """All servers are gone."""
        self.link.ready = False
        self._in_sight(set())
        self.does(self._tell_lost, everybody=True)

    def restarted(self) -> None:
        """The server is gone, and another is there."""
        self._new_server()
        self.does(self._tell_lost, everybody=False)
        self._ready()

    def twice(self) -> None:
        """Another server of the same name comes, and the first, which stays, is silent."""
        if self.link.in_sight:
            self.seem_replaced |= self.link.in_sight
            self.servers += 1
            self._in_sight(self.link.in_sight | {self.servers})
            self.does(self._tell_lost, everybody=False)
            self._ready()

    def first_leaves(self) -> None:
        """All servers but the last one that came leave the graph."""
        if len(self.link.in_sight) > 1:
            self._in_sight({self.servers})
            self.does(self._tell_lost, everybody=False)

    def may_have_it(self, goal: OnServers) -> bool:
        """Whether the server that a goal was sent to is there, and does not seem replaced."""
        return self.is_in_sight(goal) and goal.server not in self.seem_replaced

    def _tell_lost(self, *, everybody: bool) -> None:
        for key, listener in list(self.link.listeners.items()):
            if not self.may_have_it(self.goals[key]):
                self.goals[key].lost = self.goals[key].may_run
                listener.on_server_lost("gone")
        if everybody:
            for waiter in [*self.link.queue.values(), *self.link.awaiting]:
                waiter.on_server_lost("gone")

    def busy(self, busy: bool) -> None:
        """Other goals fill the window of requests that wait for their answer."""
        self.link.busy = busy
        self.does(self.link.flush)

    # --- events: what is said of a goal ----------------------------------------------------

    def _goal(self, number: int) -> tuple[OnServers, Attempt] | None:
        """Return a goal that was sent, the last one first, and who is told of it."""
        keys = list(self.goals)[::-1]
        if number >= len(keys) or keys[number] not in self.link.listeners:
            return None
        return self.goals[keys[number]], self.link.listeners[keys[number]]

    def _lives(self, goal: OnServers) -> None:
        goal.accepted, goal.lost = True, False

    def accepted(self, number: int) -> None:
        if (found := self._goal(number)) and found[0].answered < found[0].copies:
            found[0].answered += 1
            self._lives(found[0])
            self.does(found[1].on_accepted)

    def rejected(self, number: int) -> None:
        if (found := self._goal(number)) and found[0].answered < found[0].copies:
            goal = found[0]
            goal.answered += 1
            goal.denied += 1
            if not goal.accepted and goal.denied == goal.copies:
                goal.may_run = False
            self.does(found[1].on_rejected)

    def feedback(self, number: int) -> None:
        if (found := self._goal(number)) and found[0].may_run:
            self._lives(found[0])
            self.does(found[1].on_feedback, [b"", b"", b""])

    def status(self, number: int, state: GoalState) -> None:
        if (found := self._goal(number)) and found[0].may_run:
            self._lives(found[0])
            found[0].may_run = not state.is_terminal
            asked = found[0].cancels_asked > 0
            self.cancelled_by_others |= state is GoalState.CANCELING and not asked
            self.does(found[1].on_status, state)

    def result(self, number: int, state: GoalState | None) -> None:
        found = self._goal(number)
        if found is None or found[0].results_answered >= found[0].results_asked:
            return
        goal, listener = found
        goal.results_answered += 1
        if state is None:
            goal.may_run = goal.may_run and not (goal.accepted and self.may_have_it(goal))
            self.does(listener.on_result, None, None, self.clock)
            return
        self._lives(goal)
        goal.may_run = False
        goal.finished = True
        self.cancelled_by_others |= (
            state is GoalState.CANCELED and goal.cancels_in_vain == goal.cancels_asked
        )
        self.does(listener.on_result, state, object(), self.clock)

    def cancel_answer(self, number: int, answer: CancelAnswer) -> None:
        found = self._goal(number)
        if found is None or found[0].cancels_answered >= found[0].cancels_asked:
            return
        goal, listener = found
        goal.cancels_answered += 1
        if answer is CancelAnswer.UNKNOWN_GOAL:
            goal.cancels_in_vain += 1
            over = goal.lost or self._is_forgotten(goal)
            goal.may_run = goal.may_run and not (over and self.may_have_it(goal))
            # It is asked again: it may know the goal by then.
            self.timers.arm(self.clock + 1.0, lambda: self.link.ask_cancel(listener, urgent=False))
        else:
            self._lives(goal)
        self.does(listener.on_cancel_answer, answer, self.clock)

    def _is_forgotten(self, goal: OnServers) -> bool:
        """Whether its server, asked to cancel it, does not know it for the second time.

        The first answer may come from another thread than the one that accepts it (R12).
        """
        if goal.accepted and goal.unknown_since is None:
            goal.unknown_since = self.clock
        return goal.unknown_since is not None and self.clock >= goal.unknown_since + CONFIRMED_AFTER

    # --- events: the user, and time --------------------------------------------------------

    def wait(self, seconds: float) -> None:
        self.wait_until(self.clock + seconds)

    def fire(self) -> None:
        """Let the timer that is due next fire."""
        due = self.timers.next_due()
        if due is not None:
            self.wait_until(due)

    def cancel(self) -> None:
        idle = self._is_idle()
        self.wanted = False
        self.does(self.call.request_cancel)
        self._require_end_of_idle(idle)

    def close(self, abandon: bool) -> None:
        idle = self._is_idle()
        self.abandon = self.abandon or (abandon and not self.closed)
        self.closed = True
        self.does(self.call.close, abandon=abandon)
        self._require_end_of_idle(idle)

    def _is_idle(self) -> bool:
        """Whether no goal is under way: a pause, or a wait for a server or for its turn."""
        machine = self.call.machine
        judged = self.call._judging.under_way or machine.confirming
        # From an earlier cancel on, there is a limit for what may come yet: a late acceptance with
        # its cancellation, or a late success. If neither can come, the call has to be over.
        may_come = any(
            not earlier.goal.facts.is_over or earlier.goal.awaits_result_of
            for earlier in machine.earlier
        )
        waits = judged or (machine.phase is Phase.CONFIRMING and may_come)
        return not waits and machine.attempt is None

    def _require_end_of_idle(self, idle: bool) -> None:
        """A pause, or a wait for a server, ends at once."""
        if idle and self.call._record._grace is None:
            self.require(self.done, "who cancels or closes does not wait for nothing")

    def fail(self) -> None:
        self.broke = True
        self.does(self.call.fail, "it broke", RuntimeError("broken"))
        # No timer will ever fire again.
        self.require(self.done, "what broke ends the call at once")

    def judge(self, verdict: Verdict | str | None, strategy: str = "fine") -> None:
        """The user's `classify=`, or his strategies, return what they are told to here."""
        if self.jobs:
            self.verdict, self.strategy = verdict, strategy
            self.does(self.jobs.popleft())

    # --- what must hold --------------------------------------------------------------------

    @property
    def done(self) -> bool:
        return self.call.future.done()

    @property
    def outcome(self) -> Outcome[Any]:
        return self.call.future.outcome(0)

    @property
    def sends(self) -> int:
        return sum(goal.copies for goal in self.goals.values())

    def require(self, holds: bool, promise: str) -> None:
        if not holds:
            self.broken = Broken(f"{promise}: {self.told}")
            raise self.broken

    def is_in_sight(self, goal: OnServers) -> bool:
        """Whether the server that a goal was sent to is in sight."""
        return goal.server in self.link.in_sight

    def note_sent(self, key: bytes) -> None:
        self.require(
            not self.done and self.call.machine.ending is None, "nothing is sent after the end"
        )
        self.require(self.wanted and not self.closed, "nothing is sent that nobody wants")
        self.require(not self.cancelled_by_others, "what others cancelled is not retried (C4.4)")
        gone = self.retry.resend == "server_gone"  # which forgets those that are out of sight
        others = [
            goal
            for other, goal in self.goals.items()
            if other != key and goal.may_run and not (gone and not self.is_in_sight(goal))
        ]
        at_least_once = self.retry.resend == "always"
        self.require(not others or at_least_once, "two goals never run at once (C4.2)")
        goal = self.goals.setdefault(key, OnServers())
        self.require(not goal.copies, "an id is never sent twice (R5)")
        if self.retry.resend == "never_accepted":
            sent = [goal for goal in self.goals.values() if goal.copies]
            refused = all(goal.denied == goal.copies for goal in sent)
            self.require(refused, "it is sent again only where it was never accepted")
        goal.copies += 1
        goal.may_run = True
        goal.lost = False
        goal.server = max(self.link.in_sight)
        self.require(self.sends <= self.retry.attempts, "no more goals than attempts (C4.1)")

    def note_forgotten(self, key: bytes, keep: GoalFacts | None) -> None:
        left = keep is None or self.broke
        if keep is not None and self.goals[key].finished:
            self.require(keep.ends > 0, "a late acceptance is known for what it is (R14)")
        self.require(
            left or not self.goals[key].may_run, "a goal that may run is watched on (C2.4)"
        )

    def check(self) -> None:
        self.require(self.finishes == self.settled, "it is counted out when it ends")
        self.require(self.done == (self.settled == 1), "it is done when it ends")
        timer = self.call._deadline_timer
        armed = timer is not None and timer.callback is not None
        self.require(not (self.done and armed), "no timer keeps a call that is over (C7.5)")
        if self.abandon or self.broke:
            return
        if self.done:
            self.check_outcome()
            for key, goal in self.goals.items():
                if goal.may_run and key in self.link.listeners and not goal.lost:
                    self.require(
                        goal.cancels_asked > 0, "nothing is left behind uncancelled (C2.4)"
                    )
            return
        if not self.had_server:
            limits = (self.deadline, self.timeouts.server and self.began + self.timeouts.server)
            latest = min((limit for limit in limits if limit is not None), default=math.inf)
            self.require(self.clock <= latest, "no server is told of in the time there was (C2.7)")
        if self.deadline is not None:
            latest = self.deadline + self.timeouts.cancel + GRACE
            self.require(self.clock < latest + 1e-6, "the deadline is kept (C2.3)")

    def check_outcome(self) -> None:
        outcome = self.outcome
        self.require(1 <= outcome.attempts <= self.retry.attempts or not self.sends, "attempts")
        if self.settled_with_news:
            return
        self.settled_with_news = True
        self.check_server_was_there(outcome)
        if isinstance(outcome.error, errors.ServerLostError):
            was_sent = outcome.error.goal_id.bytes in self.goals
            self.require(was_sent, "the goal that was lost was sent")
        pairs = {(event.attempt, event.goal_id) for event in outcome.timeline}
        self.require(
            len(pairs) == len(dict(pairs)), "an attempt has one goal, whose id its news has"
        )
        running = any(goal.may_run for goal in self.goals.values())
        if outcome.cancel in (CancelReport.NOT_NEEDED, CancelReport.CONFIRMED):
            self.require(not running, f"{outcome.cancel} means: nothing runs")
        cancelled = isinstance(outcome.error, concurrent.futures.CancelledError)
        self.require(not (cancelled and running), "CancelledError means: nothing runs (C2.8)")
        for key, goal in self.goals.items():
            if goal.may_run and outcome.error is not None:
                named = str(uuid.UUID(bytes=key)) in str(outcome.error)
                self.require(named, "the error names each goal that may run (C2.8)")
                self.require("STILL" in str(outcome.error), "and says so")
        if outcome.error is None:
            approved = not self.judged or self.verdict in (Verdict.SUCCESS, None)
            self.require(approved, "what nobody called a success is none (C3.3)")
            may_be = outcome.status in (GoalState.SUCCEEDED, GoalState.ABORTED)
            self.require(may_be, "what was rejected or canceled is no success (C3.3)")
            may = self.retry.resend in ("always", "server_gone")
            self.require(not running or may, "a success is the last word")

    def check_server_was_there(self, outcome: Outcome[Any]) -> None:
        """No server is one error, and is not tried again (C2.7)."""
        none_there = isinstance(outcome.error, errors.ServerUnavailableError)
        nothing = outcome.cancel is CancelReport.NOT_NEEDED and outcome.attempts == 1
        sent = self.sends or self.link.ready
        self.require(not none_there or (nothing and not sent), "it says that nothing was sent")
        late = isinstance(outcome.error, errors.DeadlineExceededError)
        self.require(not late or self.had_server, "the deadline's error: there was a server")
        self.require(not late or outcome.cancel is not None, "and it tells of each goal's cancel")
        waited = [
            at
            for at, event in enumerate(outcome.timeline)
            if event.state is GoalState.TIMED_OUT and event.detail == "waiting for a server"
        ]
        later = outcome.timeline[waited[0] :] if waited else ()
        tried = any(event.state is GoalState.RETRYING for event in later)
        self.require(not tried or self.sends > 0, "waiting longer is no other attempt")

    settled_with_news = False

    # --- a good end ------------------------------------------------------------------------

    def come_to_good(self, seconds: float) -> None:
        """From now on a server is ready that answers everything, and knows what it accepted."""
        end = self.clock + seconds
        self.busy(False)
        self.ready()
        while not self.done and self.clock < end:
            self._answer_everything()
            while self.jobs:
                self.judge(Verdict.SUCCESS)
            due = self.timers.next_due()
            self.wait_until(end if due is None else min(due, end))

    def _answer_everything(self) -> None:
        for key, goal in list(self.goals.items()):

            def tell(event: str, *args: Any, key: bytes = key) -> None:
                number = list(self.goals)[::-1].index(key)
                if key in self.link.listeners:
                    self.happens(event, number, *args)

            if not goal.accepted and not goal.lost and goal.answered < goal.copies:
                tell("accepted")
            for _ in range(goal.cancels_asked - goal.cancels_answered):
                known = CancelAnswer.ACCEPTED if goal.accepted else CancelAnswer.UNKNOWN_GOAL
                tell("cancel_answer", known)
            for _ in range(goal.results_asked - goal.results_answered):
                ours = goal.cancels_asked > goal.cancels_in_vain
                ended = GoalState.CANCELED if ours else GoalState.SUCCEEDED
                tell("result", ended if goal.accepted else None)
