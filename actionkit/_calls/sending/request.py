"""Holds what a user asks for with one call."""

from __future__ import annotations

import uuid
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from actionkit._calls.futures.feedback import Callbacks
from actionkit._calls.futures.future import GoalFuture
from actionkit._calls.retries.budget import RetryBudget
from actionkit._calls.retries.classify import Classify
from actionkit._model.settings import RetryPolicy, Timeouts
from actionkit._threads.pool import Pool

_MOST_ATTEMPTS = 2**31
"""Where a strategy of the user's limits them."""


@dataclass(frozen=True)
class Request:
    """The checked arguments of one call, and the settings of its client."""

    goal: Any  # the validated message, used by nobody else; `None` if it was invalid
    invalid: Exception | None  # what is wrong with the goal, if anything
    timeout: float | None  # seconds for the whole call
    timeouts: Timeouts
    retry: RetryPolicy
    budget: RetryBudget
    classify: Classify | None
    callbacks: Callbacks | None  # pass on the feedback
    pool: Pool  # for done callbacks
    function_pool: Pool  # for `classify` and the strategies of `retry`
    replaces: GoalFuture[Any, Any] | None = None  # the call with the goal to replace
    preempt: bool = False  # whether the server stops that goal by itself
    attach: uuid.UUID | None = None  # the goal of somebody else, to be followed
    key: str | None = None  # in the client's ledger
    left_alone: bool = False  # only an explicit cancel cancels it
    before_resend: Callable[[], object] | None = None
    """Called on the communication thread before another goal is sent. It may cancel the call, and
    then nothing is sent; it never blocks."""

    @property
    def most_attempts(self) -> int:
        """How many goals it sends at most."""
        return self.retry.attempts if self.retry.stop is None else _MOST_ATTEMPTS
