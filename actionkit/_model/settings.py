"""What a user sets: how long each phase may take, and when to try again."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import wraps
from typing import Any, Literal, TypeVar

from actionkit._model.arguments import check_function, refuse_unknown
from actionkit._model.field_errors import shown

_T = TypeVar("_T")
LONGEST_GRACE = 60.0
"""Seconds by which the wait for cancellations is extended at most, while a server confirms them.

The requests are sent a few at a time, so hundreds of goals may take more than `Timeouts.cancel`."""
MOST = 1e9
"""The largest number that can be set: 31 years, where it is seconds. A clock in nanoseconds, as
the middleware's is, ends after 292 years, and several times may be added up on the way to it."""
MOST_TEXT = "1e9"
_RESEND = ("never_accepted", "confirmed_stopped", "server_gone", "always")


def check_seconds(name: str, value: object, *, optional: bool = True) -> float | None:
    """Return `value` as float seconds.

    Args:
        name: The parameter's name, for the error.
        value: Seconds, or `None` for no limit.
        optional: Whether `None` is allowed.

    Raises:
        TypeError: `value` is not a number.
        ValueError: `value` is negative, NaN, infinite or above `MOST`.
    """
    if value is None and optional:
        return None
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise TypeError(
            f"{name}={shown(value)} must be a number of seconds"
            + (" or None for no limit" if optional else "")
        )
    if not value >= 0:  # NaN is not, either
        raise ValueError(f"{name}={shown(value)} must be zero or more seconds")
    if value > MOST:
        most = "finite" if value == math.inf else f"{MOST_TEXT} or less"
        raise ValueError(
            f"{name}={shown(value)} must be {most}" + ("; None means no limit" if optional else "")
        )
    return float(value)


def _refusing_unknown(cls: type[_T]) -> type[_T]:
    """Return the dataclass; a keyword that it does not have is refused with a hint."""
    described: Any = cls
    made = described.__init__
    known = inspect.signature(made).parameters

    @wraps(made)
    def init(self: _T, *args: Any, **values: Any) -> None:
        refuse_unknown({name: v for name, v in values.items() if name not in known}, made)
        made(self, *args, **values)

    described.__init__ = init
    return cls


@_refusing_unknown
@dataclass(frozen=True)
class Timeouts:
    """Caps on the phases of a call, in seconds; `None` means no limit.

    Attributes:
        server: Until a server is ready; of a call that is tried again, for each attempt.
        accept: From the sending of the goal to its acceptance.
        total: The whole call, where the call itself says no `timeout=`. The confirmation of a
            cancellation (`cancel`) comes on top.
        feedback: The longest silence between two feedbacks; running out is an error.
        cancel: The wait for a cancellation to be confirmed. Never `None`.
        liveness: The longest time in which nothing at all comes from the server of a goal, not
            even the answer to a harmless question, before it is taken for lost. Only for servers
            that answer while they execute: one that is busy in its only thread is as silent as a
            dead one, and the two cannot be told apart from outside. Without it, a killed server
            is noticed when the middleware drops it, with Fast DDS after about 20 s.
        result: Until the result of a goal that is known to have ended, in a call without a
            deadline: a network that loses packets may take many seconds. A call with a deadline
            asks until then. A server that is gone, or no longer knows the goal, ends the wait.

    Raises:
        TypeError: A value is not a number.
        ValueError: A value is negative, NaN, infinite, or above 1e9.
    """

    server: float | None = 5.0
    accept: float | None = 5.0
    total: float | None = None
    feedback: float | None = None
    cancel: float = 2.0
    liveness: float | None = None
    result: float | None = 30.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = check_seconds(
                f"Timeouts.{field.name}", getattr(self, field.name), optional=field.name != "cancel"
            )
            object.__setattr__(self, field.name, value)
        if self.liveness == 0:
            raise ValueError("Timeouts.liveness=0 must be above 0; None means not to ask")


@_refusing_unknown
@dataclass(frozen=True)
class RetryPolicy:
    """When a call that failed for a transient reason is tried again.

    Attributes:
        attempts: The most goals sent for one call, the first included. A call that finds no server
            at first is not tried again; one that had a server waits for one before each attempt.
        initial: Seconds of the first pause.
        factor: What each pause is multiplied by to give the next.
        max_pause: The longest pause, in seconds.
        jitter: The share of each pause that is random, 0 to 1.
        resend: Whether a goal that may have reached the server is followed by another:
            `"never_accepted"` only where no server accepted it, `"confirmed_stopped"` also where
            it is known to run no more, `"server_gone"` also where its server is out of sight,
            though a server that only hangs or is cut off may still run it, `"always"` even where a
            server in sight may.
        stop: A tenacity stop strategy, in place of `attempts`.
        wait: A tenacity wait strategy, in place of the pauses.

    A strategy of your own, or of tenacity's, runs on a thread of its own. Where it raises, does not
    answer before the call's deadline and within 10 seconds, or returns what makes no sense (`stop`:
    no bool; `wait`: no number of seconds from 0 to 1e9), the call ends with a
    `RetriesExhaustedError` that says so.

    Raises:
        TypeError: A value has the wrong type.
        ValueError: A value is out of range.
    """

    attempts: int = 3
    initial: float = 0.2
    factor: float = 2.0
    max_pause: float = 5.0
    jitter: float = 0.2
    resend: Literal["never_accepted", "confirmed_stopped", "server_gone", "always"] = (
        "confirmed_stopped"
    )
    stop: Callable[[Any], bool] | None = None
    wait: Callable[[Any], float] | None = None

    def __post_init__(self) -> None:
        if isinstance(self.attempts, bool) or not isinstance(self.attempts, int):
            raise TypeError(f"RetryPolicy.attempts={shown(self.attempts)} must be a whole number")
        if self.attempts < 1:
            raise ValueError(
                f"RetryPolicy.attempts={shown(self.attempts)} must be 1 or more:"
                " it includes the first"
            )
        for name in ("initial", "factor", "max_pause", "jitter"):
            seconds = check_seconds(f"RetryPolicy.{name}", getattr(self, name), optional=False)
            object.__setattr__(self, name, seconds)
        if self.factor < 1:
            raise ValueError(f"RetryPolicy.factor={self.factor} must be 1 or more")
        if self.jitter > 1:
            raise ValueError(f"RetryPolicy.jitter={self.jitter} must be a share from 0 to 1")
        if self.resend not in _RESEND:
            raise ValueError(f"RetryPolicy.resend={self.resend!r} must be one of {_RESEND}")
        for name in ("stop", "wait"):
            strategy = getattr(self, name)
            if strategy is not None:
                check_function(f"RetryPolicy.{name}", strategy, f"a {name} strategy of tenacity's")

    @classmethod
    def none(cls) -> RetryPolicy:
        """Return the policy that never tries again."""
        return cls(attempts=1)
