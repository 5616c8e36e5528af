"""Drives one goal that was sent: passes events to its state machine and carries out its effects.

All of it happens on the communication thread.
"""

from __future__ import annotations

import logging
import uuid
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any, ClassVar, Protocol

from actionkit._calls.sending.goal_timers import CancellableTimers, GoalTimers
from actionkit._goal import effects as fx
from actionkit._goal.facts import GoalFacts
from actionkit._goal.machine import Goal
from actionkit._goal.stages import CancelReason, Stage
from actionkit._model.cancel_answer import CancelAnswer
from actionkit._model.settings import Timeouts
from actionkit._model.values import GoalState
from actionkit._threads.diagnostics import log_later


class LivenessCheck(Protocol):
    """Checks from time to time whether the servers respond."""

    def start(self, limit: float) -> None: ...


class AttemptLink(Protocol):
    """What an attempt needs of the link to the servers; `_ros.sending.link.Link` implements it."""

    @property
    def runtime(self) -> CancellableTimers: ...
    @property
    def liveness(self) -> LivenessCheck: ...
    @property
    def others_confirmed_at(self) -> float: ...
    def send_goal(self, listener: Attempt, goal: Any) -> int: ...
    def follow_goal(self, listener: Attempt, request: int | None = None) -> int: ...
    def leave_outbox(self, listener: Attempt) -> None: ...
    def sees_server_of(self, listener: Attempt) -> bool: ...
    def seems_replaced(self, listener: Attempt) -> bool: ...
    def ask_result(self, listener: Attempt, *, supersedes_earlier: bool = False) -> None: ...
    def ask_cancel(self, listener: Attempt, *, urgent: bool) -> None: ...
    def stop_cancel(self, listener: Attempt) -> None: ...
    def watch_status(self) -> None: ...
    def forget(self, listener: Attempt, keep: GoalFacts | None = None) -> None: ...


class AttemptOwner(Protocol):
    """The call that an attempt belongs to and reports to."""

    @property
    def unwanted(self) -> bool: ...
    @property
    def urgent(self) -> bool: ...
    def on_record(self, attempt: Attempt, record: fx.Record) -> None: ...
    def on_feedback(self, attempt: Attempt, messages: list[bytes]) -> None: ...
    def on_end(self, attempt: Attempt, ending: fx.Ending) -> None: ...
    def on_late_result(self, attempt: Attempt, state: GoalState, result: Any) -> None: ...
    def on_over(self, attempt: Attempt) -> None: ...


class CallForgotten:
    """Stands for a call that is over and was forgotten: it needs no news."""

    unwanted, urgent = True, False

    def on_record(self, attempt: Attempt, record: fx.Record) -> None: ...
    def on_feedback(self, attempt: Attempt, messages: list[bytes]) -> None: ...
    def on_end(self, attempt: Attempt, ending: fx.Ending) -> None: ...
    def on_late_result(self, attempt: Attempt, state: GoalState, result: Any) -> None: ...
    def on_over(self, attempt: Attempt) -> None: ...


class Attempt:
    """Drives one `Goal` over one link."""

    def __init__(
        self,
        link: AttemptLink,
        goal_id: uuid.UUID,
        timeouts: Timeouts,
        owner: AttemptOwner,
        *,
        on_change: Callable[[Attempt], None],
    ) -> None:
        """Make an attempt; the caller sends its goal next.

        We choose `goal_id` ourselves, so the goal can be cancelled before the server has
        acknowledged it (R5). `on_change` is called when nothing is left to watch (`goal.stage` is
        OVER), when nothing can be watched for now because the server is gone (LOST), and when a
        server has refused to cancel the goal.
        """
        self.goal_id = goal_id
        self.number = 1
        """Its number among the call's attempts; the owner sets it."""
        self.goal = Goal(goal_id, timeouts)
        self._first: Callable[[float, int], list[fx.Effect]] = self.goal.sent
        self._link = link
        self._liveness = timeouts.liveness
        self._now = link.runtime.now
        self.owner = self._sender = owner
        self._on_change = on_change
        self._timers = GoalTimers(link.runtime)
        self._effects: deque[fx.Effect] = deque()
        self._applying = False
        self._servers = 1
        self._in_outbox = True
        self._cancels = 0  # requests sent, minus those for which a server did not know the goal
        self._first_cancel_at = 0.0  # when the first of them was sent
        self._ended_by_others = False  # before any of them was sent

    @property
    def unwanted(self) -> bool:
        """Whether the caller has cancelled: then the goal must not be sent."""
        return self.owner.unwanted

    @property
    def cancel_is_ours(self) -> bool:
        """Whether one of our cancel requests may have cancelled the goal (C4.4)."""
        return self._cancels > 0 and not self._ended_by_others

    # --- the caller's wishes ---------------------------------------------------------------

    def send(self, message: Any) -> None:
        """Send the goal. If rclpy raises an error, nothing was sent."""
        self._servers = self._link.send_goal(self, message)

    def attach(self, *, left_alone: bool, just_sent: bool = False) -> None:
        """Have the link tell about a goal that somebody else has sent, perhaps just now."""
        self._servers = self._link.follow_goal(self)
        self._leave_outbox()
        self._first = partial(self.goal.attached, left_alone=left_alone, just_sent=just_sent)

    def attach_again(self, owner: AttemptOwner, timeouts: Timeouts, *, left_alone: bool) -> None:
        """Follow the goal for another call, which attaches to it; the earlier call is over."""
        self.owner = owner
        self._liveness = timeouts.liveness
        self._leave_outbox()
        self._first = partial(self.goal.attached_again, timeouts, left_alone=left_alone)

    def take_back(self, facts: GoalFacts, request: int) -> None:
        """Follow a goal that was released again: another server has accepted its `request`."""
        self._in_outbox = False
        servers = self._link.follow_goal(self, request)
        self._apply(self.goal.taken_back(facts, servers, self._now()))

    def start(self) -> None:
        """Follow the goal after `send` or `attach`."""
        if self._liveness is not None:
            self._link.liveness.start(self._liveness)
        self._apply(self._first(self._now(), self._servers))

    def give_up(self, why: CancelReason, *, abandon: bool = False) -> None:
        """Cancel the goal because nobody wants it; with `abandon`, let it run instead."""
        effects = self.goal.give_up(why, self._now(), abandon=abandon)
        self._apply(effects)
        asked_before = not effects and why is CancelReason.CANCELLED
        if asked_before and self.owner.urgent and not self.goal.facts.is_lost_with_server:
            self.cancel_again()  # before others: at Ctrl-C, rclpy's handler may close us first

    def cancel_again(self) -> None:
        """Ask once more for the cancellation of a goal that was given up on."""
        if self.goal.stage is not Stage.OVER:
            self._link.ask_cancel(self, urgent=True)

    def end_grace(self) -> None:
        """End the wait for the confirmation of a cancellation."""
        self._apply(self.goal.timer(fx.Timer.CANCEL, self._now()))

    def fail(self, reason: str, error: BaseException) -> None:
        """End the attempt because the communication thread broke."""
        self._apply(self.goal.fail(reason, error, self._now()))

    def forget(self) -> None:
        """Stop tracking the goal; it may still be running."""
        self._apply(self.goal.forget())

    def drop(self) -> None:
        """Cancel all timers: the link is gone."""
        self.goal.lose_touch()
        self._timers.keep_only()
        self._timers.settle(self._fire)

    # --- what the link tells ---------------------------------------------------------------

    def on_server_ready(self) -> None:
        facts = self.goal.facts
        # If there are several servers, any that was out of sight may be the one that runs it.
        back = self._link.sees_server_of(self) and not (facts.servers > 1 and facts.away)
        self._apply((self.goal.server_back if back else self.goal.server_ready)(self._now()))

    def on_servers_changed(self, servers: int, away: int) -> None:
        self._apply(self.goal.servers_changed(servers, away))

    def on_accepted(self) -> None:
        self._apply(self.goal.accepted(self._now()))

    def on_rejected(self) -> None:
        seen = self.goal.stage is not Stage.LOST
        self._apply(self.goal.rejected(self._now()))
        self._look_whether_lost(seen)

    def on_feedback(self, messages: list[bytes]) -> None:
        # First record the states that feedback proves, so acceptance is visible before it (C1.8).
        self._apply(self.goal.feedback(self._now()))
        self.owner.on_feedback(self, messages)

    def on_status(self, state: GoalState) -> None:
        ours = self.cancel_is_ours
        if state.is_terminal and self.goal.facts.servers == 1:
            self._ended_by_others = not ours  # what is sent from now on has not done it
        self._apply(self.goal.status(state, self._now(), ours=ours))

    def on_result(
        self,
        state: GoalState | None,
        result: Any,
        asked_at: float,
        *,
        outdated: bool = False,
        everybody: bool = True,
        ends: int = 1,
        answers: int = 1,
    ) -> None:
        if state is None and outdated:
            return  # "goal unknown" answers an old request; the result was requested again
        if self.goal.facts.servers > 1:
            self._ended_by_others = False  # that was on another server
        ours, own = self.cancel_is_ours, self._link.sees_server_of(self)
        if state is not None:
            self._ended_by_others = not ours
        now, seen = self._now(), self.goal.stage is not Stage.LOST
        self._apply(
            self.goal.result(
                state,
                result,
                now,
                asked_at=asked_at,
                ours=ours,
                own=own,
                everybody=everybody,
                ends=ends,
                answers=answers,
            )
        )
        self._look_whether_lost(seen)

    def on_cancel_sent(self) -> None:
        if not self._cancels:
            self._first_cancel_at = self._now()
        self._cancels += 1

    def on_cancel_answer(self, answer: CancelAnswer, asked_at: float) -> None:
        if answer is CancelAnswer.UNKNOWN_GOAL and not self._link.seems_replaced(self):
            # Not if another server answers, and the one that has the goal may only be slow. Some
            # answers are to requests for earlier attempts.
            self._cancels = max(0, self._cancels - 1)
        first = self._cancels == 1 or asked_at <= self._first_cancel_at
        if answer is CancelAnswer.TERMINATED and first and self.goal.facts.servers == 1:
            # It had ended, or was being cancelled, before our first request came.
            self._cancels = max(0, self._cancels - 1)
        own = self._link.sees_server_of(self)
        self._apply(self.goal.cancel_answered(answer, self._now(), asked_at=asked_at, own=own))

    def on_server_lost(self, reason: str) -> None:
        self._apply(self.goal.server_lost(reason, self._now()))
        self._look_whether_lost(True)
        self._on_change(self)

    def _look_whether_lost(self, was_seen: bool) -> None:
        if was_seen and self.goal.stage is Stage.LOST:
            self._link.stop_cancel(self)
            self.owner.on_over(self)  # the policy may allow another goal now
            self._on_change(self)

    # --- carrying out ----------------------------------------------------------------------

    def _apply(self, effects: list[fx.Effect]) -> None:
        """Carry out effects in order; new effects that they cause come after them."""
        self._effects.extend(effects)
        if self._applying:
            return
        self._applying = True
        try:
            while self._effects:
                effect = self._effects.popleft()
                self._CARRY_OUT[type(effect)](self, effect)
        finally:
            self._applying = False
            self._timers.settle(self._fire)
        waiting = self.goal.stage is Stage.SENT and not self.goal.settled
        if self._in_outbox and not waiting:
            # An answer came, or the time to wait for it is over: the next goal may be sent.
            self._leave_outbox()

    def _leave_outbox(self) -> None:
        self._in_outbox = False
        self._link.leave_outbox(self)

    def _arm(self, effect: fx.Arm) -> None:
        self._timers.arm(effect.timer, effect.at)

    def _disarm(self, effect: fx.Disarm) -> None:
        self._timers.disarm(effect.timer)

    def _record(self, effect: fx.Record) -> None:
        self.owner.on_record(self, effect)
        if effect.cancel_refused:
            self._on_change(self)

    def _ask_result(self, effect: fx.AskResult) -> None:
        self._link.ask_result(self, supersedes_earlier=effect.anew)

    def _ask_cancel(self, _: fx.AskCancel) -> None:
        urgent = self.owner.urgent or self.goal.cancel_reason is CancelReason.DEADLINE
        self._link.ask_cancel(self, urgent=urgent)

    def _stop_cancel(self, _: fx.StopCancel) -> None:
        self._link.stop_cancel(self)

    def _watch_status(self, _: fx.WatchStatus) -> None:
        self._link.watch_status()

    def _runs_elsewhere(self, _: fx.RunsElsewhere) -> None:
        log_later(
            logging.WARNING,
            "goal %s is over, and another server on the name of its action has accepted it, too,"
            " and has not confirmed that it cancels it: IT MAY STILL BE RUNNING."
            " Two servers on one name both run every goal: keep one of them",
            self.goal_id,
        )

    def _settle(self, effect: fx.Settle) -> None:
        self._timers.keep_only(fx.Timer.REASK)
        self.owner.on_end(self, effect.ending)

    def _late_result(self, effect: fx.LateResult) -> None:
        self.owner.on_late_result(self, effect.state, effect.result)

    def _release(self, _: fx.Release) -> None:
        self._timers.keep_only()
        # One that is left running on purpose is not cancelled elsewhere either.
        self._link.forget(self, keep=None if self.goal.abandoned else self.goal.facts)
        self._on_change(self)
        self.owner.on_over(self)
        if self._sender is not self.owner:
            self._sender.on_over(self)  # the ledger may have its call

    _CARRY_OUT: ClassVar[dict[type[fx.Effect], Callable[[Attempt, Any], None]]] = {
        fx.Arm: _arm,
        fx.Disarm: _disarm,
        fx.Record: _record,
        fx.RunsElsewhere: _runs_elsewhere,
        fx.AskResult: _ask_result,
        fx.AskCancel: _ask_cancel,
        fx.StopCancel: _stop_cancel,
        fx.WatchStatus: _watch_status,
        fx.Settle: _settle,
        fx.LateResult: _late_result,
        fx.Release: _release,
    }

    def _fire(self) -> None:
        while (timer := self._timers.pop_due()) is not None:
            confirmed_at = self._link.others_confirmed_at
            seen = self.goal.stage is not Stage.LOST
            self._apply(self.goal.timer(timer, self._now(), others_confirmed_at=confirmed_at))
            self._look_whether_lost(seen)
        self._timers.settle(self._fire)
