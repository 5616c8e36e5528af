"""Asking the user's `classify=` how an attempt's end counts, for no longer than there is time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from actionkit._classify import Classify, asked, default_verdict
from actionkit._clock import TimerHandle
from actionkit._delivery import pool
from actionkit._effects import End, Ending
from actionkit._values import Outcome, Verdict

_JUDGED = {End.SUCCEEDED, End.ABORTED, End.REJECTED}
"""What a user may judge: what a server has said of a goal (C3.3)."""


OnVerdict = Callable[[Ending, BaseException | None, Verdict], None]


class Clock(Protocol):
    """The communication thread, as far as it is needed here."""

    def call_soon(self, callback: Callable[[], None]) -> None: ...
    def call_at(self, at: float, callback: Callable[[], None]) -> TimerHandle: ...
    def cancel_timer(self, handle: TimerHandle) -> None: ...


class Judging:
    """Judges the endings of one call, one at a time. All of it on the communication thread."""

    def __init__(self, clock: Clock, classify: Classify | None) -> None:
        """Make it.

        Args:
            clock: The communication thread.
            classify: The user's function, which runs on the pool (R8); `None` for the default.
        """
        self._clock = clock
        self._classify = classify
        self._asked: tuple[Ending, Outcome[Any], OnVerdict] | None = None
        self._limit: TimerHandle | None = None

    @property
    def under_way(self) -> bool:
        """Whether the user's function is being asked."""
        return self._asked is not None

    def begin(
        self,
        ending: Ending,
        outcome: Outcome[Any],
        deadline: float | None,
        on_verdict: OnVerdict,
    ) -> None:
        """Judge an ending.

        Args:
            ending: How the attempt ended.
            outcome: The same, as the user sees it.
            deadline: Monotonic time when the default counts if there is no answer, or `None`.
            on_verdict: Is told the ending, its error and the verdict, at once or later.
        """
        classify = self._classify
        if classify is None or ending.end not in _JUDGED:
            on_verdict(ending, outcome.error, default_verdict(outcome))
            return
        self._asked = (ending, outcome, on_verdict)
        if deadline is not None:
            self.end_by(deadline)

        def ask() -> None:
            verdict = asked(classify, outcome)
            self._clock.call_soon(lambda: self._answer(ending, verdict))

        pool.submit(ask)

    def end_by(self, at: float) -> None:
        """Let the default count where there is no answer at the monotonic time `at`."""
        self._disarm()
        self._limit = self._clock.call_at(at, self.end)

    def end(self) -> None:
        """Let the default count now, where the user's function is being asked."""
        if self._asked is not None:
            self._answer(self._asked[0], None)

    def _answer(self, ending: Ending, verdict: Verdict | None) -> None:
        if self._asked is None or self._asked[0] is not ending:
            return  # it comes too late
        (_, outcome, on_verdict), self._asked = self._asked, None
        self._disarm()
        on_verdict(ending, outcome.error, verdict or default_verdict(outcome))

    def _disarm(self) -> None:
        if self._limit is not None:
            self._clock.cancel_timer(self._limit)
            self._limit = None
