"""Connects the goals of one client with the servers of its action.

It sends the goals' requests, and passes each server's answers to the goal's listener. All of it
happens on the communication thread.
"""

from __future__ import annotations

import uuid
from collections.abc import Callable
from typing import Any

from rclpy.node import Node

from actionkit._model.cancel_answer import CancelAnswer
from actionkit._ros.answers.codes import cancel_answer
from actionkit._ros.answers.feedback import FeedbackWatch
from actionkit._ros.answers.listener import GoalListener, Waiter
from actionkit._ros.answers.status import StatusWatch
from actionkit._ros.answers.wire import STATES
from actionkit._ros.communication.outbox import Outbox, Window
from actionkit._ros.communication.runtime import Runtime
from actionkit._ros.endpoints.entities import Entities
from actionkit._ros.endpoints.names import ActionNames
from actionkit._ros.sending.requests import ServiceRequests
from actionkit._ros.servers_in_sight.monitor import ServerMonitor

_MAY_BE_DEAD_AFTER = 0.1
"""Seconds; if a server does not answer for so long, it may have been stopped or killed."""
_CLEARED_WITHIN = 4.0
"""Seconds until Fast DDS has cleaned up after a process that stopped: once a second, it looks for
processes that did nothing for a second, and then it waits another second for their lock."""


class Link:
    """The goals of one client that wait to be sent or may be on a server."""

    def __init__(
        self, runtime: Runtime, action_type: Any, type_name: str, names: ActionNames
    ) -> None:
        """Make the entities and look for servers. On the communication thread.

        They use the thread and node of `runtime`. `type_name` is such as
        `test_msgs/action/Fibonacci`.

        Raises:
            Exception: Any error of rclpy, for a bad name or type.
        """
        self.runtime = runtime
        self._listeners: dict[bytes, GoalListener] = {}  # of the goals that were sent, by id
        self._outbox: Outbox[Waiter] = Outbox(
            runtime.window(Window, names.action), on_free=self._send_next
        )
        self._entities = Entities(
            runtime.node,
            action_type.Impl,
            names,
            on_goal=self._take_goal,
            on_result=self._take_result,
            on_cancel=self._take_cancel,
            on_feedback=lambda: self._feedback.look(),  # noqa: PLW0108  it is made below
            on_matched=self._on_matched,
        )
        self._requests = ServiceRequests(
            runtime,
            self._entities,
            action_type.Impl,
            action_name=names.action,
            count_servers=lambda: self.readiness.count,
            servers=lambda: self.readiness.servers,
            on_cancel_sent=lambda key: self._listeners[key].on_cancel_sent(),
        )
        window = self._requests.cancel_window
        self.on_accepted_late: Callable[[int, Any], object] = lambda seq, kept: None
        """Called if a server accepts a forgotten goal: with the number of the goal's request, and
        what `forget` was told to keep."""
        self._status = StatusWatch(
            runtime,
            self._entities,
            self._listeners,
            self._take_status,
            awaits_cancels=lambda: bool(self._requests.cancels),
            on_cancels=lambda: window.note_progress_of_others(runtime.now()),
        )
        self.monitor = ServerMonitor(
            runtime,
            self._entities,
            names=names,
            type_name=type_name,
            probe=self._requests.probe,
            listeners=self._listeners,
            queued=self._outbox.waiting,
            on_ready=self._on_ready,
        )
        self.readiness = self.monitor.readiness
        """Whether servers are there."""
        self.liveness = self.monitor.liveness
        """Probes the servers regularly, if the user wants that."""
        self.stood_still = self.monitor.stood_still
        self.ask_about_goals = self.monitor.tell_sent_goals
        self._feedback = FeedbackWatch(
            runtime,
            self._entities.feedback,
            self._entities.matched,
            goals=self._listeners,
            on_feedback=self._take_feedback,
            has_waiters=lambda: self.monitor.waiting > 0,
        )
        runtime.node_replacement.links[self] = None
        runtime.standstill.watch()

    # --- what goals need -------------------------------------------------------------------

    def await_server(self, waiter: Waiter) -> None:
        """Tell the waiter once when a server is ready, or if another type is served."""
        self._feedback.poll_now()
        self.runtime.standstill.watch()
        self.monitor.await_server(waiter)

    def look_again(self) -> None:
        """Tell waiters for a server whether another type is served now."""
        self._feedback.poll_now()
        self.readiness.look_again()

    def await_next_ready(self, waiter: Waiter) -> None:
        """Tell the waiter when the next server becomes ready."""
        self._feedback.poll_now()
        self.monitor.await_next_ready(waiter)

    def enqueue(self, waiter: Waiter, goal_id: uuid.UUID) -> None:
        """Queue a goal; the waiter is told when it may be sent."""
        self.monitor.stop_waiting(waiter)
        self._outbox.put(goal_id.bytes, waiter)
        self._send_next()

    def dequeue(self, waiter: Waiter, goal_id: uuid.UUID) -> None:
        """Undo `await_server`, `await_next_ready` and `enqueue`."""
        self.monitor.stop_waiting(waiter)
        self._outbox.discard(goal_id.bytes)

    def send_goal(self, listener: GoalListener, goal: Any) -> int:
        """Send a goal that has its turn; return how many servers may have it.

        Raises:
            Exception: Any error of rclpy's converters; then nothing was sent.
        """
        key = listener.goal_id.bytes
        self._feedback.start()
        self._requests.send_goal(key, goal)
        self._listeners[key] = listener
        return self.monitor.goal_sent(key)

    def follow_goal(self, listener: GoalListener, request: int | None = None) -> int:
        """Follow a goal that somebody else has sent; return how many servers may have it.

        With `request`, it was sent here by the request with this number, and was forgotten.
        """
        key = listener.goal_id.bytes
        self._feedback.start()
        self._requests.follow(key, request)
        self._listeners[key] = listener
        return self.monitor.goal_sent(key)

    def leave_outbox(self, listener: GoalListener) -> None:
        """Give the goal's place in the window to the next goal."""
        self._outbox.discard(listener.goal_id.bytes)

    def sees_server_of(self, listener: GoalListener) -> bool:
        """Whether a server that the goal was sent to is in sight."""
        return self.monitor.sees_server_of(listener.goal_id.bytes)

    def seems_replaced(self, listener: GoalListener) -> bool:
        """Whether each server in sight that may have the goal only seems to have been replaced."""
        return self.monitor.seems_replaced(listener.goal_id.bytes)

    def ask_result(self, listener: GoalListener, *, supersedes_earlier: bool = False) -> None:
        """Ask for the goal's result.

        If `supersedes_earlier`, more is known about the goal than at the last request: then ask at
        once. Otherwise the goal's requests have a limited rate.
        """
        self._requests.ask_result(listener.goal_id.bytes, supersedes_earlier=supersedes_earlier)

    def ask_cancel(self, listener: GoalListener, *, urgent: bool) -> None:
        """Ask for the goal's cancellation until it is answered; urgent requests go first."""
        key = listener.goal_id.bytes
        if key in self._listeners:
            self._requests.cancels.ask(key, urgent=urgent)

    def stop_cancel(self, listener: GoalListener) -> None:
        """Send no cancel requests for the goal while its server is gone."""
        self._requests.cancels.stop(listener.goal_id.bytes)

    @property
    def others_confirmed_at(self) -> float:
        """When a goal of the action was last confirmed while others waited for their turn."""
        return self._requests.cancel_window.progressed_at

    def watch_status(self) -> None:
        """Tell all goals what the status topic shows about them, while there are any."""
        self._status.start()

    def forget(self, listener: GoalListener, keep: Any = None) -> None:
        """Tell the listener nothing more, and free what its goal held (R16).

        With `keep`, `on_accepted_late` is called with it if another server accepts the goal later.
        """
        key = listener.goal_id.bytes
        self._outbox.discard(key)
        if self._listeners.pop(key, None) is None:
            return
        self.monitor.forget(key)
        self._requests.forget(key, keep)
        if not self._listeners:
            self._status.stop()
            self._feedback.stop()

    def _send_next(self) -> None:
        """Let waiters send the goals that may be sent now."""
        while self.readiness.ready and (taken := self._outbox.take()) is not None:
            _, waiter = taken
            waiter.on_turn()

    def _on_ready(self) -> None:
        self._requests.server_came()
        self._send_next()  # goals that had their turn while no server was ready

    # --- what the runtime needs ------------------------------------------------------------

    def is_busy(self) -> bool:
        """Whether any goal is in flight or waits for a server."""
        return bool(self._listeners or self._outbox or self.monitor.waiting)

    def hears(self, since: float) -> bool:
        """Whether a server has sent anything since then, or none is there and nobody needs one.

        If not, send a request that every server answers.
        """
        if self.liveness.heard_at > since:
            return True
        if self.readiness.count == 0:
            return not self.is_busy()
        self._requests.probe()
        return False

    def has_seen_servers(self) -> bool:
        """Whether a server of any type has been in view; before that, nothing is sent."""
        if self._entities.matched is not None:
            self._entities.matched.take()  # the latest event may not have been read
        return self.readiness.has_seen_servers

    def leave(self) -> None:
        """Destroy the entities, before the node is replaced."""
        self._status.leave()
        self.monitor.leave()
        self._entities.destroy()

    def enter(self, node: Node) -> None:
        """Create the entities again, on the node that has replaced the earlier one."""
        self._entities.recreate(node)
        self._status.enter()

    # --- what the connection needs ---------------------------------------------------------------

    def server_is_ready(self) -> bool:
        """Whether goals can be sent now; it first looks at the middleware's latest event."""
        self._feedback.poll_now()
        if self.readiness.count == 0:
            self.readiness.look_again()  # it may publish feedback best-effort
        return self.readiness.ready

    def table_sizes(self) -> dict[str, int]:
        """Return how many entries each table has, for tests of growth (C7.5)."""
        return {
            **self._requests.table_sizes(),
            "goals": len(self._listeners),
            "outbox": len(self._outbox),
            "awaiting": self.monitor.waiting,
        }

    def close(self) -> None:
        """Destroy the entities. No listener is told anything after that."""
        self.runtime.node_replacement.links.pop(self, None)
        self._outbox.close()
        self.monitor.close()
        self._requests.close()
        since = self._requests.unheard_since
        if since is not None and self.runtime.now() - since > _MAY_BE_DEAD_AFTER:
            self.runtime.keep_until(since + _CLEARED_WITHIN)
        self._status.stop()
        self._feedback.close()
        for source in self._entities.sources:
            self.runtime.disable(source)
        self._entities.destroy()

    # --- what the servers send -------------------------------------------------------------

    def _on_matched(self, count: int, came: int) -> None:
        # Read now what a server said before it left. Later, a result would be too late, and a
        # status would seem to show that a lost goal is running again.
        for answers in (self._entities.goal, self._entities.result, self._entities.cancel):
            answers.take()
        self._feedback.take_all()
        self._status.take_now()
        self.readiness.matched(count, came)
        if self.readiness.count == 0:
            self._requests.heard()  # no server is left that could answer

    def _take_goal(self, seq: int, response: Any) -> None:
        self.liveness.heard()
        key = self._requests.goal_answered(seq, accepted=response.accepted)
        if key is None:
            if response.accepted and (kept := self._requests.released(seq)) is not None:
                self.on_accepted_late(seq, kept)
        elif response.accepted:
            self._listeners[key].on_accepted()
        else:
            self._listeners[key].on_rejected()

    def _take_result(self, seq: int, response: Any) -> None:
        self.liveness.heard()
        state = STATES.get(response.status)
        ended = state is not None and state.is_terminal
        outdated = self._requests.is_outdated(seq)
        answered = self._requests.answered("result", seq, knows=ended)
        key, asked_at, everybody, ends, answers = answered
        if key is None:
            return
        if state is None and not everybody and self.readiness.count > 1:
            # This server does not know the goal. Another one may know it, or the one that had
            # the goal is dead (R1).
            self.monitor.restarts.start()
            return
        self._feedback.take_all()  # the result may have overtaken some feedback (R15)
        if ended:
            self._status.take_now()  # somebody may have cancelled it just before (C4.4)
        listener = self._listeners[key]
        if listener.unwanted:
            self._requests.cancel_window.note_progress(self.runtime.now())
        if state is None or ended:
            everybody = everybody and not outdated
            listener.on_result(
                state,
                response.result,
                asked_at,
                outdated=outdated,
                everybody=everybody,
                ends=ends,
                answers=answers,
            )
        # A state in which a goal goes on is not an answer: the result is requested again.

    def _take_cancel(self, seq: int, response: Any) -> None:
        self.liveness.heard()
        self._requests.heard()
        self.monitor.restarts.count_answer(seq)
        if self._requests.probe_answered(seq, others_matter=self.monitor.restarts.running):
            self.readiness.answered()
        canceling = {bytes(info.goal_id.uuid) for info in response.goals_canceling}
        goal = self._requests.goal_of("cancel", seq)
        answer = cancel_answer(response, goal, canceling)
        unknown = answer is CancelAnswer.UNKNOWN_GOAL
        elsewhere = unknown and self.monitor.may_be_elsewhere(goal)
        answered = self._requests.cancel_answered(seq, answer, elsewhere=elsewhere)
        if elsewhere and not answered.everybody:
            self.monitor.restarts.start()
            return
        if answered.key is not None:
            self._listeners[answered.key].on_cancel_answer(answer, answered.sent_at)

    def _take_feedback(self, key: bytes, messages: list[bytes]) -> None:
        self.liveness.heard()
        if (listener := self._listeners.get(key)) is not None:
            listener.on_feedback(messages)

    def _take_status(self, key: bytes, code: int) -> None:
        self.liveness.heard()
        listener = self._listeners.get(key)
        if listener is not None and code in STATES:
            listener.on_status(STATES[code])
