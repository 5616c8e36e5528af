"""The goal requests of a client in their order, a few at a time.

A server's request queue is 10 deep and drops what does not fit (R3), so no more than a window
of requests is on its way unanswered; the rest wait here (contract C1.12). All clients of a
process for one action share the window, since they share the server's queue; of clients in other
processes nothing can be known. Cancel requests have a queue, and so a window, of their own.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")

WINDOW = 8


class Window:
    """How many requests may be on their way, for any number of senders."""

    def __init__(self, size: int = WINDOW) -> None:
        self._size = size
        self._taken = 0
        self._waiting: tuple[OrderedDict[Callable[[], None], None], ...] = (
            OrderedDict(),  # urgent
            OrderedDict(),
        )
        self._telling = False

    def enter(self, on_free: Callable[[], None], *, urgent: bool = False) -> bool:
        """Take a place; where there is none, return `False` and tell `on_free` later, once.

        Args:
            on_free: Called when there is a place.
            urgent: Whether to be told before all who are not urgent.
        """
        if self._taken >= self._size:
            self._waiting[0 if urgent else 1][on_free] = None
            return False
        self._taken += 1
        return True

    def leave(self) -> None:
        """Give a place back. Who has waited longest is told first, so that all get their turn."""
        self._taken -= 1
        if self._telling:
            return  # whoever is told may give back places himself
        self._telling = True
        try:
            while self._taken < self._size:
                queue = self._waiting[0] or self._waiting[1]
                if not queue:
                    break
                queue.popitem(last=False)[0]()
        finally:
            self._telling = False

    def forget(self, on_free: Callable[[], None]) -> None:
        """Tell `on_free` nothing any more."""
        for queue in self._waiting:
            queue.pop(on_free, None)


class CancelWindow(Window):
    """The window for cancel requests, which is smaller while answers do not come.

    Where several processes cancel at the same time, their windows together overrun the server's
    queue. Nothing tells them so but requests that are not answered: each halves the window, and
    each answer widens it by a part of a place. So they come to share the queue.
    """

    def __init__(self, size: int = WINDOW) -> None:
        super().__init__(size)
        self._most = size
        self._room = float(size)
        self.progressed_at = -math.inf
        """Monotonic time at which a goal was last confirmed while others waited for their turn.

        For as long as a server goes on so, it is worth waiting for (contract C2.5).
        """

    def answered(self) -> None:
        """A request was answered."""
        self._resize(self._room + 1.0 / self._room)

    def unanswered(self) -> None:
        """A request was not answered: it may have overrun the server's queue."""
        self._resize(self._room / 2)

    def confirmed(self, now: float) -> None:
        """A server has answered that it knows a goal, or has ended it."""
        if self._taken >= self._size or self._waiting[0] or self._waiting[1]:
            self.progressed_at = now

    def _resize(self, room: float) -> None:
        self._room = min(max(room, 1.0), float(self._most))
        self._size = int(self._room)


class Outbox(Generic[T]):
    """A queue with a window. Pure: it sends nothing itself."""

    def __init__(self, window: Window, on_free: Callable[[], None]) -> None:
        """Be empty.

        Args:
            window: Shared by all who send to the same servers.
            on_free: Called when `take` has returned `None` and may return something now.
        """
        self._window = window
        self._on_free = on_free
        self._queue: OrderedDict[bytes, T] = OrderedDict()
        self._unanswered: set[bytes] = set()

    def __len__(self) -> int:
        """How many requests wait or are unanswered."""
        return len(self._queue) + len(self._unanswered)

    def put(self, key: bytes, request: T) -> None:
        """Queue a request."""
        self._queue[key] = request

    def take(self) -> tuple[bytes, T] | None:
        """Return the next request that may go out now, or `None`."""
        if not self._queue or not self._window.enter(self._on_free):
            return None
        key, request = self._queue.popitem(last=False)
        self._unanswered.add(key)
        return key, request

    def waiting(self) -> list[T]:
        """Return the requests that were not taken so far."""
        return list(self._queue.values())

    def discard(self, key: bytes) -> None:
        """Forget a request: it was answered, or is no longer wanted."""
        self._queue.pop(key, None)
        if key in self._unanswered:
            self._unanswered.discard(key)
            self._window.leave()

    def close(self) -> None:
        """Forget all requests."""
        self._queue.clear()
        self._window.forget(self._on_free)
        for key in list(self._unanswered):
            self.discard(key)
