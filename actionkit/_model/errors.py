"""The errors of ActionKit, one class for each way in which a call can fail.

ActionKitError
├─ TransientError                 trying again may help
│  ├─ ServerUnavailableError      no server in the time there was
│  ├─ AcceptanceTimeoutError      no answer to the goal request
│  ├─ ServerLostError             the server went away with the goal in flight
│  └─ FeedbackStalledError        `timeouts.feedback` ran out
├─ PermanentError                 trying again changes nothing
│  ├─ InvalidGoalError            the goal does not fit the action type; nothing was sent
│  ├─ ActionTypeMismatchError     that name is served with another type
│  ├─ GoalRejectedError           the server said no
│  ├─ GoalAbortedError            the server gave up on the goal
│  ├─ GoalCanceledError           somebody else cancelled the goal
│  ├─ ResultLostError             the goal ended, its result cannot be had
│  └─ ClassifyError               `classify=` gave no verdict on the goal
├─ DeadlineExceededError          the time given to the call ran out
├─ RetriesExhaustedError          the retries ended, and no error speaks for itself
└─ ClientClosedError              the client was closed
"""

from __future__ import annotations

import pickle
import uuid
from typing import Any, ClassVar

from actionkit._model.values import CancelReport, GoalEvent, GoalState


def _rebuild(cls: type[ActionKitError], message: str, state: dict[str, Any]) -> ActionKitError:
    error = cls(message)
    cause = state.pop("__cause__", None)
    error.__dict__.update(state)
    error.__cause__ = cause
    return error


def _picklable(cause: BaseException | None) -> BaseException | None:
    """Return the cause, or one of the same text where it cannot be pickled."""
    try:
        pickle.dumps(cause)
    except Exception:  # noqa: BLE001  pickling raises what the objects within raise
        return RuntimeError(f"{type(cause).__name__}: {cause}")
    return cause


class ActionKitError(Exception):
    """Base of every error that ActionKit raises for a call.

    `str(error)` is one sentence of what happened to which action and when, and what to do.

    Attributes:
        action_name: The full name of the action, `""` where no call was made.
        goal_id: The id of the last goal tried, or `None` where none was made.
        attempts: How many goals were sent on behalf of the call.
        timeline: The call's events, oldest first, as far as they were kept.
        elapsed: Seconds from the call to this error, or `None`.
        transient: Whether trying again may help.
        result: The action's result message, where the server sent one and `classify=`, an abort
            or a cancellation made it a failure.
        cancel: How the cancellation went, or `UNKNOWN` if a goal of the call may be running; of
            several goals the worst counts. `None` if there was nothing to cancel.
    """

    transient: ClassVar[bool] = False
    result: Any = None
    cancel: CancelReport | None = None

    def __init__(
        self,
        message: str,
        *,
        action_name: str = "",
        goal_id: uuid.UUID | None = None,
        attempts: int = 0,
        timeline: tuple[GoalEvent, ...] = (),
        elapsed: float | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.action_name = action_name
        self.goal_id = goal_id
        self.attempts = attempts
        self.timeline = timeline
        self.elapsed = elapsed

    def __str__(self) -> str:
        # OSError, a base of TimeoutError, would format its own arguments.
        return self.message

    def __reduce__(self) -> tuple[Any, ...]:
        # Neither keyword arguments nor __cause__ survive the pickling of a plain exception.
        state = {**self.__dict__, "__cause__": _picklable(self.__cause__)}
        return _rebuild, (type(self), self.message, state)


class TransientError(ActionKitError):
    """The call failed for a reason that may pass: trying again may help."""

    transient: ClassVar[bool] = True


class ServerUnavailableError(TransientError, TimeoutError):
    """No action server was ready in the time there was; nothing was sent.

    That time is `timeouts.server` or what is left to the call: the shorter of the two. Waiting
    longer is not another attempt, so no `RetryPolicy` tries this again within the call. A call that
    had a server ends with another error.
    """


class AcceptanceTimeoutError(TransientError):
    """The server did not answer the goal request within `timeouts.accept`.

    The goal was cancelled by its id all the same, because the request may have arrived;
    `cancel` tells what is known. If its acceptance comes later, it is cancelled then.
    """


class ServerLostError(TransientError):
    """The server went away, or was restarted, with the goal in flight.

    Not raised for a server that is alive but silent: only deadlines end those calls.
    """


class FeedbackStalledError(TransientError):
    """The server sent no feedback for `timeouts.feedback` seconds; the goal was cancelled."""


class PermanentError(ActionKitError):
    """The call failed for a reason that stays: the same goal would fail again."""


class InvalidGoalError(PermanentError, TypeError, ValueError):
    """The goal does not fit the action type. Nothing was sent.

    Attributes:
        field: The path of the field that does not fit, such as `pose.position.x`; `""` where
            the goal as a whole has the wrong type.
    """

    field: str = ""


class ActionTypeMismatchError(PermanentError):
    """The action name is served, but with another action type.

    Attributes:
        expected: The type of this client, such as `test_msgs/action/Fibonacci`.
        served: The types that the graph shows for the name; where one is another version of
            `expected`, with the type hashes of both.
    """

    expected: str = ""
    served: tuple[str, ...] = ()


class GoalRejectedError(PermanentError):
    """The server refused to accept the goal; it never ran."""


class GoalAbortedError(PermanentError):
    """The server gave up on the goal; `result` is what it sent with the abort."""


class GoalCanceledError(PermanentError):
    """Somebody else cancelled the goal; `result` is what the server sent then. Never retried."""


class ResultLostError(PermanentError):
    """The goal ended, but its result cannot be had: it has expired, or was never sent.

    Attributes:
        status: The terminal state of the goal where the server still told it, else `None`.
    """

    status: GoalState | None = None


class ClassifyError(PermanentError):
    """The function given as `classify=` gave no valid verdict, so this is not a success.

    It raised, returned neither a `Verdict` nor `None`, or did not answer: by the call's deadline,
    within 10 seconds where that is later or there is none, or within `timeouts.cancel` once the
    call was cancelled or its client closed. Or it called a goal a success that was rejected, or
    canceled by somebody else, or failed without a result. `__cause__` is what the function raised,
    or the error of that failed goal.
    """


class DeadlineExceededError(ActionKitError, TimeoutError):
    """The time given to the whole call ran out, and it had a server.

    The goal was cancelled then, which the server had `timeouts.cancel` seconds to confirm. Without
    a server it is a `ServerUnavailableError`, which is a `TimeoutError`, too.
    Not raised when a local wait such as `future.result(timeout=1)` runs out: that is a plain
    `TimeoutError` and leaves the goal alone.

    Attributes:
        phase: What the call was waiting for: `"server"`, `"accept"`, `"execute"`, `"pause"`
            (between two attempts) or `"cancel"` (for a cancellation to be confirmed).
        cancel: How the cancellation went: `CONFIRMED`, `REFUSED`, `UNKNOWN` or `NOT_NEEDED`; never
            `None`.
        late_result: The result, where the goal succeeded while it was being cancelled.
        status: The terminal state of the goal where the server told it, else `None`. `SUCCEEDED`
            without a `late_result`: the goal succeeded, and only its result did not come.
    """

    phase: str = ""
    # Narrower than that of the base class: `explain` alone assigns it, and never None.
    cancel: CancelReport = CancelReport.NOT_NEEDED  # pyright: ignore[reportIncompatibleVariableOverride]
    late_result: Any = None
    status: GoalState | None = None


class RetriesExhaustedError(ActionKitError):
    """The retries ended where the last error does not speak for itself.

    Either `classify=` called the last success a transient failure; `__cause__` says so. Or `stop=`
    or `wait=` of the `RetryPolicy` raised, did not answer in time, or returned what makes no sense;
    `__cause__` is what it raised, or else the error of the last attempt.
    """


class ClientClosedError(ActionKitError):
    """The client was closed: before the call, or while its goal was in flight."""
