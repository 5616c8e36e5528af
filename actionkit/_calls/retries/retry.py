"""Decides whether, when and how to try again after a failed call: pure decisions (C4)."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any

import tenacity

from actionkit._calls.retries.budget import RetryBudget
from actionkit._goal.effects import End, Ending, Fault, LastNews
from actionkit._model.settings import MOST, RetryPolicy
from actionkit._threads.function_runner import described, short_name_of


def may_try_again(rejected: bool, news: LastNews, resend: str) -> bool:
    """Whether another goal may follow one that was sent (C4.2).

    Even then, it waits while an earlier goal of the call may run (`CallMachine.may_send`).
    `rejected` means that every server with the goal has rejected it; `resend` is that of
    `RetryPolicy`.
    """
    if rejected or resend == "always":
        return True
    if resend == "never_accepted":
        return False  # an unanswered goal may have been accepted
    return news is LastNews.STOPPED or (news is LastNews.SERVER_GONE and resend == "server_gone")


def after_no_server(
    ending: Ending,
    last: Ending | None,
    limit: float | None,
    late: bool,
    ready: bool,
    in_flight: bool,
) -> Ending:
    """Return how a call continues after an attempt that found no ready server (C2.7).

    A call that never had a server ends, and does not try again: waiting longer is not another
    attempt. A call that had a server ends at its deadline. Before that, its policy decides by the
    end of the attempt before this one: that server may need longer than one wait to come back.

    | a server is ready | the call had one before | late | not late |
    |---|---|---|---|
    | no | no | it ends: no server | it ends: no server |
    | yes | no | it ends at its deadline | it ends: no server |
    | no | yes | it ends at its deadline | as the attempt before: `server_gone` may send again |
    | yes | yes | it ends at its deadline | if the earlier goal may run, only `always` sends again |

    `last` is how that attempt ended, if there was one; `limit` is `Timeouts.server`. `late` means
    that the call's deadline has passed, `ready` that a server is ready now, and `in_flight`
    that an earlier goal of the call may be running.
    """
    if late and (ready or last is not None):
        return replace(ending, end=End.DEADLINE, phase="server")
    if last is None:
        return ending
    news = last.news if in_flight else LastNews.STOPPED
    if not ready:
        why = f"no server was ready within {limit:g} s"
    elif in_flight:
        news = LastNews.NOTHING
        why = "the server of an earlier goal is still there, so it may be alive"
    else:
        why = "a server is there, but the result of an earlier goal has not come"
    return replace(last, news=news, not_retried=why)


@dataclass(frozen=True)
class Retry:
    """Try again after a pause."""

    seconds: float


@dataclass(frozen=True)
class GiveUp:
    """Do not try again; `reason` is a clause for the error's text."""

    reason: str


def plan(
    seconds: float, ending: Ending, resend: str, budget: RetryBudget, *, too_late: bool
) -> Retry | GiveUp:
    """Decide after a failure that may pass, with a pause of `seconds` by the schedule.

    A rule that forbids a retry belongs here, or into `CallMachine.judged` if it is to hold before
    the user's strategies are asked. `too_late` means that the pause would cross the deadline.
    """
    if too_late:
        return GiveUp(f"a pause of {seconds:.2g} s would have crossed the deadline")
    if not may_try_again(ending.rejected, ending.news, resend):
        gone = ending.news is LastNews.SERVER_GONE and resend == "confirmed_stopped"
        hint = (
            "; resend='server_gone' tries again when its server has left the graph" if gone else ""
        )
        return GiveUp(f"the goal may still run, or have run (resend={resend!r}{hint})")
    if not budget.allows_retry:
        return GiveUp(f"the retry budget forbids it ({budget!r})")
    return Retry(seconds)


class Schedule:
    """The pauses of one call, by tenacity's strategies."""

    def __init__(self, policy: RetryPolicy, began: float) -> None:
        """Begin without attempts, for a call that began at that monotonic time."""
        self._policy = policy
        self._stop: Callable[[Any], object] = tenacity.stop_after_attempt(policy.attempts)
        self._wait: Callable[[Any], Any] = tenacity.wait_exponential(
            multiplier=policy.initial, exp_base=policy.factor, max=policy.max_pause
        )
        # Not `or`: the truth value of a strategy is the user's code, and this is the wrong thread.
        if policy.stop is not None:
            self._stop = policy.stop
        if policy.wait is not None:
            self._wait = policy.wait
        self._state = tenacity.RetryCallState(tenacity.Retrying(), None, (), {})
        self._state.start_time = began
        self._called = "wait" if policy.stop is None else "stop"

    @property
    def strategy(self) -> str:
        """The last strategy that was called, as error texts name it."""
        return f"`RetryPolicy.{self._called}={short_name_of(getattr(self._policy, self._called))}`"

    def next_pause(self, error: BaseException, attempts: int, now: float) -> float | GiveUp | Fault:
        """Return the seconds of the next pause, by the strategies. Never raises.

        It runs the user's code if the policy has strategies of theirs; these may look at `error`,
        the last failure. `attempts` is how many attempts were made.
        """
        policy, state = self._policy, self._state
        state.attempt_number = attempts
        state.set_exception((type(error), error, error.__traceback__))
        state.outcome_timestamp = now
        try:
            self._called = "stop"
            stop = self._stop(state)
            if not isinstance(stop, bool):
                wrong = f"{described(stop)}, which is neither True nor False"
                return Fault(f"{self.strategy} returned {wrong}")
            if stop:
                return GiveUp(self._used_up(attempts))
            self._called = "wait"
            if policy.wait is None and policy.initial == 0:
                return 0.0  # all pauses are 0; tenacity's power of the factor overflows in the end
            pause = self._wait(state)
            if not _is_pause(pause):
                wrong = f"{described(pause)}, which is no number of seconds from 0 to {MOST:g}"
                return Fault(f"{self.strategy} returned {wrong}")
            seconds = float(pause)
        except BaseException as problem:  # noqa: BLE001  any error: the call must end (C2.1)
            return Fault(f"{self.strategy} raised {described(problem)}", problem)
        if policy.wait is None:
            seconds *= 1 + policy.jitter * random.uniform(-1, 1)
            seconds = min(seconds, policy.max_pause)
        state.idle_for += seconds
        return seconds

    def _used_up(self, attempts: int) -> str:
        if self._policy.stop is not None:
            return f"the retry policy's stop strategy ended it after {attempts} attempts"
        if attempts == 1:
            return "the retry policy allows one attempt"
        return f"all {attempts} attempts of the retry policy are used up"


def _is_pause(value: Any) -> bool:
    """Whether it is a number of seconds that a call can wait."""
    if isinstance(value, bool) or not isinstance(value, Real):
        return False
    number: Any = value
    return bool(0 <= number <= MOST)  # NaN is not


class RejectedByClassifier(Exception):
    """The error for tenacity's strategies if `classify=` counts a success as a failure."""
