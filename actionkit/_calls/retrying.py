"""Finding out whether one call tries again: its policy, its budget, and what its goal does.

The decisions are those of `_retry`. Strategies of the user's are asked off the communication
thread.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from actionkit._calls.budget import RetryBudget
from actionkit._calls.retry import GiveUp, Resend, Retry, Schedule, how_to_resend
from actionkit._goal.effects import Ending, Fault
from actionkit._model.settings import RetryPolicy
from actionkit._threads.asking import Asking, Clock, Threads, Unanswered

OnPlan = Callable[[Retry | GiveUp | Fault], None]


class Retrying:
    """The retries of one call. All of it on the communication thread."""

    def __init__(
        self,
        clock: Clock,
        threads: Threads,
        policy: RetryPolicy,
        budget: RetryBudget,
        began: float,
    ) -> None:
        """Begin with no attempt made.

        Args:
            clock: The communication thread.
            threads: The client's, for questions.
            policy: When to try again.
            budget: The brake on retries.
            began: Monotonic time of the call.
        """
        self._policy = policy
        self._budget = budget
        self._began = began
        self._asking = Asking(clock, threads)
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
        """Decide after a transient failure.

        Args:
            ending: How the last attempt ended.
            error: The same as an exception.
            attempts: Attempts made so far.
            now: Returns the monotonic seconds.
            deadline: When the call's time is up, or `None`.
            on_plan: Is told what to do, or how a strategy of the user's failed to say so; at once,
                or later where strategies of the user's are asked.
        """
        if self._schedule is None:
            self._schedule = Schedule(self._policy, self._began)
        schedule = self._schedule

        def answer(said: float | GiveUp | Fault | Unanswered) -> None:
            if isinstance(said, Unanswered):
                on_plan(Fault(f"{schedule.asked} {said.why}"))
            elif isinstance(said, (GiveUp, Fault)):
                on_plan(said)
            else:
                on_plan(self._plan(schedule, said, ending, now(), deadline))

        if self._policy.stop is None and self._policy.wait is None:
            answer(schedule.ask(error, attempts, now()))
            return
        ask = partial(schedule.ask, error, attempts, now())
        self._asking.ask(ask, now(), deadline, answer)

    def drop(self) -> None:
        """Decide nothing any more, and tell nobody."""
        self._asking.drop()

    def _plan(
        self,
        schedule: Schedule,
        seconds: float,
        ending: Ending,
        now: float,
        deadline: float | None,
    ) -> Retry | GiveUp:
        plan = schedule.plan(seconds, now, deadline)
        if isinstance(plan, GiveUp):
            return plan
        resend = self._policy.resend
        how = how_to_resend(ending.reached, ending.known, resend)
        if how is Resend.NO:
            return GiveUp(f"the goal may still run, or have run (resend={resend!r})")
        if not self._budget.allows_retry:
            return GiveUp(f"the retry budget forbids it ({self._budget!r})")
        return Retry(plan.seconds, how is Resend.SAME_ID)
