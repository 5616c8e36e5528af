"""The timers of one goal, all on one timer of the communication thread.

A call that takes milliseconds arms and disarms half a dozen timers of seconds; most of them never
fire. Here that is a few entries in a table: the thread is told only where the earliest one comes
sooner than what it knows.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from actionkit._goal.effects import Timer
from actionkit._threads.clock import TimerHandle, Timers


class Clock(Timers, Protocol):
    """The communication thread's clock and timers."""

    def cancel_timer(self, handle: TimerHandle) -> None: ...


class GoalTimers:
    """What is due when. The thread hears of changes at `settle`."""

    def __init__(self, clock: Clock) -> None:
        """Arm none, on the clock of the thread."""
        self._clock = clock
        self._due: dict[Timer, float] = {}
        self._handle: TimerHandle | None = None

    def __len__(self) -> int:
        """How many are armed."""
        return len(self._due)

    def arm(self, timer: Timer, at: float) -> None:
        """Have it fire at a monotonic time; one that is armed is moved."""
        self._due.pop(
            timer, None
        )  # of two at the same time the one that was armed first fires first
        self._due[timer] = at

    def disarm(self, timer: Timer) -> None:
        """Do not fire it."""
        self._due.pop(timer, None)

    def keep_only(self, *timers: Timer) -> None:
        """Disarm all others."""
        self._due = {timer: self._due[timer] for timer in timers if timer in self._due}

    def pop_due(self) -> Timer | None:
        """Disarm and return the first that is due, or `None`."""
        timer = min(self._due, key=self._due.__getitem__, default=None)
        if timer is None or self._due[timer] > self._clock.now():
            return None
        del self._due[timer]
        return timer

    def settle(self, on_due: Callable[[], None]) -> None:
        """Have `on_due` called when the earliest is due, or earlier: it asks `pop_due` then.

        It is held while a timer is armed, and no longer: a goal that is over leaves no circle of
        references behind.
        """
        handle = self._handle
        earliest = min(self._due.values(), default=None)
        if handle is not None:
            if earliest is not None and handle.callback is not None and handle.at <= earliest:
                return
            self._clock.cancel_timer(handle)
            self._handle = None
        if earliest is not None:
            self._handle = self._clock.call_at(earliest, on_due)
