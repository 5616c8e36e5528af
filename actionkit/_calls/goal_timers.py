"""The timers of one goal, all on one timer of the communication thread.

A call that takes milliseconds arms and disarms half a dozen timers of seconds, most of which never
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

    def __init__(self, clock: Clock, on_due: Callable[[Timer], None]) -> None:
        """Arm none.

        Args:
            clock: The thread's.
            on_due: Called with each timer that is due; it is disarmed then.
        """
        self._clock = clock
        self._on_due = on_due
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

    def settle(self) -> None:
        """Tell the thread when the earliest is due, where it does not look by then anyway."""
        handle = self._handle
        earliest = min(self._due.values(), default=None)
        if handle is not None:
            if earliest is not None and handle.at <= earliest:
                return
            self._clock.cancel_timer(handle)
            self._handle = None
        if earliest is not None:
            self._handle = self._clock.call_at(earliest, self._fire)

    def _fire(self) -> None:
        self._handle = None
        while self._due:
            timer = min(self._due, key=self._due.__getitem__)
            if self._due[timer] > self._clock.now():
                break
            del self._due[timer]
            self._on_due(timer)
        self.settle()
