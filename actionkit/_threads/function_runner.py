"""Runs functions of the user's off the communication thread, for no longer than there is time.

`classify=` and the strategies of a `RetryPolicy` say how a call goes on, so the call waits for
what they return. Each runs on a daemon thread that no other function uses meanwhile, in a pool
that its client has for these functions alone. So neither callbacks, observers and log handlers
that block nor the functions of other clients can keep one from running (R8).
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
"""Seconds that a function is given where the call's deadline is later, or there is none.

A function that judges a result takes milliseconds; one that needs longer is nearly always stuck."""
_LONGEST_TEXT = 200
"""Characters of a user's value in an error text: a few lines."""
_LABEL = Label("function", None, "its call")

Job = Callable[[], None]


def function_pool(owner: str) -> Pool:
    """Return the pool for the functions of a client.

    A function that does not return is reported by the error of its call, so no warning is needed.
    """
    return Pool(owner, name="actionkit-questions", kind=FUNCTIONS)


@dataclass(frozen=True)
class NoAnswer:
    """The function returned nothing in time.

    Attributes:
        why: What the function did, such as "did not answer within 10 s".
        asked: Whether it was called.
    """

    why: str
    asked: bool = True


class Clock(Protocol):
    """The communication thread, as far as it is needed here."""

    def call_soon(self, callback: Callable[[], None]) -> None: ...
    def call_at(self, at: float, callback: Callable[[], None]) -> TimerHandle: ...
    def cancel_timer(self, handle: TimerHandle) -> None: ...


class FunctionRunner:
    """Runs the functions of one call, one at a time. Used on the communication thread only."""

    def __init__(self, clock: Clock, pool: Pool) -> None:
        self._clock = clock
        self._pool = pool
        self._job: Job | None = None
        self._on_answer: Callable[[Any], None] | None = None
        self._limit: TimerHandle | None = None

    @property
    def under_way(self) -> bool:
        """Whether an answer is waited for."""
        return self._job is not None

    def run(
        self,
        function: Callable[[], Any],
        now: float,
        deadline: float | None,
        on_answer: Callable[[Any], None],
    ) -> None:
        """Call `function` on a thread of its own, and drop what ran before.

        Args:
            function: It must not raise.
            now: Monotonic seconds.
            deadline: When the call's time is up, or `None`.
            on_answer: Called with what `function` returned, or with a `NoAnswer`; later, and on
                the communication thread.
        """
        self.drop()

        def job() -> None:
            if self._job is job:  # nobody wants its answer otherwise
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
        """Wait for the answer no longer than until `at`, or an earlier time that was said before.

        Args:
            at: Monotonic seconds.
            why: What the `NoAnswer` says.
        """
        job = self._job
        if job is None or (self._limit is not None and self._limit.at <= at):
            return
        self._disarm()
        self._limit = self._clock.call_at(at, lambda: self._answer(job, NoAnswer(why)))

    def end(self, why: str) -> None:
        """Wait no longer; `on_answer` is called at once, with a `NoAnswer` that says `why`."""
        if self._job is not None:
            self._answer(self._job, NoAnswer(why))

    def drop(self) -> None:
        """Wait for no answer any more, and call nobody."""
        self._job = self._on_answer = None
        self._disarm()

    def _answer(self, job: Job, answer: object) -> None:
        on_answer = self._on_answer
        if self._job is not job or on_answer is None:
            return  # it comes too late
        self.drop()
        on_answer(answer)

    def _disarm(self) -> None:
        if self._limit is not None:
            self._clock.cancel_timer(self._limit)
            self._limit = None


def name_of(function: object) -> str:
    """Return a function's name, without running code of the user's."""
    if isinstance(function, (FunctionType, MethodType, BuiltinFunctionType)):
        return function.__qualname__
    return type(function).__qualname__


def described(value: object) -> str:
    """Return a short text for a value or an exception.

    It runs code of the user's, so not on the communication thread.
    """
    name = type(value).__name__
    try:
        error = isinstance(value, BaseException)
        text = f"{name}: {value}".rstrip(": .") if error else repr(value)
    except Exception:  # noqa: BLE001  the value's own class may raise anything
        text = f"a value of type {name}"
    text = " ".join(text.split())
    return text if len(text) <= _LONGEST_TEXT else f"{text[:_LONGEST_TEXT]}..."
