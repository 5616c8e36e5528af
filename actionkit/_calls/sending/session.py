"""Manages the calls of one client and their goals, from the client's making until all is freed.

A session may outlive its client: it watches goals that were given up on until they are known not to
run any more (C2.4).
"""

from __future__ import annotations

import logging
import math
import os
import time
import uuid
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

from actionkit._calls.awaiting.drivers import find_driver
from actionkit._calls.errors.error_texts import CLIENT_CLOSED, ENDING
from actionkit._calls.errors.graph_snapshot import GraphSnapshot
from actionkit._calls.futures.future import GoalFuture
from actionkit._calls.futures.goals_left import LINGER
from actionkit._calls.on_signal.signals import is_ending
from actionkit._calls.sending.attempt import Attempt, CallForgotten
from actionkit._calls.sending.call import Call
from actionkit._calls.sending.last_request import LastRequest
from actionkit._calls.sending.request import Request
from actionkit._goal.facts import GoalFacts
from actionkit._goal.stages import CancelReason, Stage
from actionkit._model.errors import ClientClosedError
from actionkit._model.settings import Timeouts
from actionkit._observers.delivery import ObserverDispatcher
from actionkit._observers.protocol import Observer
from actionkit._ros.communication import secured
from actionkit._ros.endpoints import graph
from actionkit._ros.sending.connection import DIED, Connection, ServerWait
from actionkit._threads.clock import TimerHandle
from actionkit._threads.diagnostics import log_later
from actionkit._threads.pool import Pool

if TYPE_CHECKING:
    from actionkit._calls.ledger.file import LedgerFile

OnClose = Literal["cancel", "abandon"]
_INTERRUPTED_FOR = 2.0
"""Seconds after Ctrl-C ended a wait for cancellations in which no other such wait begins. The exits
of the `with` block and of the interpreter follow within that time."""
_NODE_CHECK = 1.0
"""Seconds between two checks whether the user's node was destroyed, while calls are in flight. No
event tells that, and nothing polls more often (C7.4)."""
_CTRL_C_HEARD = 0.6
"""Seconds until a blocking call notices Ctrl-C (see `_threads.waiting`). Then it cancels its goal,
even if the client abandons the others."""
_FOLLOWED = "goal {} is followed by this client already: use that future"
_MOST = 4096
"""With more goals that may run, the oldest that was lost with its server is forgotten."""


class Session:
    """The calls of one client, and their goals.

    Any thread may use the methods without an underscore, unless their docstring says otherwise; the
    rest happens on the communication thread.
    """

    def __init__(
        self,
        connection: Connection,
        on_close: OnClose,
        cancel_grace: float,
        observers: tuple[Observer, ...] = (),
        ledger: LedgerFile | None = None,
    ) -> None:
        """Take over a connection, which the session will free.

        `on_close` is what closing does to goals in flight, `cancel_grace` is `Timeouts.cancel`.
        The observers are checked already.
        """
        self.connection = connection
        self.ledger = ledger
        """Where calls are written down before they begin."""
        self.cancel_grace = cancel_grace
        self.identity = connection.identity
        self.action_name, self.type_name = (
            connection.identity.action_name,
            connection.identity.type_name,
        )
        self.link = connection.link
        self.decode_feedback = connection.decode_feedback
        runtime = connection.runtime
        self.call_soon = runtime.call_soon
        self.call_at = runtime.call_at
        self.cancel_timer = runtime.cancel_timer
        self._abandon = on_close == "abandon"
        self._pid = os.getpid()
        self._closed = False
        """Whether the user has closed it."""
        self._ended_because = ""
        """Why calls that start now end at once; set on the communication thread."""
        self.interrupted_at = -math.inf
        """Monotonic time at which Ctrl-C ended a wait for cancellations."""
        self.calls: set[Call] = set()
        """The calls in flight."""
        self.on_goals_changed: set[Callable[[], None]] = set()
        """Called soon after a goal has stopped, or was lost, and after a call is over."""
        self._attempts: dict[Attempt, None] = {}
        """The attempts with a goal that may run, oldest first."""
        self.taken_over: list[GoalFuture[Any, Any]] = []
        """The futures of goals that dead processes have left."""
        self.last_request = LastRequest()
        self._linger_timer: TimerHandle | None = None
        """Runs from the release until everything is freed."""
        self._node_timer: TimerHandle | None = None
        self.dispatcher = ObserverDispatcher(
            observers,
            action_name=self.action_name,
            action_type=self.type_name,
            node_name=connection.identity.label,
        )
        self.callbacks = Pool(self.action_name)
        """The threads of the user's callbacks."""
        self.link.on_accepted_late = self._take_back
        open_sessions.add(self)
        runtime.on_failure.append(self._on_failure)
        runtime.on_shutdown.append(self._look_at_ros)
        if runtime.was_shut_down or connection.why_unusable():  # too early for these lists
            self.call_soon(self._look_at_ros)

    # --- what a client asks for ------------------------------------------------------------

    @property
    def closed(self) -> bool:
        """Whether it accepts no calls: it was closed, or it cannot continue."""
        return self._closed or bool(self._ended_because)

    def check(self) -> None:
        """Raise if no call can begin.

        Raises:
            ClientClosedError: The session was closed, or cannot continue.
            RuntimeError: The session belongs to the process that this one was forked from.
        """
        self._check_open()
        if why := self._ended_because or self.connection.why_unusable():
            # A program that was told to end must not start goals.
            raise ClientClosedError(
                f"the client of action {self.action_name!r} takes no more calls, because {why}:"
                " make a new client",
                action_name=self.action_name,
            ) from self.connection.runtime.failure

    def _check_open(self) -> None:
        if self.inherited:
            raise RuntimeError(
                f"this Client was made in process {self._pid} and cannot be used in process"
                f" {os.getpid()}, which was forked from it: the middleware's threads are not here."
                " Make the Client in the process that uses it (gunicorn: without preload, Celery:"
                " in worker_process_init), and start processes with the 'spawn' method, or before"
                " the first Client"
            )
        if self._closed:
            raise ClientClosedError(
                f"the client of action {self.action_name!r} is closed: make a new one, or call"
                " inside its `with` block",
                action_name=self.action_name,
            )

    def check_not_followed(self, goal_id: uuid.UUID) -> None:
        """Raise `ValueError` if a call in flight has this goal."""
        if any(goal_id in call.goal_ids for call in list(self.calls)):
            raise ValueError(_FOLLOWED.format(goal_id))

    def prepare(self, request: Request) -> Call:
        """Make a call. Its time begins now, but it sends nothing yet.

        Raises the errors of `take_key`, if it has a key.
        """
        if request.key is None or request.invalid is not None:
            return Call(self, request, self.dispatcher)
        from actionkit._calls.sending.keyed import CallKey, take_key

        hold, request = take_key(self, request)
        try:
            if request.attach is not None:
                self.check_not_followed(request.attach)
        except ValueError:
            hold.give_back()
            raise
        key = CallKey(hold, self, judged=request.classify is not None)
        return Call(self, request, self.dispatcher, key)

    def begin(self, call: Call) -> None:
        """Begin a prepared call. Calls begin in this order.

        If the session closes at that moment, the call ends at once and sends nothing. Raises the
        errors of `check`; `LedgerError` if it cannot be written down.
        """
        try:
            self.check()
        except BaseException:  # also Ctrl-C: else the guard would not find its key's goal
            call.not_begun()
            raise
        if self.ledger is not None:
            call.write_down(self.ledger, self.identity.domain_id)
        self.calls.add(call)
        self.call_soon(partial(self._start, call))

    def cancel_all(self) -> int:
        """Cancel every call in flight; return how many there were.

        Raises:
            ClientClosedError: The session was closed.
            RuntimeError: The session belongs to the process that this one was forked from.
        """
        self._check_open()
        calls = list(self.calls)
        for call in calls:
            call.request_cancel()
        return len(calls)

    def cancel_again(self, goal_ids: tuple[uuid.UUID, ...]) -> None:
        """Ask once more to cancel goals of calls that are over. From any thread; never blocks."""
        self.call_soon(partial(self._cancel_again, goal_ids))

    def end_calls(self) -> None:
        """End every call, even after closing, because the program ends."""
        for call in list(self.calls):
            call.request_end()
        self.call_soon(self._ask_last_time)

    def wait_for_server(self, timeout: float | None) -> bool:
        """Block until goals can be sent; return whether they can. Raises the errors of `check`.

        `timeout` is in seconds, `None` means no limit.
        """
        self.check()
        with ServerWait(self.connection, timeout) as wait:
            wait.over.wait(timeout)
        if not wait.ready:
            self.check()
        return wait.ready or (timeout == 0 and self.sees_server())

    async def wait_for_server_async(self, timeout: float | None) -> bool:
        """Like `wait_for_server`, but without blocking the thread of this coroutine.

        Raises:
            RuntimeError: Also if the coroutine runs under nothing that can wait.
        """
        driver = find_driver()
        self.check()
        with ServerWait(self.connection, timeout) as wait:
            await driver.wait(wait.over)
        if not wait.ready:
            self.check()
        return wait.ready

    def sees_server(self) -> bool:
        """Whether goals can be sent now. Raises the errors of `check`."""
        self.check()
        return self.connection.runtime.run(self.link.server_is_ready)

    # --- for calls, on the communication thread --------------------------------------------

    def _start(self, call: Call) -> None:
        failure = self.connection.runtime.failure
        if failure is not None:
            call.fail(DIED, failure)
        elif self._ended_because:
            call.close(abandon=True, because=self._ended_because)  # it has sent nothing
        elif is_ending() and call.left_alone:
            call.close(abandon=True, because=ENDING)
        elif is_ending():
            call.unwanted = True  # between the signal and the end of the process nothing begins
            call.start()
        else:
            call.start()
            if self.connection.has_node and self._node_timer is None:
                self._arm_node_timer()

    def send(self, goal_id: uuid.UUID, request: Request, owner: Call) -> Attempt:
        """Send a goal, or attach to one, and watch it until it is over.

        Raises the errors of rclpy's converters; `ValueError` if a call in flight follows it.
        """
        timeouts, left_alone = request.timeouts, request.left_alone
        attaches = request.attach == goal_id
        if attaches and (earlier := self.watched(goal_id)) is not None:
            if earlier.owner in self.calls:
                raise ValueError(_FOLLOWED.format(goal_id))
            if request.key is None or earlier.goal.stage is not Stage.LOST:
                earlier.attach_again(owner, timeouts, left_alone=left_alone)
                return earlier
            earlier.forget()  # another server is in sight, which may say that it does not know it
        made = Attempt(self.link, goal_id, timeouts, owner, on_change=self._changed)
        # Else a goal that somebody cancels in its first second might be sent again (C4.4).
        despite_loss = request.retry.resend in ("server_gone", "always")
        silence = request.timeouts.feedback
        may_fail_for_now = request.classify is not None or silence is not None or despite_loss
        tries_again = request.retry.attempts != 1 or request.retry.stop is not None
        made.goal.watched_early = may_fail_for_now and tries_again
        if attaches:
            made.attach(left_alone=left_alone, just_sent=request.key is not None)
        else:
            made.send(request.goal)
        self._attempts[made] = None
        return made

    def _take_back(self, request: int, facts: GoalFacts) -> None:
        """Cancel a goal that was over here, and that another server has accepted now (R14)."""
        if (attached := self.watched(facts.goal_id)) is not None:
            attached.on_accepted()  # the call that has attached to it decides
            return
        made = Attempt(
            self.link, facts.goal_id, Timeouts(), CallForgotten(), on_change=self._changed
        )
        self._attempts[made] = None
        made.take_back(facts, request)

    def goals_in_flight(self) -> list[GoalFacts]:
        """Return the goals that may run, also those of calls that have ended. From any thread."""
        return [each.goal.facts for each in list(self._attempts)]

    def watched(self, goal_id: uuid.UUID) -> Attempt | None:
        """Return the attempt with a goal that may run, if there is one. From any thread."""
        return next((each for each in list(self._attempts) if each.goal_id == goal_id), None)

    def server_is_ready(self) -> bool:
        """Whether goals can be sent now. On the communication thread."""
        return self.link.readiness.ready

    def graph_snapshot(self) -> GraphSnapshot:
        """Return what the graph shows now, for an error's text. On the communication thread."""
        return GraphSnapshot(
            self.connection.actions(),
            self.identity.domain_id,
            graph.middleware(),
            self.connection.best_effort(),
            self.connection.sends_no_data(),
            self.connection.only_publishing(),
            self.connection.runtime.now() - self.connection.runtime.in_graph_since,
            secured.enclave(own=self.connection.runtime.own_context is not None),
        )

    def finished(self, call: Call) -> None:
        """Remove a call; its future is about to end. On the communication thread."""
        self.calls.discard(call)
        self._goals_changed()
        self._free_if_done()

    def _cancel_again(self, goal_ids: tuple[uuid.UUID, ...]) -> None:
        for attempt in list(self._attempts):
            # If another call has attached to the goal, that call decides.
            if (
                attempt.goal_id in goal_ids
                and attempt.goal.settled
                and not self.connection.freed.is_set()
            ):
                attempt.give_up(CancelReason.CANCELLED)

    def _changed(self, attempt: Attempt) -> None:
        if attempt.goal.stage is Stage.OVER:
            self._attempts.pop(attempt, None)
        elif attempt.goal.stage is Stage.LOST and len(self._attempts) > _MOST:
            self._forget_a_lost_one()
        self._goals_changed()
        self._free_if_done()

    def _goals_changed(self) -> None:
        self.last_request.look()
        for look in self.on_goals_changed:
            self.call_soon(look)

    def _forget_a_lost_one(self) -> None:
        oldest = next(each for each in self._attempts if each.goal.stage is Stage.LOST)
        log_later(
            logging.WARNING,
            "goal %s of action %s was lost with its server, and MAY STILL BE RUNNING: more than %d"
            " goals may run, so it is not cancelled any more if that server is seen again",
            oldest.goal_id,
            self.action_name,
            _MOST,
        )
        oldest.forget()

    # --- what ends calls, on the communication thread --------------------------------------

    def _end_calls(self) -> None:
        """End every call by the client's policy, and accept no more."""
        self._ended_because = self._ended_because or CLIENT_CLOSED
        self.connection.end_waits()
        for call in list(self.calls):
            call.close(abandon=self._abandon, because=self._ended_because)
        if self._abandon:
            self.last_request.drop()
        else:
            self._ask_last_time()

    def _ask_last_time(self) -> None:
        """Ask once more to cancel the goals that may run though their calls are over."""
        if self.connection.freed.is_set():
            self.last_request.drop()
        elif not self.last_request.began:
            self.last_request.begin([each for each in self._attempts if each.goal.settled])

    def _look_at_ros(self) -> None:
        """End every call if the user's ROS was shut down (C2.6)."""
        if self.connection.freed.is_set():
            return
        if not self._ended_because and (why := self.connection.why_unusable()):
            self._ended_because = why
            if self._abandon:
                self.call_at(time.monotonic() + _CTRL_C_HEARD, self._end_calls)
            else:
                self._end_calls()
        self.connection.end_spinning()

    def _arm_node_timer(self) -> None:
        self._node_timer = self.call_at(time.monotonic() + _NODE_CHECK, self._look_at_node)

    def _look_at_node(self) -> None:
        self._node_timer = None
        self._look_at_ros()
        if self.calls and not self._ended_because:
            self._arm_node_timer()

    def _on_failure(self, error: BaseException) -> None:
        self._ended_because = DIED
        for call in list(self.calls):
            call.fail(DIED, error)
        for attempt in list(self._attempts):
            attempt.goal.lose_touch()
        self.last_request.drop()
        self.connection.end_waits()
        # The entities died with the thread; nothing can free them.
        self.connection.freed.set()
        if self._closed:
            open_sessions.discard(self)

    def _end_grace(self) -> None:
        for call in list(self.calls):
            call.end_grace()
        self.last_request.drop()

    # --- what frees the connection, on the communication thread ----------------------------------

    def _release(self) -> None:
        """Free the connection as soon as no goal needs watching."""
        if self.connection.freed.is_set():
            open_sessions.discard(self)
        elif self._done:
            self._free()
        elif self._linger_timer is None:
            self._arm_linger()

    def _arm_linger(self) -> None:
        self._linger_timer = self.call_at(time.monotonic() + LINGER, self._stop_lingering)

    def _stop_lingering(self) -> None:
        if self.calls:
            self._arm_linger()  # somebody may be waiting for the futures of these calls
        else:
            self._free()

    @property
    def _done(self) -> bool:
        # A goal with a server that is gone is watched only while the client lives (C2.4).
        watched = any(attempt.goal.stage is not Stage.LOST for attempt in self._attempts)
        return not self.calls and not watched

    def _free_if_done(self) -> None:
        if self._linger_timer is not None and self._done:
            self.call_soon(self._free)  # not inside the link's own callback

    def _free(self) -> None:
        """Free the connection now, even with goals in flight. Does nothing the second time."""
        if self.connection.freed.is_set():
            return
        self._ended_because = self._ended_because or CLIENT_CLOSED
        # Other clients may keep the thread alive. A timer that stays there would keep this session,
        # and so the whole client, in memory until it is due.
        for timer in (self._linger_timer, self._node_timer):
            if timer is not None:
                self.cancel_timer(timer)
        self._linger_timer = self._node_timer = None
        self.last_request.drop()
        for attempt in list(self._attempts):
            attempt.drop()
        self.connection.runtime.on_failure.remove(self._on_failure)
        self.connection.runtime.on_shutdown.remove(self._look_at_ros)
        self.connection.free()
        open_sessions.discard(self)

    # --- the end, see `closing` ------------------------------------------------------------

    @property
    def inherited(self) -> bool:
        """Whether this session belongs to the process that this one was forked from."""
        return os.getpid() != self._pid

    @property
    def was_interrupted(self) -> bool:
        """Whether Ctrl-C has just ended a wait for cancellations: then no other one begins."""
        return time.monotonic() - self.interrupted_at < _INTERRUPTED_FOR

    @property
    def futures(self) -> list[GoalFuture[Any, Any]]:
        """The futures of the calls in flight."""
        return [call.future for call in list(self.calls)]

    def close_calls(self) -> None:
        """Accept no more calls, and begin to end those in flight by the policy `on_close`."""
        self._closed = True
        self.call_soon(self._end_calls)

    def end_grace(self) -> None:
        """End all waits of calls for confirmations of cancellations."""
        self.call_soon(self._end_grace)

    def release(self) -> None:
        """Free everything as soon as no goal needs it.

        For a client that is garbage collected without `close()`, only this happens.
        """
        if not self.inherited:
            self._closed = True
            self.call_soon(self._release)

    def free(self) -> None:
        """Free everything soon, even if goals need it."""
        self.call_soon(self._free)

    def await_freed(self, until: float) -> bool:
        """Wait until everything is freed and no goal is watched; return whether that is so."""
        return self.connection.freed.wait(max(0.0, until - time.monotonic()))

    def take_untold(self) -> list[tuple[str, uuid.UUID]]:
        """Return the goals that may be running, with the action's name, to warn of them now.

        If the user has heard about each of them, by a warning or by the end of its call, there is
        nothing to warn of. Else all are named, so that their number is true.
        """
        left = [goal for goal in self.goals_in_flight() if goal.may_run]
        # If these are left alone, nobody looks after them.
        taken_over = [goal for future in self.taken_over for goal in future._call.goals.facts_left]
        left += [goal for goal in taken_over if not any(goal is other for other in left)]
        if all(goal.user_knows for goal in left):
            return []
        for goal in left:
            goal.user_knows = True
        return [(self.action_name, goal.goal_id) for goal in left]

    @property
    def confirming(self) -> bool:
        """Whether a server in sight may soon confirm that some goal has stopped."""
        return any(each.goal.may_run for each in list(self._attempts))

    @property
    def given_up_at(self) -> float:
        """When the caller gave up on the last of the goals that may be running; else 0."""
        times = (each.goal.cancelled_at for each in list(self._attempts) if each.goal.facts.may_run)
        return max(times, default=0.0)

    @property
    def confirmed_at(self) -> float:
        """Monotonic time at which a server last answered a cancel request."""
        return self.link.others_confirmed_at


open_sessions: set[Session] = set()
"""The sessions with a connection that is not freed, for the interpreter's exit."""
