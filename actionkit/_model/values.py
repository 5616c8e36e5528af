"""The values that a call hands to its user: states, events, verdicts and outcomes."""

from __future__ import annotations

import uuid
from dataclasses import dataclass
from enum import Enum
from typing import Generic

from actionkit._model.action_type import ResultT
from actionkit._model.timeline_text import timeline_text


class GoalState(str, Enum):
    """The states of a goal, in the field's own words (contract C6.1)."""

    SENDING = "SENDING"
    """Not handed to the middleware yet: waiting for a server, or for its turn."""
    SENT = "SENT"
    """Handed to the middleware; the server has not answered."""
    ACCEPTED = "ACCEPTED"
    REJECTED = "REJECTED"
    EXECUTING = "EXECUTING"
    FEEDBACK = "FEEDBACK"
    """Only ever the state of an event, never of a goal."""
    CANCELING = "CANCELING"
    SUCCEEDED = "SUCCEEDED"
    CANCELED = "CANCELED"
    ABORTED = "ABORTED"
    LOST = "LOST"
    """The server, or the goal's result, is gone."""
    RETRYING = "RETRYING"
    """Between two attempts of one call."""
    TIMED_OUT = "TIMED_OUT"
    """The caller gave up; what became of the goal is told by the outcome's `cancel`."""

    def __str__(self) -> str:
        return self.value

    @property
    def is_terminal(self) -> bool:
        """Whether the server ended the goal in this state, or never took it."""
        return self in _TERMINAL


_TERMINAL = frozenset(
    {GoalState.REJECTED, GoalState.SUCCEEDED, GoalState.CANCELED, GoalState.ABORTED}
)


class CancelReport(str, Enum):
    """What is known of a goal that its caller gave up on (contract C2.3)."""

    CONFIRMED = "CONFIRMED"
    """A terminal state was seen: the goal runs no more."""
    REFUSED = "REFUSED"
    """The server refused to cancel: the goal runs on."""
    UNKNOWN = "UNKNOWN"
    """No answer in time: the goal may still be running. It is cancelled when it can be."""
    NOT_NEEDED = "NOT_NEEDED"
    """Nothing was running: the goal was never sent, or not accepted."""

    def __str__(self) -> str:
        return self.value


class Verdict(str, Enum):
    """What a `classify=` function says of an outcome (contract C3.3)."""

    SUCCESS = "SUCCESS"
    TRANSIENT = "TRANSIENT"
    PERMANENT = "PERMANENT"

    def __str__(self) -> str:
        return self.value


@dataclass(frozen=True)
class GoalEvent:
    """One transition in the life of a goal (contract C6.1).

    Attributes:
        goal_id: The goal's id; each attempt of a call has its own.
        attempt: 1 for the first goal sent on behalf of the call.
        state: The state entered; `FEEDBACK` for a feedback message.
        monotonic: Seconds on the monotonic clock.
        wall: Seconds since the epoch, for logs.
        detail: A few words for people, or `""`; the number of a feedback message.
    """

    goal_id: uuid.UUID
    attempt: int
    state: GoalState
    monotonic: float
    wall: float
    detail: str = ""


class Timeline(tuple[GoalEvent, ...]):
    """The events of a call, oldest first; printed, a text for a bug report (contract C6.1).

    Of each goal's feedback the first and the last are kept, and of a call that retries for days
    its beginning and its end.
    """

    __slots__ = ()

    def __str__(self) -> str:
        return timeline_text(self)


@dataclass(frozen=True)
class Outcome(Generic[ResultT]):
    """How a call ended: the whole story, without raising (contract C1.7).

    Attributes:
        status: The last known state of the last goal.
        result: The action's result message wherever the server sent one, else `None`.
        error: What `result()` raises; `None` for a success.
        attempts: How many goals were sent.
        timeline: The call's events, oldest first; `print` it to read it.
        goal_id: The id of the last goal.
        cancel: What became of a goal that the caller gave up on; `None` where he did not.
        callback_errors: How many times a callback of the user's raised.
        feedback_count: How many feedback messages of the goal were received.
        elapsed: Seconds from the call to its end.
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

    @property
    def ok(self) -> bool:
        """Whether the call succeeded."""
        return self.error is None
