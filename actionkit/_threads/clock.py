"""Timers on the monotonic clock (C2.1)."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable
from typing import Protocol

_SLACK = 64
"""Cancelled timers that are always kept, so that a short queue is not made again for each."""


class TimerHandle:
    """A timer, by which to cancel it."""

    __slots__ = ("at", "callback")

    def __init__(self, at: float, callback: Callable[[], None]) -> None:
        self.at = at
        self.callback: Callable[[], None] | None = callback


class Timers(Protocol):
    """The clock and the timers of a thread."""

    def now(self) -> float: ...
    def call_at(self, at: float, callback: Callable[[], None]) -> TimerHandle: ...


class TimerQueue:
    """Timers in the order in which they are due. Used by one thread."""

    def __init__(self) -> None:
        self._heap: list[tuple[float, int, TimerHandle]] = []
        self._order = itertools.count()
        self._live = 0

    def __len__(self) -> int:
        """How many timers are armed."""
        return self._live

    @property
    def size(self) -> int:
        """How many entries are kept, cancelled ones included."""
        return len(self._heap)

    def arm(self, at: float, callback: Callable[[], None]) -> TimerHandle:
        """Call `callback` once `pop_due` is asked at the monotonic time `at` or later."""
        handle = TimerHandle(at, callback)
        heapq.heappush(self._heap, (at, next(self._order), handle))
        self._live += 1
        return handle

    def cancel(self, handle: TimerHandle) -> None:
        """Never call the handle's callback. Harmless when it was called already."""
        if handle.callback is None:
            return
        handle.callback = None
        self._live -= 1
        if len(self._heap) > 2 * self._live + _SLACK:
            # Deadlines lie minutes ahead of calls that take milliseconds: without this the
            # heap would hold every call of the last minutes (C7.5).
            self._heap = [entry for entry in self._heap if entry[2].callback is not None]
            heapq.heapify(self._heap)

    def next_due(self) -> float | None:
        """Return when the first timer is due, or `None`."""
        while self._heap and self._heap[0][2].callback is None:
            heapq.heappop(self._heap)
        return self._heap[0][0] if self._heap else None

    def pop_due(self, now: float) -> Callable[[], None] | None:
        """Disarm and return the callback of the first timer due by `now`, or `None`.

        One at a time, because a callback may cancel the timers that are due after it.
        """
        due = self.next_due()
        if due is None or due > now:
            return None
        handle = heapq.heappop(self._heap)[2]
        callback, handle.callback = handle.callback, None
        self._live -= 1
        return callback


class TimerGroup:
    """The timers of one owner on a thread's clock, which end with it. Used by that thread.

    A timer holds its callback, and with that its owner, until it is due or cancelled.
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
            return TimerHandle(at, callback)  # never armed
        handle = self._timers.call_at(at, fire)
        self._armed.add(handle)
        return handle

    def close(self) -> None:
        """Cancel all timers, and arm none any more."""
        self._closed = True
        for handle in self._armed:
            self._cancel(handle)
        self._armed.clear()
