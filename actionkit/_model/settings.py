"""The settings of a call: how long each phase may take, and when to try again."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, Literal

from actionkit._model.arguments import check_function
from actionkit._model.field_errors import shown

LONGEST_GRACE = 60.0
"""Seconds by which the wait for cancellations is extended at most, while a server confirms them.

Requests are sent a few at a time, so hundreds of goals may need more time than
`Timeouts.cancel`."""
MOST = 1e9
"""The largest number that can be set: 31 years, if it is in seconds. The middleware's clock, in
nanoseconds, ends after 292 years, and several times may be added up before they get there."""
MOST_TEXT = "1e9"
_RESEND = ("never_accepted", "confirmed_stopped", "server_gone", "always")


def check_seconds(name: str, value: object, *, optional: bool = True) -> float | None:
    """Return `value` as float seconds; `None` means no limit, and is allowed if `optional`.

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
    if not value >= 0:  # also for NaN
        raise ValueError(f"{name}={shown(value)} must be zero or more seconds")
    if value > MOST:
        most = "finite" if value == math.inf else f"{MOST_TEXT} or less"
        raise ValueError(
            f"{name}={shown(value)} must be {most}" + ("; None means no limit" if optional else "")
        )
    return float(value)


@dataclass(frozen=True)
class Timeouts:
    """Limits for the phases of a call, in seconds; `None` means no limit.

    Attributes:
        server: Until a server is ready. If a call is tried again, each attempt has this time.
        accept: From sending the goal to its acceptance.
        total: For the whole call, if the call itself has no `timeout=`. The wait for a cancellation
            (`cancel`) comes on top.
        feedback: The longest time without a feedback message after the acceptance. Then the goal is
            cancelled, and the call fails. It no longer counts when somebody else cancels the goal.
        cancel: For the confirmation of a cancellation. Never `None`.
        liveness: The longest silence of the server of a goal, in which it does not even answer a
            harmless question, before it counts as lost. Use this only with servers that answer
            while they execute: from outside, a server that is busy in its only thread looks like a
            dead one. Without it, a killed server is noticed when the middleware drops it, with Fast
            DDS after about 20 s.
        result: For the result of a goal that is known to have ended, in a call without a deadline:
            on a network that loses packets, it may take many seconds. A call with a deadline waits
            until the deadline. The wait ends early if the server is gone or no longer knows the
            goal.

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


@dataclass(frozen=True)
class RetryPolicy:
    """Says when a call is tried again after it failed for a transient reason.

    Attributes:
        attempts: The largest number of goals for one call, with the first one. A call that finds no
            server at first is not tried again. A call that had a server waits for one before each
            attempt.
        initial: The first pause, in seconds.
        factor: Each pause is this many times as long as the one before.
        max_pause: The longest pause, in seconds.
        jitter: The random share of each pause, 0 to 1.
        resend: When another goal may follow a goal that may have reached the server:
            `"never_accepted"` only if every server rejected it, `"confirmed_stopped"` also if it is
            known to have stopped, `"server_gone"` also if its server has left the graph (one that
            is only cut off may still run it), `"always"` even if a server in sight may still run
            it. If the server is silent, or seems to have been restarted, a call with
            `"server_gone"` waits until it has left the graph: up to the deadline, or without one
            for 30 seconds, or for `Timeouts.server` if that is longer. A process that was killed
            leaves the graph after its lease: 20 seconds with Fast DDS.
        stop: A tenacity stop strategy, used instead of `attempts`.
        wait: A tenacity wait strategy, used instead of the pauses.

    A strategy of your own, or of tenacity, runs on its own thread. If it raises, does not answer
    before the call's deadline and within 10 seconds, or returns an invalid value (`stop`: not a
    bool; `wait`: not a number of seconds from 0 to 1e9), the call ends with a
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
