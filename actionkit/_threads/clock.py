"""Keeps timers on the monotonic clock (C2.1)."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable
from typing import Protocol

_SLACK = 64
"""Cancelled timers that may always stay, so that a short queue is not rebuilt for each."""


class TimerHandle:
    """A timer, for cancelling it."""

    __slots__ = ("at", "callback")

    def __init__(self, at: float, callback: Callable[[], None]) -> None:
        self.at = at
        self.callback: Callable[[], None] | None = callback


class Timers(Protocol):
    """The clock and timers of a thread."""

    def now(self) -> float: ...
    def call_at(self, at: float, callback: Callable[[], None]) -> TimerHandle: ...


class TimerQueue:
    """Timers, in the order of their times. Used by one thread."""

    def __init__(self) -> None:
        self._heap: list[tuple[float, int, TimerHandle]] = []
        self._order = itertools.count()
        self._live = 0

    def __len__(self) -> int:
        """The number of armed timers."""
        return self._live

    @property
    def size(self) -> int:
        """The number of entries, including cancelled ones."""
        return len(self._heap)

    def arm(self, at: float, callback: Callable[[], None]) -> TimerHandle:
        """Make a timer; `pop_due` returns its callback at the monotonic time `at` or later."""
        handle = TimerHandle(at, callback)
        heapq.heappush(self._heap, (at, next(self._order), handle))
        self._live += 1
        return handle

    def cancel(self, handle: TimerHandle) -> None:
        """Never call the handle's callback; does nothing if it was called already."""
        if handle.callback is None:
            return
        handle.callback = None
        self._live -= 1
        if len(self._heap) > 2 * self._live + _SLACK:
            # Deadlines are minutes away, but most calls take milliseconds: without this, the heap
            # would keep every call of the last minutes (C7.5).
            self._heap = [entry for entry in self._heap if entry[2].callback is not None]
            heapq.heapify(self._heap)

    def next_due(self) -> float | None:
        """Return when the first timer is due, or `None`."""
        while self._heap and self._heap[0][2].callback is None:
            heapq.heappop(self._heap)
        return self._heap[0][0] if self._heap else None

    def pop_due(self, now: float) -> Callable[[], None] | None:
        """Disarm and return the callback of the first timer due by `now`, or `None`.

        One at a time, because a callback may cancel the next timers.
        """
        due = self.next_due()
        if due is None or due > now:
            return None
        handle = heapq.heappop(self._heap)[2]
        callback, handle.callback = handle.callback, None
        self._live -= 1
        return callback


class TimerGroup:
    """The timers of one owner, on the clock of a thread; closing the group cancels all.

    Used by that thread. A timer keeps its callback, and so its owner, alive until it is due or
    cancelled.
    """

    def __init__(self, timers: Timers, cancel: Callable[[TimerHandle], None]) -> None:
        self.now = timers.now
        """Monotonic seconds."""
        self._timers = timers
        self._cancel = cancel
        self._armed: set[TimerHandle] = set()
        self._closed = False

    def call_at(self, at: float, callback: Callable[[], None]) -> TimerHandle:
        """Call `callback` at the monotonic time `at`, unless the group is closed by then."""

        def fire() -> None:
            self._armed.discard(handle)
            callback()

        if self._closed:
            return TimerHandle(at, callback)  # not armed
        handle = self._timers.call_at(at, fire)
        self._armed.add(handle)
        return handle

    def close(self) -> None:
        """Cancel all timers; from now on, arm none."""
        self._closed = True
        for handle in self._armed:
            self._cancel(handle)
        self._armed.clear()
