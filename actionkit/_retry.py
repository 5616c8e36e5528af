"""Whether, when and how a call that failed is tried again: pure decisions (contract C4)."""

from __future__ import annotations

import random
from dataclasses import dataclass
from enum import Enum, auto

import tenacity

from actionkit._budget import RetryBudget
from actionkit._effects import Ending, Known, Reached
from actionkit._settings import RetryPolicy


class Resend(Enum):
    """How to try again."""

    NO = auto()
    SAME_ID = auto()
    """The same goal again to the same server, which takes an id only once (R5)."""
    NEW_ID = auto()
    NEW_ID_ONCE_STOPPED = auto()
    """A new goal, when a server that is in sight has said that it does not know the old one."""


def how_to_resend(reached: Reached, known: Known, resend: str) -> Resend:
    """Decide about a goal that may have reached the server (contract C4.2).

    Args:
        reached: How far it got.
        known: What is known of it now.
        resend: `RetryPolicy.resend`.
    """
    if reached in (Reached.NEVER_SENT, Reached.REJECTED):
        return Resend.NEW_ID
    if resend == "always":
        return Resend.NEW_ID
    if resend == "never_accepted":
        return Resend.NO  # an unanswered goal may have been accepted, an accepted one was
    if known is Known.STOPPED:
        return Resend.NEW_ID
    if known is Known.SERVER_GONE:
        return Resend.NEW_ID_ONCE_STOPPED
    if known is Known.UNKNOWN_TO_SERVER and reached is Reached.UNANSWERED:
        return Resend.SAME_ID
    return Resend.NO


@dataclass(frozen=True)
class Pause:
    """Try again after so many seconds."""

    seconds: float


@dataclass(frozen=True)
class GiveUp:
    """Do not try again, and why, in words for the error's text."""

    reason: str


class Schedule:
    """The pauses of one call, by the strategies of tenacity."""

    def __init__(self, policy: RetryPolicy, began: float) -> None:
        """Begin with no attempt made.

        Args:
            policy: The user's wishes.
            began: Monotonic time of the call.
        """
        self._policy = policy
        self._stop = policy.stop or tenacity.stop_after_attempt(policy.attempts)
        self._wait = policy.wait or tenacity.wait_exponential(
            multiplier=policy.initial, exp_base=policy.factor, max=policy.max_pause
        )
        self._state = tenacity.RetryCallState(tenacity.Retrying(), None, (), {})
        self._state.start_time = began
        self._began = began

    def next(
        self, error: BaseException, attempts: int, now: float, deadline: float | None
    ) -> Pause | GiveUp:
        """Return the `Pause` before the next attempt, or `GiveUp`.

        Args:
            error: How the last attempt failed; tenacity's strategies may look at it.
            attempts: Attempts made so far.
            now: Monotonic seconds.
            deadline: When the call's time is up, or `None`.
        """
        state = self._state
        state.attempt_number = attempts
        state.set_exception((type(error), error, error.__traceback__))
        state.outcome_timestamp = now
        if self._stop(state):
            if self._policy.stop is not None:
                return GiveUp(
                    f"the retry policy's stop strategy ended it after {attempts} attempts"
                )
            if attempts == 1:
                return GiveUp("the retry policy allows one attempt")
            return GiveUp(f"all {attempts} attempts of the retry policy are used up")
        # With a first pause of 0 all are; tenacity's power of the factor overflows in the end.
        idle = self._policy.wait is None and self._policy.initial == 0
        seconds = 0.0 if idle else float(self._wait(state))
        if self._policy.wait is None:
            seconds *= 1 + self._policy.jitter * random.uniform(-1, 1)
            seconds = min(seconds, self._policy.max_pause)
        if deadline is not None and now + seconds >= deadline:
            return GiveUp(f"a pause of {seconds:.2g} s would have crossed the deadline")
        state.idle_for += seconds
        return Pause(seconds)


class JudgedFailure(Exception):
    """Stands, towards tenacity's strategies, for a success that was judged a failure."""


@dataclass(frozen=True)
class Retry:
    """Try again after so many seconds, with the same goal id or a new one."""

    seconds: float
    same_id: bool


class Retries:
    """All that decides whether one call tries again: policy, budget, and what its goal does."""

    def __init__(self, policy: RetryPolicy, budget: RetryBudget, began: float) -> None:
        self._policy = policy
        self._budget = budget
        self._began = began
        self._schedule: Schedule | None = None  # most calls need none

    def next(
        self,
        ending: Ending,
        error: BaseException,
        attempts: int,
        now: float,
        deadline: float | None,
    ) -> Retry | GiveUp:
        """Decide after a transient failure.

        Args:
            ending: How the last attempt ended.
            error: The same as an exception.
            attempts: Attempts made so far.
            now: Monotonic seconds.
            deadline: When the call's time is up, or `None`.
        """
        if self._schedule is None:
            self._schedule = Schedule(self._policy, self._began)
        plan = self._schedule.next(error, attempts, now, deadline)
        if isinstance(plan, GiveUp):
            return plan
        resend = self._policy.resend
        how = how_to_resend(ending.reached, ending.known, resend)
        if how is Resend.NO:
            return GiveUp(f"the goal may still run, or have run (resend={resend!r})")
        if not self._budget.allows_retry:
            return GiveUp(f"the retry budget forbids it ({self._budget!r})")
        return Retry(plan.seconds, how is Resend.SAME_ID)
