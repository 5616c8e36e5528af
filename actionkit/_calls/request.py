"""What a user asks for with one call."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from actionkit._calls.budget import RetryBudget
from actionkit._calls.classify import Classify
from actionkit._calls.feedback import Callbacks
from actionkit._model.settings import RetryPolicy, Timeouts
from actionkit._threads.pool import Pool


@dataclass(frozen=True)
class Request:
    """The checked arguments of one call, with what its client was made with.

    Attributes:
        goal: The validated goal message, shared with nobody; `None` where it was invalid.
        invalid: What is wrong with the goal, where something is.
        timeout: Seconds for the whole call, or `None`.
        timeouts: The caps on the phases.
        retry: When to try again.
        budget: The brake on retries.
        classify: What counts as success, or `None` for the default.
        callbacks: What hands over the feedback, or `None`.
        pool: Where done callbacks run.
        function_pool: Where `classify` and the strategies of `retry` run.
    """

    goal: Any
    invalid: Exception | None
    timeout: float | None
    timeouts: Timeouts
    retry: RetryPolicy
    budget: RetryBudget
    classify: Classify | None
    callbacks: Callbacks | None
    pool: Pool
    function_pool: Pool
