"""A list that one thread fills and another thread waits for."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Generic, TypeVar, overload

T = TypeVar("T")


class EventLog(Generic[T]):
    """A list of events, in order. Pass it, or its `append`, as a callback or an observer.

    log = EventLog()
    future = client.call_async(goal, on_feedback=log)
    log.wait_for(3)                                    # three feedbacks
    log.wait_for(lambda fb: len(fb.sequence) > 5)      # that one
    Client(..., observers=[EventLog()])                # every GoalEvent
    """

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._items: list[T] = []

    def append(self, item: T) -> None:
        """Append `item` and wake the threads that wait. From any thread."""
        with self._changed:
            self._items.append(item)
            self._changed.notify_all()

    __call__ = append

    def on_event(self, event: T, call: object) -> None:
        """Append a `GoalEvent`. This method makes the log an observer of a client."""
        self.append(event)

    @property
    def items(self) -> list[T]:
        """Return a copy of all items."""
        with self._changed:
            return list(self._items)

    def __len__(self) -> int:
        with self._changed:
            return len(self._items)

    def __iter__(self) -> Iterator[T]:
        return iter(self.items)

    def __repr__(self) -> str:
        return f"EventLog({self.items!r})"

    @overload
    def wait_for(self, wanted: int, timeout: float = 5.0) -> list[T]: ...

    @overload
    def wait_for(self, wanted: Callable[[T], object], timeout: float = 5.0) -> T: ...

    def wait_for(self, wanted: int | Callable[[T], object], timeout: float = 5.0) -> list[T] | T:
        """Block until the wanted items are there, without polling.

        Args:
            wanted: How many items must be there; or a function that must be true for one item. It
                is called once with each item.
            timeout: Seconds to wait.

        Returns:
            All items; or the first item for which the function is true.

        Raises:
            TimeoutError: They did not come in time; the message has the items.
        """
        found: list[T] = []
        asked = 0

        def is_there() -> bool:
            nonlocal asked
            if isinstance(wanted, int):
                return len(self._items) >= wanted
            while asked < len(self._items) and not found:
                asked += 1
                found.extend(item for item in self._items[asked - 1 : asked] if wanted(item))
            return bool(found)

        with self._changed:
            if not self._changed.wait_for(is_there, timeout):
                what = f"{wanted} items" if isinstance(wanted, int) else "the wanted item"
                raise TimeoutError(f"not {what} within {timeout:g} s, but: {self._items!r}")
            return list(self._items) if isinstance(wanted, int) else found[0]
