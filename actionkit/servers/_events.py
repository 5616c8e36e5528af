"""The journal of a server process, on the side of the process that started it."""

from __future__ import annotations

import contextlib
import json
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

TERMINAL = frozenset({"succeeded", "canceled", "aborted"})
"""Events that end a goal."""
SYNCED = "synced"
"""The event that `Server.sync` requests as a mark in the journal."""
_ASKED_AGAIN = 1.0
"""Seconds until it is requested again; normally it takes a millisecond."""
_SHOWN_IN_ERRORS = 60
"""Events in an error text, enough for a few goals and for a screen."""


class EventNotSeenError(AssertionError, TimeoutError):
    """The journal did not show the awaited event. Both a failed assertion and a timeout.

    `ended` means that the process had ended, so waiting longer made no sense.
    """

    ended = False


@dataclass(frozen=True)
class ServerEvent:
    """One line of a server's journal.

    Attributes:
        event: What happened, such as `"accepted"`.
        goal_id: The id of its goal, as a UUID string; `None` if it is not about a goal.
        monotonic: Seconds on the monotonic clock, which all processes of a machine share.
        incarnation: 0 for the first process of a `Server`, one more after each restart.
        details: More values: `order`, `n` (the number of the feedback), ...
    """

    event: str
    goal_id: str | None
    monotonic: float
    incarnation: int = 0
    details: Mapping[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        details = " ".join(f"{key}={value}" for key, value in self.details.items())
        return f"{self.monotonic:.3f} {self.event} {self.goal_id or '-'} {details}".rstrip()


class Journal:
    """All events of a server, in order, over its restarts. Thread-safe."""

    def __init__(
        self,
        whose: str = "the server process",
        gives_up: Callable[[], bool] = lambda: False,
    ) -> None:
        """Make an empty journal.

        The writer's name is for error texts. `gives_up` says whether to stop waiting; it
        is asked at each event, and by `wake`.
        """
        self._whose = whose
        self._gives_up = gives_up
        self.events: list[ServerEvent] = []  # other code only copies it
        self.counts: Counter[str] = Counter()  # by name
        self.goals = 0  # that the server was asked for
        self.max_running = 0  # at one time
        self._changed = threading.Condition()
        # Keyed by goal and server, because one goal may run in two servers on one name.
        self._accepted: set[tuple[str, int]] = set()
        self._executing: set[tuple[str, int]] = set()
        self._incarnation = -1
        self._open = False
        self._asked = self._synced = 0

    def begin(self) -> int:
        """Record that a new process starts to write; return its incarnation."""
        with self._changed:
            self._incarnation += 1
            self._open = True
            return self._incarnation

    def end(self) -> None:
        """Record that the process is gone: it writes no more, and its goals do not run."""
        with self._changed:
            self._open = False
            self._accepted.clear()
            self._executing.clear()
            self._changed.notify_all()

    def add_line(self, line: bytes) -> None:
        """Add one line of JSON from the process; ignore half a line (the process was killed)."""
        try:
            raw: dict[str, Any] = json.loads(line)
            event = ServerEvent(
                raw.pop("event"), raw.pop("goal_id", None), raw.pop("monotonic"),
                self._incarnation, raw,
            )  # fmt: skip
        except (ValueError, KeyError):
            return
        self.add(event)

    def add(self, event: ServerEvent) -> None:
        """Add one event."""
        with self._changed:
            if event.event == SYNCED:  # only a mark
                self._synced = max(self._synced, int(event.details["n"]))
                self._changed.notify_all()
                return
            self.events.append(event)
            self.counts[event.event] += 1
            self._follow(event)
            self._changed.notify_all()

    @property
    def incarnation(self) -> int:
        """Return the number of the process that writes: 0 for the first."""
        return self._incarnation

    def wake(self) -> None:
        """Make all waiting threads check whether to give up."""
        with self._changed:
            self._changed.notify_all()

    def _follow(self, event: ServerEvent) -> None:
        if event.event == "restarting":
            # This is the last event before the process starts its program again.
            self._incarnation += 1
            self._accepted.clear()
            self._executing.clear()
        if event.goal_id is None:
            return
        key = (event.goal_id, int(event.details.get("server", 0)))
        if event.event == "goal_received" and "again" not in event.details:
            self.goals += 1
        elif event.event == "accepted":
            self._accepted.add(key)
        elif event.event == "executing":
            self._executing.add(key)
            self.max_running = max(self.max_running, len(self._executing))
        elif event.event in TERMINAL:
            self._accepted.discard(key)
            self._executing.discard(key)

    def sync(self, ask: Callable[..., None], timeout: float) -> None:
        """Block until a mark that the process writes now has been read, or the process is gone.

        `ask` makes the process write the mark `n`; it raises `RuntimeError` if the process has
        ended.

        Raises:
            TimeoutError: The mark did not come within `timeout` seconds.
        """
        with self._changed:
            self._asked += 1
            mark = self._asked
        until = time.monotonic() + timeout

        def is_over() -> bool:
            return self._synced >= mark or not self._open

        while (left := until - time.monotonic()) > 0:
            with contextlib.suppress(RuntimeError):  # its last output is still to be read
                ask(n=mark)
            with self._changed:
                # A process that starts again loses earlier requests.
                if self._changed.wait_for(is_over, min(left, _ASKED_AGAIN)):
                    return
        raise TimeoutError(f"{self._whose} did not answer within {timeout:g} s")

    def running(self) -> set[str]:
        """Return the ids of goals that are accepted and have not ended; none without a process."""
        with self._changed:
            return {goal_id for goal_id, _ in self._accepted}

    def wait_for(
        self,
        event: str,
        *,
        goal_id: str | None = None,
        incarnation: int | None = None,
        count: int = 1,
        timeout: float = 10.0,
    ) -> list[ServerEvent]:
        """Block until `count` such events were seen; return all of them.

        Raises:
            EventNotSeenError: After `timeout` seconds, or at once if the process has ended.
        """
        found: list[ServerEvent] = []
        seen = 0

        def is_over() -> bool:
            nonlocal seen
            found.extend(
                entry
                for entry in self.events[seen:]
                if entry.event == event
                and goal_id in (None, entry.goal_id)
                and incarnation in (None, entry.incarnation)
            )
            seen = len(self.events)
            return len(found) >= count or not self._open or self._gives_up()

        with self._changed:
            self._changed.wait_for(is_over, timeout)
            if len(found) >= count:
                return found
            ended = not self._open
            shown = [str(entry) for entry in self.events[-_SHOWN_IN_ERRORS:]]
        error = EventNotSeenError(
            f"saw {len(found)} of {count} {event!r} events"
            + (f" of goal {goal_id}" if goal_id else "")
            + (f" before {self._whose} ended" if ended else f" within {timeout:g} s")
            + f"; the last {len(shown)} events:\n  "
            + "\n  ".join(shown)
        )
        error.ended = ended
        raise error
