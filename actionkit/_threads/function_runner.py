"""Runs functions of the user's off the communication thread, within a limited time.

`classify=` and the strategies of a `RetryPolicy` decide how a call continues, so the call waits for
their answers. Each runs on a daemon thread that no other function uses at that time, in a pool that
its client has only for these functions. So a function runs even if callbacks, observers or log
handlers block, and no matter what the functions of other clients do (R8).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import BuiltinFunctionType, FunctionType, MethodType
from typing import Any, Protocol

from actionkit._threads.clock import TimerHandle
from actionkit._threads.in_hand import FUNCTIONS, Label
from actionkit._threads.pool import Pool

LONGEST_ANSWER = 10.0
"""Seconds that a function has if the call's deadline is later, or if there is none.

Classifying a result takes milliseconds; a function that needs longer is nearly always stuck."""
_LONGEST_TEXT = 200
"""Characters of a user's value in an error text: a few lines."""
_LABEL = Label("function", None, "its call")

Job = Callable[[], None]


def function_pool(owner: str) -> Pool:
    """Return the pool for the functions of a client.

    The error of a call reports a function that does not return, so no warning is needed.
    """
    return Pool(owner, name="actionkit-questions", kind=FUNCTIONS)


@dataclass(frozen=True)
class NoAnswer:
    """The function returned nothing in time.

    `why` is what the function did, such as "did not answer within 10 s".
    """

    why: str
    asked: bool = True  # whether it was called


class Scheduler(Protocol):
    """The part of the communication thread that is needed here."""

    def call_soon(self, callback: Callable[[], None]) -> None: ...
    def call_at(self, at: float, callback: Callable[[], None]) -> TimerHandle: ...
    def cancel_timer(self, handle: TimerHandle) -> None: ...


class FunctionRunner:
    """Runs the functions of one call, one at a time. On the communication thread only."""

    def __init__(self, clock: Scheduler, pool: Pool) -> None:
        self._clock = clock
        self._pool = pool
        self._job: Job | None = None
        self._on_answer: Callable[[Any], None] | None = None
        self._limit: TimerHandle | None = None

    @property
    def under_way(self) -> bool:
        """Whether a function has not answered yet."""
        return self._job is not None

    def run(
        self,
        function: Callable[[], Any],
        now: float,
        deadline: float | None,
        on_answer: Callable[[Any], None],
    ) -> None:
        """Call `function` on a thread of its own; drop an earlier function.

        `function` must not raise an error. `deadline` is the end of the call's time, or `None`.
        `on_answer` is called later, on the communication thread, with what `function` returned or
        with a `NoAnswer`.
        """
        self.drop()

        def job() -> None:
            if self._job is job:  # otherwise nobody wants its answer
                answer = function()
                self._clock.call_soon(lambda: self._answer(job, answer))

        self._job, self._on_answer = job, on_answer
        latest = now + LONGEST_ANSWER
        if deadline is not None and deadline <= latest:
            self.end_by(deadline, "did not answer before the call's deadline")
        else:
            self.end_by(latest, f"did not answer within {LONGEST_ANSWER:g} s")
        refused = self._pool.submit(job, _LABEL)
        if refused:
            why = f"could not be called, because no thread can be started ({refused})"
            missing = NoAnswer(why, asked=False)
            self._clock.call_soon(lambda: self._answer(job, missing))

    def end_by(self, at: float, why: str) -> None:
        """Wait for the answer until the monotonic time `at`, or an earlier time given before.

        `why` is the text of the `NoAnswer`.
        """
        job = self._job
        if job is None or (self._limit is not None and self._limit.at <= at):
            return
        self._disarm()
        self._limit = self._clock.call_at(at, lambda: self._answer(job, NoAnswer(why)))

    def end(self, why: str) -> None:
        """Stop waiting; `on_answer` is called now, with a `NoAnswer` with the text `why`."""
        if self._job is not None:
            self._answer(self._job, NoAnswer(why))

    def drop(self) -> None:
        """Stop waiting, and call nobody."""
        self._job = self._on_answer = None
        self._disarm()

    def _answer(self, job: Job, answer: object) -> None:
        on_answer = self._on_answer
        if self._job is not job or on_answer is None:
            return  # too late
        self.drop()
        on_answer(answer)

    def _disarm(self) -> None:
        if self._limit is not None:
            self._clock.cancel_timer(self._limit)
            self._limit = None


def short_name_of(function: object) -> str:
    """Return a function's name without running the user's code."""
    if isinstance(function, (FunctionType, MethodType, BuiltinFunctionType)):
        return function.__qualname__
    return type(function).__qualname__


def described(value: object) -> str:
    """Return a short text for a value or an exception.

    It runs the user's code, so do not call it on the communication thread.
    """
    name = type(value).__name__
    try:
        error = isinstance(value, BaseException)
        text = f"{name}: {value}".rstrip(": .") if error else repr(value)
    except Exception:  # noqa: BLE001  the value's own class may raise anything
        text = f"a value of type {name}"
    text = " ".join(text.split())
    return text if len(text) <= _LONGEST_TEXT else f"{text[:_LONGEST_TEXT]}..."
