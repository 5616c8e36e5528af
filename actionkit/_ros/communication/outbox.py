"""Queues requests, so that only a few of them are unanswered at a time.

A server's request queue has 10 places and drops what does not fit (R3). So at most a window of
requests is unanswered at any time; the others wait in an outbox (contract C1.12). All clients of
one action in a process share the window, because they share the server's queue. Clients in other
processes are unknown. Goal requests and cancel requests have a window each, because the server has
a queue for each.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")

WINDOW = 8
"""Unanswered requests: fewer than 10, which leaves two places for other processes."""


class Window:
    """Counts the unanswered requests of any number of senders."""

    def __init__(self, size: int = WINDOW) -> None:
        self._size = size
        self._taken = 0
        self._waiting: tuple[OrderedDict[Callable[[], None], None], ...] = (
            OrderedDict(),  # urgent
            OrderedDict(),
        )
        self._telling = False

    def enter(self, on_free: Callable[[], None], *, urgent: bool = False) -> bool:
        """Take a place; if there is none, return `False` and call `on_free` once, when there is.

        Urgent senders are told before all others.
        """
        if self._taken >= self._size:
            self._waiting[0 if urgent else 1][on_free] = None
            return False
        self._taken += 1
        return True

    def leave(self) -> None:
        """Give up a place. The sender that has waited longest is told first."""
        self._taken -= 1
        if self._telling:
            return  # the sender that is being told gave up a place; the loop below continues
        self._telling = True
        try:
            while self._taken < self._size:
                queue = self._waiting[0] or self._waiting[1]
                if not queue:
                    break
                queue.popitem(last=False)[0]()
        finally:
            self._telling = False

    def stop_waiting(self, on_free: Callable[[], None]) -> None:
        """Do not call `on_free`."""
        for queue in self._waiting:
            queue.pop(on_free, None)


class Outbox(Generic[T]):
    """Requests that wait for a place in a window, or have one. It sends nothing itself."""

    def __init__(self, window: Window, on_free: Callable[[], None]) -> None:
        """Make an empty outbox.

        All code that sends to the same servers shares one window. `on_free` is called if `take` has
        returned `None` and may return something now.
        """
        self._window = window
        self._on_free = on_free
        self._urgent: OrderedDict[bytes, T] = OrderedDict()
        self._others: OrderedDict[bytes, T] = OrderedDict()
        self._unanswered: set[bytes] = set()

    def __len__(self) -> int:
        """The number of requests that wait or are unanswered."""
        return len(self._urgent) + len(self._others) + len(self._unanswered)

    def put(self, key: bytes, request: T, *, urgent: bool = False) -> None:
        """Queue a request; urgent ones are sent before all others."""
        (self._urgent if urgent else self._others)[key] = request

    def take(self) -> tuple[bytes, T] | None:
        """Return the next request that may be sent now, or `None`."""
        for queue, urgent in ((self._urgent, True), (self._others, False)):
            if queue and self._window.enter(self._on_free, urgent=urgent):
                key, request = queue.popitem(last=False)
                self._unanswered.add(key)
                return key, request
        return None

    def waiting(self) -> list[T]:
        """Return the requests that were not taken yet."""
        return [*self._urgent.values(), *self._others.values()]

    def discard(self, key: bytes) -> None:
        """Remove a request: it was answered, or is no longer wanted."""
        self._urgent.pop(key, None)
        self._others.pop(key, None)
        if key in self._unanswered:
            self._unanswered.discard(key)
            self._window.leave()

    def close(self) -> None:
        """Remove all requests."""
        self._urgent.clear()  # first, or these requests would take the places that become free
        self._others.clear()
        self._window.stop_waiting(self._on_free)
        for key in list(self._unanswered):
            self.discard(key)
