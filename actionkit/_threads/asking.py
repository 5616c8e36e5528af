"""Asks functions of the user's off the communication thread, for no longer than there is time.

`classify=` and the strategies of a `RetryPolicy` say how a call goes on, so the call waits for
their answers. Each runs on a daemon thread that it has for itself while it runs, of its client's:
callbacks, observers and log handlers that block cannot keep a question from being asked, and
questions that are never answered hold up no other client's call (R8).
"""

from __future__ import annotations

import contextlib
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from types import BuiltinFunctionType, FunctionType, MethodType
from typing import Any, Protocol

from actionkit._threads.clock import TimerHandle
from actionkit._threads.diagnostics import log_own_error
from actionkit._threads.pool import in_callback

LONGEST_ANSWER = 10.0
"""Seconds that a function is given where the call's deadline is later, or there is none."""
_MOST_THREADS = 64
"""With so many functions of a client running, the next one waits for its turn."""
_IDLE_SECONDS = 1.0
"""Seconds after which a thread without a question ends."""
_LONGEST_TEXT = 200

Job = Callable[[], None]


@dataclass(frozen=True)
class Unanswered:
    """There is no answer.

    Attributes:
        why: A clause whose subject is the function, such as "did not answer within 10 s".
    """

    why: str


class Clock(Protocol):
    """The communication thread, as far as it is needed here."""

    def call_soon(self, callback: Callable[[], None]) -> None: ...
    def call_at(self, at: float, callback: Callable[[], None]) -> TimerHandle: ...
    def cancel_timer(self, handle: TimerHandle) -> None: ...


class Threads:
    """Runs each job on a thread that it has for itself; idle threads are used again."""

    def __init__(self, most: int = _MOST_THREADS, idle: float = _IDLE_SECONDS) -> None:
        self._most = most
        self._idle_seconds = idle
        self._changed = threading.Condition()
        self._jobs: deque[Job] = deque()
        self._threads = 0
        self._idle = 0

    def run(self, job: Job) -> str:
        """Run `job` soon. Jobs must not raise.

        Returns:
            `""`, or why it cannot be run.
        """
        with self._changed:
            self._jobs.append(job)
            if len(self._jobs) <= self._idle:
                self._changed.notify()
                return ""
            if self._threads >= self._most:
                return ""
            self._threads += 1
        try:
            threading.Thread(target=self._work, name="actionkit-questions", daemon=True).start()
        except RuntimeError as error:
            # There are too many threads; from Python 3.12 on none starts at the interpreter's exit.
            with self._changed:
                self._threads -= 1
            return str(error) if self.withdraw(job) else ""
        return ""

    def withdraw(self, job: Job) -> bool:
        """Do not run `job`; return whether that was in time."""
        with self._changed:
            if job not in self._jobs:
                return False
            self._jobs.remove(job)
            return True

    def _work(self) -> None:
        in_callback.set(True)
        while (job := self._next()) is not None:
            try:
                job()
            except BaseException:  # noqa: BLE001  the thread is needed for other questions
                # A log handler of the user's may raise, too.
                with contextlib.suppress(Exception):
                    log_own_error()
            del job  # or an idle thread would keep the last goal alive

    def _next(self) -> Job | None:
        with self._changed:
            self._idle += 1
            self._changed.wait_for(lambda: self._jobs, self._idle_seconds)
            self._idle -= 1
            if self._jobs:
                return self._jobs.popleft()
            self._threads -= 1
            return None


class Asking:
    """The questions of one call, one at a time. All of it on the communication thread."""

    def __init__(self, clock: Clock, threads: Threads) -> None:
        """Ask nothing so far.

        Args:
            clock: The communication thread.
            threads: Where the functions run.
        """
        self._clock = clock
        self._threads = threads
        self._job: Job | None = None
        self._on_answer: Callable[[Any], None] | None = None
        self._limit: TimerHandle | None = None

    @property
    def under_way(self) -> bool:
        """Whether an answer is waited for."""
        return self._job is not None

    def ask(
        self,
        function: Callable[[], Any],
        now: float,
        deadline: float | None,
        on_answer: Callable[[Any], None],
    ) -> None:
        """Call `function` on a thread of its own.

        Args:
            function: It must not raise.
            now: Monotonic seconds.
            deadline: When the call's time is up, or `None`.
            on_answer: Is told what `function` returned, or an `Unanswered`, later and on the
                communication thread.
        """
        self.drop()

        def job() -> None:
            answer = function()
            self._clock.call_soon(lambda: self._answer(job, answer))

        self._job, self._on_answer = job, on_answer
        latest = now + LONGEST_ANSWER
        if deadline is not None and deadline <= latest:
            self.end_by(deadline, "did not answer before the call's deadline")
        else:
            self.end_by(latest, f"did not answer within {LONGEST_ANSWER:g} s")
        refused = self._threads.run(job)
        if refused:
            missing = Unanswered(
                f"could not be asked, because no thread can be started ({refused})"
            )
            self._clock.call_soon(lambda: self._answer(job, missing))

    def end_by(self, at: float, why: str) -> None:
        """Wait for the answer no longer than until `at`, or an earlier time that was said before.

        Args:
            at: Monotonic seconds.
            why: What an `Unanswered` is to say.
        """
        job = self._job
        if job is None or (self._limit is not None and self._limit.at <= at):
            return
        self._disarm()
        self._limit = self._clock.call_at(at, lambda: self._answer(job, Unanswered(why)))

    def end(self, why: str) -> None:
        """Wait no longer; `on_answer` is told at once, with an `Unanswered` that says `why`."""
        if self._job is not None:
            self._answer(self._job, Unanswered(why))

    def drop(self) -> None:
        """Wait for no answer any more, and tell nobody."""
        job, self._job, self._on_answer = self._job, None, None
        self._disarm()
        if job is not None:
            self._threads.withdraw(job)

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
    except Exception:  # noqa: BLE001  whatever the value's own class raises
        text = f"a value of type {name}"
    text = " ".join(text.split())
    return text if len(text) <= _LONGEST_TEXT else f"{text[:_LONGEST_TEXT]}..."
