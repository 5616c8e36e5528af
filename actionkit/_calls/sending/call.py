"""Drives one call: its machine, its attempts, and the future that its user holds.

`machine` makes the decisions. Everything except `request_cancel` happens on the communication
thread.
"""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

from actionkit._calls.errors.error_texts import CLIENT_CLOSED, ENDING
from actionkit._calls.futures.call_view import GoalsKeeper
from actionkit._calls.futures.future import GoalFuture
from actionkit._calls.retries.classify_runner import ClassifyRunner
from actionkit._calls.retries.retry import GiveUp, Retry
from actionkit._calls.retries.retry_runner import RetryRunner
from actionkit._calls.sending import effects as cx
from actionkit._calls.sending.attempt import Attempt
from actionkit._calls.sending.call_record import ActionView, CallRecord
from actionkit._calls.sending.machine import CallMachine, Phase
from actionkit._calls.sending.replacing import GoalsWatch, Replacing, not_stopped, to_replace
from actionkit._calls.sending.request import Request
from actionkit._goal import effects as fx
from actionkit._goal.stages import CancelReason, Stage
from actionkit._model.values import GoalReport, GoalState, Outcome, Verdict
from actionkit._observers.delivery import NO_OBSERVERS, ObserverDispatcher
from actionkit._threads.clock import TimerHandle

if TYPE_CHECKING:
    from actionkit._calls.ledger.file import LedgerFile
    from actionkit._calls.sending.keyed import CallKey

_WRITTEN_WITHIN = 6.0
"""Seconds that the end of a call waits until it is written down. A file that another process uses
is waited for for 5 s."""


class CallLink(Protocol):
    """What a call needs of the link to the servers until its goal is sent."""

    def await_server(self, waiter: Call) -> None: ...
    def await_next_ready(self, waiter: Call) -> None: ...
    def look_again(self) -> None: ...
    def enqueue(self, waiter: Call, goal_id: uuid.UUID) -> None: ...
    def dequeue(self, waiter: Call, goal_id: uuid.UUID) -> None: ...


class CallSession(ActionView, GoalsKeeper, GoalsWatch, Protocol):
    """What a call needs of its session."""

    @property
    def link(self) -> CallLink: ...
    def send(self, goal_id: uuid.UUID, request: Request, owner: Call) -> Attempt: ...
    def server_is_ready(self) -> bool: ...
    def finished(self, call: Call) -> None: ...


class Call:
    """Carries out a request until its future is done."""

    def __init__(
        self,
        session: CallSession,
        request: Request,
        dispatcher: ObserverDispatcher = NO_OBSERVERS,
        key: CallKey | None = None,
    ) -> None:
        """Make a call; its time begins now. With a `key`, it is written down already."""
        goal_id = (
            key.hold.id_of(max(key.hold.attempt, 1)) if key else request.attach or uuid.uuid4()
        )
        self._record = record = CallRecord(session, request, dispatcher, goal_id)
        self.timeline, tape, began = record.timeline, record.tape, record.began
        self._deadline = None if request.timeout is None else began + request.timeout
        limits = request.timeouts.server, self._deadline
        attaches = request.attach is not None
        self.machine = machine = CallMachine(
            goal_id, request.retry.resend, *limits, attaches=attaches, keyed=key is not None
        )
        self._key = key
        if key is not None:
            machine.use_ids(key.hold.id_of, sent_before=max(key.hold.attempt - 1, 0))
        self.goals = machine.goals
        self.state = GoalState.SENT if attaches else GoalState.SENDING
        self.left_alone = request.left_alone
        """Whether only an explicit cancel cancels the goal."""
        self.cancel_grace = request.timeouts.cancel
        self._session = session
        self._request = request
        threads = request.function_pool
        self._retrying = RetryRunner(session, threads, request.retry, request.budget, began)
        self._judging = ClassifyRunner(session, threads, request.classify)
        self.future: GoalFuture[Any, Any] = GoalFuture(self, tape, request.pool, session)
        self._wait: TimerHandle | None = None  # ends the pause, or the wait for a server
        self._deadline_timer: TimerHandle | None = None
        self._given_up_at: float | None = None
        self._grace: TimerHandle | None = None  # ends the wait for confirmations of earlier goals
        self._ledger: LedgerFile | None = None
        self._call_id = goal_id
        self._replaced: tuple[GoalFuture[Any, Any], ...] = ()
        self._replacing: Replacing | None = None
        self._settled = False
        self._tell: Callable[[], None] | None = None  # ends the future, once the ledger is written
        self.urgent = False
        """Whether a human waits for the cancellation (C2.5)."""

    @property
    def goal_id(self) -> uuid.UUID:
        """The id of the current goal, or of the goal that the outcome describes."""
        return self.machine.goal_id

    @property
    def goal_ids(self) -> tuple[uuid.UUID, ...]:
        """The ids of the current goal, and of those that may run."""
        return (self.goal_id, *self.goals.may_run)

    @property
    def unwanted(self) -> bool:
        """Whether the caller cancelled, even if `cancel` has not run on this thread yet (C1.5)."""
        return self.machine.unwanted

    @unwanted.setter
    def unwanted(self, unwanted: bool) -> None:
        self.machine.unwanted = unwanted

    def write_down(self, ledger: LedgerFile, domain_id: int) -> None:
        """Write the call down before it begins, on the caller's thread. Raises `LedgerError`."""
        request, call_id = self._request, self.machine.goal_id
        if self._key or request.attach is not None or request.invalid is not None:
            return
        session = self._session
        action = session.action_name, session.type_name, domain_id
        ledger._add(
            call_id,
            *action,
            attempts=request.most_attempts,
            judged=request.classify is not None,
            parallel=request.retry.resend in ("server_gone", "always"),
        )
        self._ledger = ledger
        self.machine.use_ids(partial(ledger._attempt_id, call_id))

    def not_begun(self) -> None:
        """It was written down, and does not begin."""
        if self._key is not None:
            self._key.hold.give_back()
            self._key.hold.over = True

    def _strike_out(self) -> None:
        """Remove the call from the ledger if none of its goals may run."""
        left = self.machine.abandoned or not self.goals.block_another()
        if not (self._settled and left):
            return
        if self._ledger is not None:
            self._ledger._remove_soon(self._call_id)
            self._ledger = None
        if self._key is not None:
            self._key.goal_over()

    # --- the caller's wishes ---------------------------------------------------------------

    def request_end(self) -> None:
        """End soon, because the program ends: cancel the goal, unless it is to be left alone."""
        if self.left_alone and not self.unwanted:
            end = partial(self.close, abandon=True, because=ENDING)
            self._session.call_soon(end)
        else:
            self.request_cancel(urgent=True)

    def request_cancel(self, *, urgent: bool = False) -> None:
        """Cancel soon; if `urgent`, before other goals, as a human waits. From any thread."""
        self.unwanted = True
        self.urgent |= urgent
        self._session.call_soon(self.cancel)

    def start(self) -> None:
        """Begin the first attempt. Called by the session."""
        if self._deadline is not None:
            deadline_passed = partial(self._give_up, CancelReason.DEADLINE)
            self._deadline_timer = self._session.call_at(self._deadline, deadline_passed)
        if self.unwanted:
            self.cancel()
        request = self._request
        self._replaced = to_replace(request.replaces)  # now: earlier calls have begun
        if request.invalid is not None or self.machine.phase is not Phase.NEW:
            self._begin()
            return
        if self._key is not None and self._key.hold.result is not None:
            self._do(self.machine.was_done(*self._key.kept))
            return
        if self._replaced and not request.preempt:
            made = Replacing(self._replaced, self._session, self._begin, self._not_replacing)
            self._replacing = made
            made.begin(request.timeouts.cancel)
            return
        for future in self._replaced:
            future._call.replace_by(self)
        self._begin()

    @property
    def to_replace(self) -> tuple[GoalFuture[Any, Any], ...]:
        """The calls with goals that this one was to replace, as long as they may run."""
        if self._request.preempt and self.goals.accepted:
            return ()  # the server has stopped them
        return not_stopped(self._replaced or to_replace(self._request.replaces))

    def _begin(self) -> None:
        self._do(self.machine.begin(self._request.invalid, time.monotonic()))

    def _not_replacing(self, left: tuple[GoalReport, ...]) -> None:
        self._do(self.machine.not_replacing(left))

    def replace_by(self, call: Call) -> None:
        """Count as replaced if the goal stops now, and send no other one."""
        self._do(self.machine.replace_by(call.machine))

    def cancel(self) -> None:
        """Cancel the goal, or end the call if it has none in flight."""
        self._give_up(CancelReason.CANCELLED)

    def close(self, *, abandon: bool, because: str = CLIENT_CLOSED) -> None:
        """End because the client closes, or because something else that calls need has ended."""
        self.machine.closes_because = because
        if self.machine.attaches and self.machine.is_before_goal:
            if not (self.left_alone or abandon):
                self.unwanted = True  # it is cancelled, if a server comes in time
            if self.unwanted and not self._settled:
                self.cancel()
                return
        self._give_up(CancelReason.CLOSED, abandon=abandon)

    def _give_up(self, why: CancelReason, *, abandon: bool = False) -> None:
        self._given_up_at = self._given_up_at or time.monotonic()
        if (attempt := self.machine.attempt) is not None:
            attempt.give_up(why, abandon=abandon)
        elif why is CancelReason.DEADLINE:
            self._waited()
        else:
            self._do(self.machine.give_up(why))

    def end_grace(self) -> None:
        """End a closed call: no time is left for confirmations."""
        if (attempt := self.machine.attempt) is not None:
            attempt.end_grace()
        else:
            self._do(self.machine.end_grace("the client was closed"))

    def fail(self, reason: str, error: BaseException) -> None:
        """End because our own side failed."""
        self.machine.closes_because = reason  # no timer fires now, so nothing can be tried again
        if (attempt := self.machine.attempt) is not None:
            attempt.fail(reason, error)
        else:
            self._do(self.machine.broke(error))
        if self.machine.phase is Phase.ENDED:
            self._settle()  # no timer fires now, so the wait for callbacks would not end
        if self._tell is not None:
            self._tell()  # nor does the ledger's answer come

    # --- news from the link until a goal is sent -------------------------------------------

    def on_server_ready(self) -> None:
        """A server is ready."""
        self._do(self.machine.server_ready())

    def on_type_mismatch(self, served: tuple[str, ...]) -> None:
        """The name is served with other types only."""
        self._do(self.machine.type_mismatch(served))

    def on_turn(self) -> None:
        """Its goal may be sent; it is sent now, or after it is queued again."""
        machine, key = self.machine, self._key
        is_written = key is None or machine.attaches or key.hold.attempt == machine.number
        if key is not None and not is_written and machine.may_send():
            key.sends(machine.number, self._written)
            return
        if machine.attempts > 1 and self._request.before_resend is not None:
            self._request.before_resend()
        self._do(machine.turn(time.monotonic()))

    def _written(self, problem: Exception | None) -> None:
        """The next goal is written down. It is still its turn, if nothing else has happened."""
        if self.machine.phase is not Phase.QUEUED:
            return
        if problem is not None:
            self._do(self.machine.send_failed(problem))
        elif self._session.server_is_ready():
            self.on_turn()
        else:
            self._do(self.machine.server_lost(time.monotonic()))

    def on_server_lost(self, reason: str) -> None:
        """The last server left while the goal was in the queue."""
        self._do(self.machine.server_lost(time.monotonic()))

    # --- news from attempts ----------------------------------------------------------------

    def on_record(self, attempt: Attempt, record: fx.Record) -> None:
        """Write the timeline, also after the end, to log what happens to a goal given up on."""
        event = self._record.note(
            attempt.goal_id, attempt.number, record.state, record.detail, record.cancel_refused
        )
        if self._key is not None:
            self._key.record(attempt.goal_id, record.state)
            self.machine.seen_running |= record.state in (GoalState.EXECUTING, GoalState.CANCELING)
        if not self._settled and attempt is self.machine.attempt:
            self.state = record.state
            if record.state is GoalState.ACCEPTED:
                self.future._accept(event)

    def on_feedback(self, attempt: Attempt, messages: list[bytes]) -> None:
        """Pass on feedback without decoding it."""
        if not self._settled and attempt is self.machine.attempt:
            self._record.note_feedback(attempt, messages)

    def on_end(self, attempt: Attempt, ending: fx.Ending) -> None:
        """Classify the end of an attempt, then end the call or try again."""
        self._do(self.machine.ended(attempt, ending))

    def on_over(self, attempt: Attempt) -> None:
        """An attempt's goal is known not to run any more, or its server is out of sight."""
        self._strike_out()
        self._do(self.machine.earlier_over())
        if self.machine.phase is Phase.WAITING and self._session.server_is_ready():
            self.on_server_ready()

    def on_late_result(self, attempt: Attempt, state: GoalState, result: Any) -> None:
        """An earlier goal turns out to have finished."""
        self._do(self.machine.late_result(attempt, state, result))

    # --- carrying out ----------------------------------------------------------------------

    def _do(self, effects: list[cx.Effect]) -> None:
        for effect in effects:
            self._CARRY_OUT[type(effect)](self, effect)

    def _note(self, record: fx.Record) -> None:
        machine = self.machine
        self._record.note(machine.latest_id, machine.attempts, record.state, record.detail)
        self.state = record.state

    def _await_server(self, effect: cx.AwaitServer) -> None:
        link = self._session.link
        self._stop_waiting()
        (link.await_next_ready if effect.another else link.await_server)(self)
        # Mostly the wait is over already: a server was ready, and the goal was sent.
        if effect.until is not None and self._wait is None and self.machine.phase is Phase.WAITING:
            self._wait = self._session.call_at(effect.until, self._waited)

    def _queue(self, _: cx.Queue) -> None:
        self._end_wait()
        self._session.link.enqueue(self, self.machine.latest_id)

    def _waited(self) -> None:
        if self.machine.phase is Phase.WAITING:
            # A server of another type may have become visible only now (R21).
            self._session.link.look_again()
        ready = self._session.server_is_ready()
        cancels = not self.left_alone
        self._do(self.machine.waited(time.monotonic(), ready=ready, cancels=cancels))

    def _stop_waiting(self) -> None:
        self._session.link.dequeue(self, self.machine.latest_id)
        self._end_wait()

    def _end_wait(self) -> None:
        if self._wait is not None:
            self._session.cancel_timer(self._wait)
            self._wait = None

    def _send(self, _: cx.Send) -> None:
        self._end_wait()
        request = self._request
        try:
            attempt = self._session.send(self.goal_id, request, self)
        except Exception as error:  # noqa: BLE001  rclpy raises what its converters raise
            self._do(self.machine.send_failed(error))
            return
        attempt.number = self.machine.attempts
        self.machine.sent(attempt)
        attempt.start()
        if self.machine.attaches and (self.unwanted or self.machine.is_late):
            self._stop_awaiting(cx.StopAwaiting())
            if self.unwanted:
                self.cancel()
            if self.machine.is_late:
                self._give_up(CancelReason.DEADLINE)

    def _judge(self, effect: cx.Judge) -> None:
        ending = effect.ending
        if self._key is not None:
            self._key.keep(ending.result)
        if ending.end is fx.End.SUCCEEDED and self._request.classify is None:
            self._judged(ending, None, Verdict.SUCCESS)  # the usual case needs no outcome
        else:
            told = replace(ending, goals=self.goals.reports)
            outcome = self._record.outcome(told, self.goal_id, self.machine.attempts)
            self._judging.begin(ending, outcome, time.monotonic(), self._deadline, self._judged)

    def _judged(
        self, ending: fx.Ending, error: BaseException | None, verdict: Verdict | fx.Fault
    ) -> None:
        self._do(self.machine.judged(ending, error, verdict))

    def _cut_judging(self, effect: cx.CutJudging) -> None:
        if effect.at_once:
            self._judging.end(effect.why)
        else:
            within = f"{effect.why}, and it did not answer within {self.cancel_grace:g} s"
            self._judging.cut_short(time.monotonic() + self.cancel_grace, within)

    def _count(self, effect: cx.Count) -> None:
        budget = self._request.budget
        (budget.on_success if effect.success else budget.on_transient_failure)()

    def _plan(self, effect: cx.Plan) -> None:
        machine, planned = self.machine, partial(self._planned, effect.ending)
        attempts, clock = machine.attempts, time.monotonic
        self._retrying.begin(effect.ending, machine.cause, attempts, clock, self._deadline, planned)

    def _planned(self, ending: fx.Ending, plan: Retry | GiveUp | fx.Fault) -> None:
        self._do(self.machine.planned(ending, plan))

    def _pause_for(self, effect: cx.Pause) -> None:
        if self._key is not None and not self.goals.block_another():
            self._key.pause()
        self._wait = self._session.call_at(time.monotonic() + effect.seconds, self._resume)

    def _resume(self) -> None:
        self._wait = None
        self._do(self.machine.resume(time.monotonic()))
        for earlier in list(self.machine.earlier):
            # If a server is there, ask it about a goal that was lost with another server (C4.3).
            if earlier.goal.stage is Stage.LOST and self._session.server_is_ready():
                earlier.on_server_ready()

    def _stop_retrying(self, _: cx.StopRetrying) -> None:
        if self._replacing is not None:
            self._replacing.drop()
        self._retrying.drop()
        self._stop_waiting()

    def _await_earlier(self, _: cx.AwaitEarlier) -> None:
        since = self._given_up_at or time.monotonic()
        self._grace = self._session.call_at(since + self.cancel_grace, self.end_grace)

    def _stop_awaiting(self, _: cx.StopAwaiting) -> None:
        if self._grace is not None:
            self._session.cancel_timer(self._grace)
            self._grace = None

    def _finish(self, effect: cx.Finish) -> None:
        if self._deadline_timer is not None:
            self._session.cancel_timer(self._deadline_timer)
        self._record.await_callbacks(effect.ending, self._session, self._settle)

    _CARRY_OUT: ClassVar[dict[type[cx.Effect], Any]] = {
        fx.Record: _note,
        cx.AwaitServer: _await_server,
        cx.Queue: _queue,
        cx.Send: _send,
        cx.Judge: _judge,
        cx.CutJudging: _cut_judging,
        cx.Count: _count,
        cx.Plan: _plan,
        cx.Pause: _pause_for,
        cx.StopRetrying: _stop_retrying,
        cx.AwaitEarlier: _await_earlier,
        cx.StopAwaiting: _stop_awaiting,
        cx.Finish: _finish,
    }

    def _settle(self) -> None:
        if self._settled:
            return
        self._settled = True
        ending = self.machine.ending
        assert ending is not None
        self.state = ending.status
        self._strike_out()
        if self._ledger is not None:  # a goal may run, but it is the last one
            self._ledger._limit_soon(self._call_id, self.machine.attempts)
        self._record.end_feedback(
            ending, client_closes=self.machine.closes_because == CLIENT_CLOSED
        )
        outcome = self._record.outcome(ending, self.goal_id, self.machine.attempts)
        tell = self._tell = partial(self._end_future, outcome, ending)
        if self._key is None:
            tell()
            return
        self._grace = self._session.call_at(time.monotonic() + _WRITTEN_WITHIN, tell)
        self._key.end(ending, tell, ok=outcome.ok, may_run=self.goals.block_another())

    def _end_future(self, outcome: Outcome[Any], ending: fx.Ending) -> None:
        if self._tell is None:
            return
        self._tell = None
        if self._key is not None:
            self._key.hold.over = True
            self._stop_awaiting(cx.StopAwaiting())
        self._record.tell_outcome(outcome)
        # Leave the session first: a caller that sees the end must find that done (C1.11).
        self.future._settle(outcome, ending.end, partial(self._session.finished, self))
