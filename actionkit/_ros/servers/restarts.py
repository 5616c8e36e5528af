"""Who of several servers on one name is still there (R1, R14).

After a restart the middleware shows two servers for up to 20 s: the new one, and the dead one
until its lease runs out. Two servers that both live look just the same. They differ in what
they answer: a question that every server answers gets two answers from two, and one from one.

A server that is alive but busy answers nothing either (C5.5), so silence alone condemns nobody:
it must also have been replaced by one on a node of the same name, which has answered.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from actionkit._threads.clock import Timers

_QUESTIONS = 3
_PERIOD = 0.2
_VERDICT_AFTER = 0.7


class RestartDetector:
    """Counts the answers to harmless questions. On the communication thread only."""

    def __init__(
        self, timers: Timers, probe: Callable[[], int], on_one: Callable[[], None]
    ) -> None:
        """Ask nothing so far.

        Args:
            timers: The clock and timers of the thread.
            probe: Asks a question that every server answers; returns its sequence number.
            on_one: Called when no question was answered by more than one server.
        """
        self._timers = timers
        self._probe = probe
        self._on_one = on_one
        self._answers: Counter[int] = Counter()
        self._running = False
        self._closed = False

    @property
    def running(self) -> bool:
        """Whether answers are being counted."""
        return self._running

    def begin(self) -> None:
        """Ask, unless that is under way."""
        if self._running:
            return
        self._running = True
        self._answers.clear()
        now = self._timers.now()
        for number in range(_QUESTIONS):
            self._timers.call_at(now + number * _PERIOD, self._ask)
        self._timers.call_at(now + _VERDICT_AFTER, self._end)

    def answered(self, question: int) -> None:
        """Count an answer."""
        if question in self._answers:
            self._answers[question] += 1

    def close(self) -> None:
        """Ask and tell nothing any more."""
        self._closed = True

    def _ask(self) -> None:
        if not self._closed:
            self._answers[self._probe()] = 0

    def _end(self) -> None:
        self._running = False
        if max(self._answers.values(), default=0) == 1 and not self._closed:
            self._on_one()
