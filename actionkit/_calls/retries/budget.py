"""Limits retries, with one limit for the calls of one client or of several (C4.5)."""

from __future__ import annotations

import math
import threading

from typing_extensions import final

from actionkit._model.field_errors import shown
from actionkit._model.settings import MOST, MOST_TEXT


@final
class RetryBudget:
    """Lets callers retry only while most calls succeed, as gRPC's retry throttle does.

    A transient failure takes one token. A success gives back `ratio` of a token. Retries are
    allowed while more than half of the tokens are left. So if a server fails for everybody, all
    callers soon stop retrying, and each call makes one attempt only.

    Any thread may use it. If several clients share one, they share its limit.
    """

    def __init__(self, capacity: float = 10.0, ratio: float = 0.1) -> None:
        """Start with all tokens.

        Args:
            capacity: The largest number of tokens, above 0.
            ratio: The share of a token that a success gives back, above 0.

        Raises:
            TypeError: A value is not a number.
            ValueError: A value is not above 0, not finite, or above 1e9.
        """
        for name, value in (("capacity", capacity), ("ratio", ratio)):
            if isinstance(value, bool) or not isinstance(value, (int, float)):
                raise TypeError(f"RetryBudget.{name}={shown(value)} must be a number")
            if not 0 < value < math.inf:
                raise ValueError(f"RetryBudget.{name}={shown(value)} must be above 0 and finite")
            if value > MOST:
                raise ValueError(f"RetryBudget.{name}={shown(value)} must be {MOST_TEXT} or less")
        self._capacity = float(capacity)
        self._ratio = float(ratio)
        self._tokens = self._capacity
        self._lock = threading.Lock()

    def __repr__(self) -> str:
        state = "allows" if self.allows_retry else "forbids"
        return f"<RetryBudget {self.tokens:g} of {self._capacity:g} tokens, {state} retries>"

    @property
    def capacity(self) -> float:
        """The largest number of tokens."""
        return self._capacity

    @property
    def tokens(self) -> float:
        """The number of tokens that are left."""
        return self._tokens

    @property
    def allows_retry(self) -> bool:
        """Whether a call may be tried again now."""
        return self.tokens > self._capacity / 2

    def on_success(self) -> None:
        """Give back a share of a token."""
        self._change(self._ratio)

    def on_transient_failure(self) -> None:
        """Take a token."""
        self._change(-1.0)

    def _change(self, by: float) -> None:
        with self._lock:
            self._tokens = min(self._capacity, max(0.0, self._tokens + by))


def check_budget(value: object) -> None:
    """Raise if `retry_budget=` is not a budget.

    Raises:
        TypeError: It is not a `RetryBudget`, or it is of a derived class: methods of the user's
            would run on the communication thread, where none may (R8).
    """
    if type(value) is RetryBudget:
        return
    if isinstance(value, RetryBudget):
        raise TypeError(
            f"retry_budget={value!r} is of type {type(value).__name__}, but must be a RetryBudget"
            " itself: a class derived from it could hold up every client of the process"
        )
    raise TypeError(
        f"retry_budget={value!r} must be a RetryBudget: retry_budget=RetryBudget(capacity=10.0)"
    )
