"""A clock that only the test moves, with timers on it."""

from __future__ import annotations

from collections.abc import Callable

from actionkit._threads.clock import TimerHandle, TimerQueue


class Clock:
    """Timers on a clock that only `advance` moves."""

    def __init__(self) -> None:
        self.time = 100.0
        self.queue = TimerQueue()
        self.cancel_timer = self.queue.cancel

    def now(self) -> float:
        return self.time

    def call_at(self, at: float, callback: Callable[[], None]) -> TimerHandle:
        return self.queue.arm(at, callback)

    def advance(self, seconds: float) -> None:
        end = self.time + seconds
        while (due := self.queue.next_due()) is not None and due <= end:
            self.time = max(self.time, due)
            callback = self.queue.pop_due(self.time)
            assert callback is not None
            callback()
        self.time = end


class CommunicationThread(Clock):
    """The part of the communication thread that sends and waits, without the thread."""

    def __init__(self) -> None:
        super().__init__()
        self.sources: set[object] = set()
        self.enable = self.sources.add
        self.disable = self.sources.discard
