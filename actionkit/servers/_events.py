"""What a server process reports, as its parent sees it."""

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
"""The mark in the journal that `Server.sync` asks for."""
_ASKED_AGAIN = 1.0
"""Seconds; an answer takes a millisecond."""
_SHOWN_IN_ERRORS = 60
"""Events; those of a few goals, which fit on a screen."""


class EventNotSeenError(AssertionError, TimeoutError):
    """The journal did not show what was waited for. Both a failed assertion and a timeout.

    Attributes:
        ended: The process had ended, so there was nothing more to wait for.
    """

    ended = False


@dataclass(frozen=True)
class ServerEvent:
    """One line of a server's journal.

    Attributes:
        event: What happened, such as `"accepted"`.
        goal_id: The goal that it happened to, as a UUID string; `None` where there is none.
        monotonic: Seconds on the monotonic clock, which all processes of a machine share.
        incarnation: 0 for the first process of a `Server`, one more after each restart.
        details: What else was said: `order`, `n` (the number of the feedback), ...
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
    """All events of a server, in order, over its restarts. Thread-safe.

    Attributes:
        events: Those that have happened; only to be copied.
        counts: How many there were of each name.
        goals: How many goals the server was asked for.
        max_running: The most goals that ever executed at one time.
    """

    def __init__(
        self,
        whose: str = "the server process",
        gives_up: Callable[[], bool] = lambda: False,
    ) -> None:
        """Make an empty one.

        Args:
            whose: The writer's name, for error texts.
            gives_up: Whether to wait no more; asked at each event, and by `wake`.
        """
        self._whose = whose
        self._gives_up = gives_up
        self.events: list[ServerEvent] = []
        self.counts: Counter[str] = Counter()
        self.goals = 0
        self.max_running = 0
        self._changed = threading.Condition()
        # Keyed by goal and server, because one goal may run in two servers on one name.
        self._accepted: set[tuple[str, int]] = set()
        self._executing: set[tuple[str, int]] = set()
        self._incarnation = -1
        self._open = False
        self._asked = self._synced = 0

    def begin(self) -> int:
        """Note that a new process starts to write; return its incarnation."""
        with self._changed:
            self._incarnation += 1
            self._open = True
            return self._incarnation

    def end(self) -> None:
        """Note that the process is gone: no event follows, and none of its goals runs."""
        with self._changed:
            self._open = False
            self._accepted.clear()
            self._executing.clear()
            self._changed.notify_all()

    def add_line(self, line: bytes) -> None:
        """Take one line of JSON from the process; a torn line (it was killed) is left out."""
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
        """Take one event."""
        with self._changed:
            if event.event == SYNCED:  # a mark, and nothing that happened
                self._synced = max(self._synced, int(event.details["n"]))
                self._changed.notify_all()
                return
            self.events.append(event)
            self.counts[event.event] += 1
            self._follow(event)
            self._changed.notify_all()

    @property
    def incarnation(self) -> int:
        """Return which process writes: 0 for the first."""
        return self._incarnation

    def wake(self) -> None:
        """Have all threads that wait look whether to give up."""
        with self._changed:
            self._changed.notify_all()

    def _follow(self, event: ServerEvent) -> None:
        if event.event == "restarting":
            # The last event before the process starts its program again.
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

        Args:
            ask: Has the process write the mark `n`; raises `RuntimeError` where it has ended.
            timeout: Seconds.

        Raises:
            TimeoutError: The mark did not come.
        """
        with self._changed:
            self._asked += 1
            mark = self._asked
        until = time.monotonic() + timeout

        def is_over() -> bool:
            return self._synced >= mark or not self._open

        while (left := until - time.monotonic()) > 0:
            with contextlib.suppress(RuntimeError):  # what it wrote last is still to be read
                ask(n=mark)
            with self._changed:
                # A process that starts again loses what it was asked before.
                if self._changed.wait_for(is_over, min(left, _ASKED_AGAIN)):
                    return
        raise TimeoutError(f"{self._whose} did not answer within {timeout:g} s")

    def running(self) -> set[str]:
        """Return the ids of goals accepted and not ended; none once the process is gone."""
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
        """Block until `count` such events were seen; return those seen.

        Raises:
            EventNotSeenError: After `timeout` seconds, or at once when the process has ended.
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
