"""The values that a call gives to its user: states, events, verdicts and outcomes."""

from __future__ import annotations

import uuid
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timezone
from enum import Enum
from typing import Any, Generic

from actionkit._model.action_type import ResultT
from actionkit._model.printable import on_one_line


class GoalState(str, Enum):
    """The states of a goal. Most have the same names as in ROS 2."""

    SENDING = "SENDING"
    """The goal was not given to the middleware yet: it waits for a server, or for its turn."""
    SENT = "SENT"
    """The middleware has the goal; the server has not answered."""
    ACCEPTED = "ACCEPTED"
    """The server accepted the goal, but has not said that it executes it."""
    REJECTED = "REJECTED"
    """The server rejected the goal: it never runs."""
    EXECUTING = "EXECUTING"
    """The server executes the goal."""
    FEEDBACK = "FEEDBACK"
    """The state of a feedback event, never of a goal."""
    CANCELING = "CANCELING"
    """The server agreed to cancel the goal; it may still be stopping."""
    SUCCEEDED = "SUCCEEDED"
    """The server finished the goal."""
    CANCELED = "CANCELED"
    """The server stopped the goal because somebody cancelled it."""
    ABORTED = "ABORTED"
    """The server gave up on the goal."""
    LOST = "LOST"
    """The server, or the goal's result, is gone."""
    RETRYING = "RETRYING"
    """The call waits between two attempts."""
    TIMED_OUT = "TIMED_OUT"
    """The caller gave up; the outcome's `cancel` says what happened to the goal."""
    REPLACED = "REPLACED"
    """The goal has ended because its caller replaced it by another one, with `preempt=True`."""

    def __str__(self) -> str:
        return self.value

    @property
    def is_terminal(self) -> bool:
        """Whether the server ended the goal in this state, or rejected it."""
        return self in _TERMINAL


_TERMINAL = frozenset(
    {GoalState.REJECTED, GoalState.SUCCEEDED, GoalState.CANCELED, GoalState.ABORTED}
)


class CancelReport(str, Enum):
    """What is known about a goal that its caller gave up on."""

    CONFIRMED = "CONFIRMED"
    """A terminal state was seen: the goal has stopped."""
    REFUSED = "REFUSED"
    """The server refused to cancel: the goal continues."""
    UNKNOWN = "UNKNOWN"
    """No answer in time: the goal may still be running. It is cancelled when that is possible."""
    NOT_NEEDED = "NOT_NEEDED"
    """Nothing was running: the goal was never sent, or not accepted."""

    def __str__(self) -> str:
        return self.value


class GoalFate(str, Enum):
    """What is known about one goal that a call has sent."""

    UNANSWERED = "UNANSWERED"
    """The server has not answered, and may still accept the goal."""
    RUNNING = "RUNNING"
    """A server accepted the goal, and has not shown that the goal has ended."""
    REJECTED = "REJECTED"
    """The server rejected it: it never ran."""
    ENDED = "ENDED"
    """A server has shown that the goal has stopped."""
    LOST = "LOST"
    """Its server disappeared: the goal may be running. It is cancelled if the server appears
    again."""
    LEFT = "LEFT"
    """The goal may be running, and this program does not track it any more."""

    def __str__(self) -> str:
        return self.value

    @property
    def may_run(self) -> bool:
        """Whether the goal may be running, or may begin to run."""
        return self not in (GoalFate.REJECTED, GoalFate.ENDED)


class Verdict(str, Enum):
    """What a `classify=` function says about an outcome."""

    SUCCESS = "SUCCESS"
    """The call succeeded: its result is returned."""
    TRANSIENT = "TRANSIENT"
    """The call failed, and trying again may help."""
    PERMANENT = "PERMANENT"
    """The call failed, and trying again changes nothing."""

    def __str__(self) -> str:
        return self.value


@dataclass(frozen=True)
class GoalEvent:
    """One transition in the life of a goal.

    Attributes:
        goal_id: The goal's id; each attempt of a call has its own.
        attempt: The number of the goal in the call, from 1.
        state: The new state; `FEEDBACK` for a feedback message.
        monotonic: Seconds on the monotonic clock.
        wall: Seconds since the epoch, for logs.
        detail: A few words for people, or `""`. For feedback, the number of the message.
        cancel_refused: Whether this event means that the server refused to cancel the goal. The
            goal continues, and `state` has not changed.
    """

    goal_id: uuid.UUID
    attempt: int
    state: GoalState
    monotonic: float
    wall: float
    detail: str = ""
    cancel_refused: bool = False


@dataclass(frozen=True)
class GoalReport:
    """What was known about one goal when its call ended.

    Attributes:
        goal_id: The goal's id.
        fate: What was known about it.
        cancel_refused: Whether the server refused to cancel it.
    """

    goal_id: uuid.UUID
    fate: GoalFate
    cancel_refused: bool = False


to_html: Callable[[Timeline, Outcome[Any] | None], str] | None = None
"""Draws for notebooks. `_calls.sending.call_record` sets it, because what draws imports this
module."""


class Timeline(tuple[GoalEvent, ...]):
    """The events of a call, oldest first. Print it for a bug report.

    It keeps only the first and the last feedback of each goal. If a call retries for days, it keeps
    only the beginning and the end.
    """

    __slots__ = ()

    def __str__(self) -> str:
        """Return a line for each event: elapsed milliseconds, attempt, state, detail.

        The first line also has the date. The first line of each goal has the goal's id, which is
        also in the server's log.
        """
        if not self:
            return "(no events)"
        began = self[0].monotonic
        elapsed = [f"{(event.monotonic - began) * 1000:.1f}" for event in self]
        width = max(map(len, elapsed))
        lines: list[str] = []
        goal_id = None
        for event, milliseconds in zip(self, elapsed, strict=True):
            said = _said(event, goal_id, first=not lines)
            # 9 is the length of SUCCEEDED, the longest of the states.
            line = f"{milliseconds:>{width}} ms  #{event.attempt}  {event.state!s:<9}"
            lines.append(f"{line}  {said}".rstrip())
            goal_id = event.goal_id
        return "\n".join(lines)

    def _repr_pretty_(self, printer: Any, cycle: bool) -> None:
        """IPython shows a tuple otherwise."""
        printer.text(str(self))

    def _repr_html_(self) -> str | None:
        return None if to_html is None else to_html(self, None)


def _said(event: GoalEvent, goal_before: uuid.UUID | None, *, first: bool) -> str:
    """Return the text after the state in a line."""
    parts = [on_one_line(event.detail)] if event.detail else []
    if event.goal_id != goal_before:
        parts.append(f"goal {event.goal_id}")
    if first:
        parts.append(f"at {date_text(event.wall)}")
    return ", ".join(parts)


def date_text(wall: float) -> str:
    """Return seconds since the epoch as a date, in UTC and to the millisecond."""
    try:
        date = datetime.fromtimestamp(wall, timezone.utc)
    except (OverflowError, OSError, ValueError):  # out of range for a date
        return f"{wall} s since 1970"
    return date.strftime("%Y-%m-%d %H:%M:%S.") + f"{date.microsecond // 1000:03} UTC"


@dataclass(frozen=True)
class Outcome(Generic[ResultT]):
    """How a call ended, and everything that is known about it. Reading it raises nothing.

    Attributes:
        status: The last known state of the last goal.
        result: The action's result message if the server sent one, else `None`.
        error: The error that `result()` raises; `None` for a success.
        attempts: How many goals were sent.
        timeline: The call's events, oldest first; `print` it to read it.
        goal_id: The id of the last goal.
        cancel: How the cancellation went, or `UNKNOWN` if a goal of the call may be running. With
            several goals, this is the worst case. `None` if there was nothing to cancel.
        callback_errors: How many times a callback of the user raised an error.
        feedback_count: How many feedback messages of the goal were received.
        elapsed: Seconds from the call to its end.
        goals: The goals that were sent, oldest first: all that may be running, and the last 100 of
            the others.
        from_ledger: Whether an earlier call with the same `key=` had succeeded. Then the result is
            that of the earlier call, and nothing was sent.
    """

    status: GoalState
    result: ResultT | None
    error: BaseException | None
    attempts: int
    timeline: Timeline
    goal_id: uuid.UUID
    cancel: CancelReport | None
    callback_errors: int = 0
    feedback_count: int = 0
    elapsed: float = 0.0
    goals: tuple[GoalReport, ...] = ()
    from_ledger: bool = False

    def __repr__(self) -> str:
        # A whole timeline, and a result with an image in it, would fill the screen.
        error = "" if self.error is None else f": {type(self.error).__name__}"
        attempts = f"{self.attempts} attempt{'' if self.attempts == 1 else 's'}"
        cancel = "" if self.cancel is None else f", cancel {self.cancel}"
        return f"<Outcome {self.status}{error}, {attempts}, {self.elapsed:.3f} s{cancel}>"

    def _repr_html_(self) -> str | None:
        return None if to_html is None else to_html(self.timeline, self)

    @property
    def state(self) -> GoalState:
        """The same as `status`; futures and events have this name, too."""
        return self.status

    @property
    def ok(self) -> bool:
        """Whether the call succeeded."""
        return self.error is None
