"""Asks the user's `classify=` how the end of an attempt counts, within a limited time."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import partial
from typing import Any

from actionkit._calls.retries.classify import Classify, call_classifier, default_verdict, label_of
from actionkit._goal.effects import End, Ending, Fault
from actionkit._model.values import Outcome, Verdict
from actionkit._threads.diagnostics import log_later
from actionkit._threads.function_runner import FunctionRunner, NoAnswer, Scheduler
from actionkit._threads.pool import Pool

_CLASSIFIED = {End.SUCCEEDED, End.ABORTED, End.REJECTED, End.CANCELED_BY_OTHER}
"""The endings that `classify=` decides about: those that a server reported (C3.3)."""

OnVerdict = Callable[[Ending, BaseException | None, Verdict | Fault], None]


class ClassifyRunner:
    """Classifies the endings of one call, one at a time, on the communication thread."""

    def __init__(self, clock: Scheduler, pool: Pool, classify: Classify | None) -> None:
        self._classify = classify
        self._runner = FunctionRunner(clock, pool)

    @property
    def under_way(self) -> bool:
        """Whether the user's function has not answered yet."""
        return self._runner.under_way

    def begin(
        self,
        ending: Ending,
        outcome: Outcome[Any],
        now: float,
        deadline: float | None,
        on_verdict: OnVerdict,
    ) -> None:
        """Classify an ending; `outcome` is the same as the user sees it.

        `deadline` is the monotonic time of the end of the call, or `None`. `on_verdict` is called
        now or later, with the ending, its error, and the verdict, or with the user's function's
        failure to give one.
        """
        classify = self._classify
        if classify is None or ending.end not in _CLASSIFIED:
            on_verdict(ending, outcome.error, default_verdict(outcome))
            return
        label = label_of(classify)

        def answer(verdict: Verdict | Fault | NoAnswer) -> None:
            if isinstance(verdict, NoAnswer):
                verdict = Fault(f"{label} {verdict.why}", asked=verdict.asked)
            if isinstance(verdict, Fault) and outcome.error is not None and not verdict.impossible:
                # The caller gets the goal's own error, which has no place for this traceback. Do
                # not log on this thread: the log's handlers are the user's.
                cause = verdict.cause
                log_later(logging.ERROR, "%s", verdict.problem, exc_info=cause or False)
            on_verdict(ending, outcome.error, verdict)

        self._runner.run(partial(call_classifier, classify, outcome), now, deadline, answer)

    def cut_short(self, at: float, why: str) -> None:
        """Stop waiting for the user's function at the monotonic time `at`."""
        self._runner.end_by(at, f"was cut short: {why}")

    def end(self, why: str) -> None:
        """Stop waiting for the user's function now."""
        self._runner.end(f"was cut short: {why}")
