"""Finds out whether one call tries again, and asks the user's strategies off the communication
thread. `retry` makes the decisions.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from actionkit._calls.retries.budget import RetryBudget
from actionkit._calls.retries.retry import GiveUp, Retry, Schedule, plan
from actionkit._goal.effects import Ending, Fault
from actionkit._model.settings import RetryPolicy
from actionkit._threads.function_runner import FunctionRunner, NoAnswer, Scheduler
from actionkit._threads.pool import Pool

OnPlan = Callable[[Retry | GiveUp | Fault], None]


class RetryRunner:
    """Decides about the retries of one call. On the communication thread only."""

    def __init__(
        self, clock: Scheduler, pool: Pool, policy: RetryPolicy, budget: RetryBudget, began: float
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
                too_late = deadline is not None and now() + pause >= deadline
                on_plan(plan(pause, ending, self._policy.resend, self._budget, too_late=too_late))

        if self._policy.stop is None and self._policy.wait is None:
            answer(schedule.next_pause(error, attempts, now()))
            return
        next_pause = partial(schedule.next_pause, error, attempts, now())
        self._runner.run(next_pause, now(), deadline, answer)

    def drop(self) -> None:
        """Stop deciding, and call nobody."""
        self._runner.drop()
