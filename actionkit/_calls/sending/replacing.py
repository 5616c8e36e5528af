"""Replaces the goal of an earlier call by that of a new one (C1.15).

By default the earlier goal is cancelled, and the new one is sent when the earlier one has stopped.
With `preempt=True` the server does that by itself: the new goal is sent at once.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import Any, Protocol

from actionkit._calls.futures.future import GoalFuture
from actionkit._model.arguments import check_type
from actionkit._model.values import GoalReport
from actionkit._threads.clock import TimerHandle
from actionkit._threads.function_runner import Scheduler


class GoalsWatch(Scheduler, Protocol):
    """What is needed of the session."""

    on_goals_changed: set[Callable[[], None]]


def check_replaces(replaces: object, preempt: object, session: object) -> None:
    """Check the arguments of a call.

    Raises:
        TypeError: `replaces` is not a future, or `preempt` is not a bool.
        ValueError: The future is of another client, or there is none with `preempt=True`.
    """
    if not isinstance(preempt, bool):
        raise TypeError(f"preempt={preempt!r} must be True or False")
    if replaces is None:
        if preempt:
            raise ValueError("preempt=True needs replaces=, the future of the goal to replace")
        return
    check_type("replaces", replaces, GoalFuture)
    assert isinstance(replaces, GoalFuture)
    if not replaces._is_of(session):
        raise ValueError(
            f"replaces={replaces!r} is of another client: give a future of the client that calls"
        )


AnyFuture = GoalFuture[Any, Any]


def to_replace(earlier: AnyFuture | None) -> tuple[AnyFuture, ...]:
    """Return the calls to replace: the earlier one, and those that it was to replace itself.

    If three goals are sent soon one after the other, the first may still be stopping when the third
    replaces the second, which was not sent.
    """
    return () if earlier is None else (earlier, *earlier._call.to_replace)


def blocks_another(earlier: AnyFuture, **unless: bool) -> bool:
    """Whether no other goal may be sent beside those of this call (`GoalFacts.blocks_another`)."""
    # In this order: while a call is not over, it might send another goal.
    return not earlier.done() or earlier._call.goals.block_another(**unless)


def not_stopped(futures: Iterable[AnyFuture]) -> tuple[AnyFuture, ...]:
    """Return those calls that have a goal that may run, or may still send one."""
    return tuple(one for one in futures if blocks_another(one))


class Replacing:
    """Waits until all goals of earlier calls have stopped. On the communication thread."""

    def __init__(
        self,
        earlier: tuple[AnyFuture, ...],
        session: GoalsWatch,
        on_stopped: Callable[[], None],
        on_kept: Callable[[tuple[GoalReport, ...]], None],
    ) -> None:
        """Take what is needed. `on_kept` gets the goals that may still be running."""
        self._earlier = earlier
        self._session = session
        self._on_stopped = on_stopped
        self._on_kept = on_kept
        self._limit: TimerHandle | None = None

    def begin(self, seconds: float) -> None:
        """Cancel the earlier calls, and wait for so many seconds at most."""
        self._limit = self._session.call_at(time.monotonic() + seconds, self._time_is_up)
        self._session.on_goals_changed.add(self._look)
        for future in self._earlier:
            future.cancel()
        self._look()

    def drop(self) -> None:
        """Wait no more. Harmless if it has ended."""
        if self._limit is not None:
            self._session.cancel_timer(self._limit)
            self._limit = None
            self._session.on_goals_changed.discard(self._look)

    def _look(self) -> None:
        if self._limit is not None and not not_stopped(self._earlier):
            self.drop()
            self._on_stopped()

    def _time_is_up(self) -> None:
        self._look()
        if self._limit is not None:
            self.drop()
            left = not_stopped(self._earlier)
            self._on_kept(tuple(each for one in left for each in one._call.goals.left().reports))
