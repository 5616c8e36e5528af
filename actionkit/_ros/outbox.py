"""The goal requests of one client in their order, a few at a time.

A server's request queue is 10 deep and drops what does not fit (R3), so no more than a window
of requests is on its way unanswered; the rest wait here (contract C1.12).
"""

from __future__ import annotations

from collections import OrderedDict
from typing import Generic, TypeVar

T = TypeVar("T")

WINDOW = 8


class Outbox(Generic[T]):
    """A queue with a window. Pure: it sends nothing itself."""

    def __init__(self, window: int = WINDOW) -> None:
        self._window = window
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
        if not self._queue or len(self._unanswered) >= self._window:
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
        self._unanswered.discard(key)
