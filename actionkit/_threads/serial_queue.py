"""Items that are handled one after the other, and not on the thread that puts them in (R8)."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

from actionkit._threads.waiting import taken_from

_T = TypeVar("_T")


class SerialQueue(Generic[_T]):
    """A queue that one thread at a time empties. Nobody waits for another to use it.

    A subclass says in `_begin` what empties it: that calls `_take` until there is no item.
    """

    def __init__(self, most: int | None = None) -> None:
        """Make an empty one. If more than `most` items wait, the oldest are left out."""
        self._items: deque[_T] = deque(maxlen=most)
        self._finishes: deque[Callable[[], object]] = deque()
        self._in_use = threading.Lock()
        """Held while it is emptied. Nobody waits for it: who has it looks for more at the end."""

    def put(self, *items: _T) -> None:
        """Queue items. Never blocks."""
        self._items.extend(items)
        self._look()

    def finish(self, then: Callable[[], object]) -> None:
        """Call `then` once, when no item waits or is handled; now if that is so."""
        self._finishes.append(then)
        self._look()

    def _begin(self) -> None:
        """Have the queue emptied soon, by another thread."""
        raise NotImplementedError

    def _look(self) -> None:
        """Begin, if there is anything to do and nobody does it."""
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
