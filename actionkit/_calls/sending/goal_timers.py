"""Keeps the timers of one goal, with only one timer on the communication thread.

A call of a few milliseconds arms and disarms about five timers of seconds; most of them never fire.
Here these are entries in a table. The thread gets a new timer only if the earliest entry is sooner
than the timer that it has.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from actionkit._goal.effects import Timer
from actionkit._threads.clock import TimerHandle, Timers


class CancellableTimers(Timers, Protocol):
    """The communication thread's clock and timers."""

    def cancel_timer(self, handle: TimerHandle) -> None: ...


class GoalTimers:
    """When each timer of a goal is due. `settle` passes changes on to the thread."""

    def __init__(self, clock: CancellableTimers) -> None:
        """Begin without timers."""
        self._clock = clock
        self._due: dict[Timer, float] = {}
        self._handle: TimerHandle | None = None

    def __len__(self) -> int:
        """The number of armed timers."""
        return len(self._due)

    def arm(self, timer: Timer, at: float) -> None:
        """Fire a timer at a monotonic time; if it is armed, move it."""
        self._due.pop(
            timer, None
        )  # if two have the same time, the one that was armed first fires first
        self._due[timer] = at

    def disarm(self, timer: Timer) -> None:
        """Do not fire a timer."""
        self._due.pop(timer, None)

    def keep_only(self, *timers: Timer) -> None:
        """Disarm all others."""
        self._due = {timer: self._due[timer] for timer in timers if timer in self._due}

    def pop_due(self) -> Timer | None:
        """Disarm and return the first timer that is due, or `None`."""
        timer = min(self._due, key=self._due.__getitem__, default=None)
        if timer is None or self._due[timer] > self._clock.now():
            return None
        del self._due[timer]
        return timer

    def settle(self, on_due: Callable[[], None]) -> None:
        """Call `on_due` when the earliest timer is due, or earlier; it then calls `pop_due`.

        The reference to `on_due` is kept only while a timer is armed. So a goal that is over leaves
        no circle of references.
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
