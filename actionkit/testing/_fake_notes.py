"""Records a fake server's events, and checks the event names that tests wait for."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from actionkit.servers._events import Journal, ServerEvent

EVENTS = (
    "received",
    "accepted",
    "rejected",
    "executing",
    "feedback",
    "cancel_requested",
    "cancel_accepted",
    "cancel_refused",
    "succeeded",
    "aborted",
    "canceled",
)


class Notes:
    """The journal of a fake server, as its ROS side writes it.

    While a thread holds the lock, no other thread writes.
    """

    def __init__(
        self, journal: Journal, received: list[Any], on_error: Callable[[BaseException], None]
    ) -> None:
        self.lock = threading.RLock()
        self._journal = journal
        self._received = received
        self._known: set[str | None] = set()
        self._on_error = on_error

    def emit(self, event: str, goal_id: str | None = None, **details: Any) -> None:
        if event == "error":
            self._on_error(RuntimeError(f"the fake server itself failed: {details['message']}"))
        if event == "goal_received":
            if goal_id in self._known:  # the request was sent again
                return
            self._known.add(goal_id)
            event, details = "received", {"number": len(self._received) - 1}
        details.pop("order", None)  # only for goals of Fibonacci
        # To see whether a server is alive, clients cancel goals that do not exist.
        if event not in EVENTS or details.pop("running", None) is False:
            return
        with self.lock:
            self._journal.add(
                ServerEvent(
                    event, goal_id, time.monotonic(), self._journal.incarnation, dict(details)
                )
            )


def checked_event(event: object) -> str:
    """Return an event's name.

    Raises:
        ValueError: There is no such event.
    """
    if isinstance(event, str) and event in EVENTS:
        return event
    raise ValueError(f"there is no event {event!r}. There are: {', '.join(EVENTS)}")
