"""Handles items one after the other, and not on the thread that adds them (R8)."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

from actionkit._threads.waiting import taken_from

_T = TypeVar("_T")


class SerialQueue(ABC, Generic[_T]):
    """A queue that is emptied by one thread at a time. No thread waits for another to use it.

    A subclass decides in `_begin` what empties it: that calls `_take` until there is no item.
    """

    def __init__(self, most: int | None = None) -> None:
        """Make an empty queue. If more than `most` items wait, the oldest are left out."""
        self._items: deque[_T] = deque(maxlen=most)
        self._finishes: deque[Callable[[], object]] = deque()
        self._in_use = threading.Lock()
        """Held while the queue is emptied. Nobody waits for it: its holder checks for more items
        at the end."""

    def put(self, *items: _T) -> None:
        """Queue items. Never blocks."""
        self._items.extend(items)
        self._look()

    def finish(self, then: Callable[[], object]) -> None:
        """Call `then` once, when no item is waiting or being handled; now if that is so."""
        self._finishes.append(then)
        self._look()

    @abstractmethod
    def _begin(self) -> None:
        """Let another thread empty the queue soon."""

    def _look(self) -> None:
        """Begin if there is something to do and nobody does it."""
        if (self._items or self._finishes) and self._in_use.acquire(blocking=False):
            if self._items:
                self._begin()
            else:
                self._rest()

    def _take(self) -> _T | None:
        """Return the next item; `None` if there is none, and the queue is free for others."""
        for item in taken_from(self._items):
            return item
        self._rest()
        return None

    def _rest(self) -> None:
        """Free the queue for others."""
        while self._finishes and not self._items:  # in this order: an item may come before the next
            for then in taken_from(self._finishes):
                then()
                break
        self._in_use.release()
        self._look()  # something may have been queued just before
