"""Tells whether a server was restarted, or whether there are two (R1, R14).

After a restart the middleware shows two servers for up to 20 s: the new one, and the dead one until
its lease runs out. Two live servers look the same. But their answers differ: every live server
answers a probe, so two live servers give two answers, and a live and a dead one give one answer.

A server that is alive but busy does not answer either (C5.5). So the monitor also checks that the
new server is on a node of the same name. Even that is a guess: a server may have been started twice
while it is busy. So it ends the wait for a goal, but lets no other one be sent (C4.2).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from actionkit._threads.clock import Timers

SEEMS_RESTARTED = (
    "it was restarted, or started twice: a server on a node of the same name answers, and it does"
    " not"
)
"""Why a goal is lost, as users read it."""
_PROBES = 3
"""A second server that answers one of these is noticed; the other answers may get lost."""
_PERIOD = 0.2
"""Seconds between two probes; a server that is busy for less time answers each."""
_VERDICT_AFTER = 0.7
"""Seconds from the first probe to the verdict, with 0.3 s for the last answers."""


class RestartDetector:
    """Counts how many servers answer. On the communication thread only."""

    def __init__(
        self, timers: Timers, probe: Callable[[], int], on_one_answers: Callable[[], None]
    ) -> None:
        """Make a detector that is not running.

        `probe` sends a question that every live server answers, and returns its sequence number.
        `on_one_answers` is called when at least one probe was answered, and none by two servers.
        """
        self.running = False
        """Whether answers are being counted."""
        self._timers = timers
        self._probe = probe
        self._on_one_answers = on_one_answers
        self._answers: Counter[int] = Counter()

    def start(self) -> None:
        """Send probes and count the answers, unless this is happening already."""
        if self.running:
            return
        self.running = True
        self._answers.clear()
        now = self._timers.now()
        for number in range(_PROBES):
            self._timers.call_at(now + number * _PERIOD, self._send)
        self._timers.call_at(now + _VERDICT_AFTER, self._end)

    def count_answer(self, seq: int) -> None:
        """Count an answer, if it is to one of the probes."""
        if seq in self._answers:
            self._answers[seq] += 1

    def _send(self) -> None:
        self._answers[self._probe()] = 0

    def _end(self) -> None:
        self.running = False
        if max(self._answers.values(), default=0) == 1:
            self._on_one_answers()
