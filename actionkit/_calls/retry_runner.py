"""Finds out whether one call tries again: by its policy, its budget, and its goal's fate.

`retry` makes the decisions. The user's strategies run off the communication thread.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from actionkit._calls.budget import RetryBudget
from actionkit._calls.retry import GiveUp, Retry, Schedule, may_try_again
from actionkit._goal.effects import Ending, Fault, LastNews
from actionkit._model.settings import RetryPolicy
from actionkit._threads.function_runner import Clock, FunctionRunner, NoAnswer
from actionkit._threads.pool import Pool

OnPlan = Callable[[Retry | GiveUp | Fault], None]


class RetryRunner:
    """Decides about the retries of one call. On the communication thread only."""

    def __init__(
        self, clock: Clock, pool: Pool, policy: RetryPolicy, budget: RetryBudget, began: float
    ) -> None:
        """Begin without attempts, for a call that began at the monotonic time `began`."""
        self._policy = policy
        self._budget = budget
        self._began = began
        self._runner = FunctionRunner(clock, pool)
        self._schedule: Schedule | None = None  # most calls need none

    def begin(
        self,
        ending: Ending,
        error: BaseException,
        attempts: int,
        now: Callable[[], float],
        deadline: float | None,
        on_plan: OnPlan,
    ) -> None:
        """Decide after a transient failure; `error` is the ending as an exception.

        `attempts` is how many attempts were made. `now` returns monotonic seconds; `deadline` is
        the end of the call's time, or `None`. `on_plan` is called with the decision, or with a
        strategy's failure to decide: at once, or later if there are strategies of the user's.
        """
        if self._schedule is None:
            self._schedule = Schedule(self._policy, self._began)
        schedule = self._schedule

        def answer(pause: float | GiveUp | Fault | NoAnswer) -> None:
            if isinstance(pause, NoAnswer):
                on_plan(Fault(f"{schedule.strategy} {pause.why}"))
            elif isinstance(pause, (GiveUp, Fault)):
                on_plan(pause)
            else:
                on_plan(self._plan(pause, ending, now(), deadline))

        if self._policy.stop is None and self._policy.wait is None:
            answer(schedule.next_pause(error, attempts, now()))
            return
        next_pause = partial(schedule.next_pause, error, attempts, now())
        self._runner.run(next_pause, now(), deadline, answer)

    def drop(self) -> None:
        """Stop deciding, and call nobody."""
        self._runner.drop()

    def _plan(
        self, seconds: float, ending: Ending, now: float, deadline: float | None
    ) -> Retry | GiveUp:
        if deadline is not None and now + seconds >= deadline:
            return GiveUp(f"a pause of {seconds:.2g} s would have crossed the deadline")
        resend = self._policy.resend
        if not may_try_again(ending.rejected, ending.news, resend):
            gone = ending.news is LastNews.SERVER_GONE and resend == "confirmed_stopped"
            hint = "; resend='server_gone' tries again after that" if gone else ""
            return GiveUp(f"the goal may still run, or have run (resend={resend!r}{hint})")
        if not self._budget.allows_retry:
            return GiveUp(f"the retry budget forbids it ({self._budget!r})")
        return Retry(seconds)
