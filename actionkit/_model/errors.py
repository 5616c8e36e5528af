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
│  ├─ GoalUnknownError            no server knows the goal that was attached to
│  ├─ GoalNotReplacedError        the goal to replace may still run; nothing was sent
│  ├─ GoalRejectedError           the server said no
│  ├─ GoalAbortedError            the server gave up on the goal
│  ├─ GoalCanceledError           somebody else cancelled the goal
│  ├─ ResultLostError             the goal ended, its result cannot be had
│  └─ ClassifyError               `classify=` gave no verdict on the goal
├─ DeadlineExceededError          the time given to the call ran out
├─ RetriesExhaustedError          the retries ended, and no error speaks for itself
├─ LedgerError                    the ledger's file cannot be used; nothing was sent
├─ SecurityError                  ROS security keeps this process out
└─ ClientClosedError              the client was closed
"""

from __future__ import annotations

import pickle
import uuid
from typing import Any, ClassVar

from actionkit._model.values import CancelReport, GoalEvent, GoalReport, GoalState


def _rebuild(cls: type[ActionKitError], message: str, state: dict[str, Any]) -> ActionKitError:
    error = cls(message)
    cause = state.pop("__cause__", None)
    error.__dict__.update(state)
    error.__cause__ = cause
    return error


def _picklable(cause: BaseException | None) -> BaseException | None:
    """Return the cause, or an error with the same text if the cause cannot be pickled."""
    try:
        pickle.dumps(cause)
    except Exception:  # noqa: BLE001  pickling runs code of any class
        return RuntimeError(f"{type(cause).__name__}: {cause}")
    return cause


class ActionKitError(Exception):
    """Base of every error that ActionKit raises for a call.

    `str(error)` says what happened, to which action and when, and what to do.

    Attributes:
        action_name: The full name of the action, or `""` if no call was made.
        goal_id: The id of the last goal, or `None` if no goal was made.
        attempts: How many goals the call has sent.
        timeline: The call's events that were kept, oldest first.
        elapsed: Seconds from the call to this error, or `None`.
        transient: Whether trying again may help.
        result: The action's result message, if the server sent one, and the call failed because of
            `classify=`, an abort or a cancellation.
        cancel: How the cancellation went, or `UNKNOWN` if a goal of the call may be running. With
            several goals, this is the worst case. `None` if there was nothing to cancel.
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
        # Pickling a plain exception loses its keyword arguments and its __cause__.
        state = {**self.__dict__, "__cause__": _picklable(self.__cause__)}
        return _rebuild, (type(self), self.message, state)


class TransientError(ActionKitError):
    """The call failed for a reason that may pass: trying again may help."""

    transient: ClassVar[bool] = True


class ServerUnavailableError(TransientError, TimeoutError):
    """No action server was ready in time; nothing was sent.

    The limit is `timeouts.server`, or the rest of the call's time if that is shorter. A
    `RetryPolicy` does not try this again within the call: that would only wait longer. A call that
    had a server ends with another error.
    """


class AcceptanceTimeoutError(TransientError):
    """The server did not answer the goal request within `timeouts.accept`.

    The request may have arrived, so the goal was cancelled by its id; `cancel` says what is known.
    If the acceptance comes later, the goal is cancelled then.
    """


class ServerLostError(TransientError):
    """The server went away, or seems to have been restarted, with the goal in flight.

    A server that is alive but silent does not count as lost, unless `Timeouts.liveness` says so.
    Only deadlines end such a call.
    """


class FeedbackStalledError(TransientError):
    """The server sent no feedback for `timeouts.feedback` seconds; the goal was cancelled."""


class PermanentError(ActionKitError):
    """The call failed for a reason that stays: the same goal would fail again."""


class InvalidGoalError(PermanentError, TypeError, ValueError):
    """The goal does not fit the action type. Nothing was sent.

    Attributes:
        field: The path of the field that does not fit, such as `pose.position.x`; `""` if the
            goal as a whole has the wrong type.
    """

    field: str = ""


class ActionTypeMismatchError(PermanentError):
    """The action name is served, but with another action type.

    Attributes:
        expected: The type of this client, such as `test_msgs/action/Fibonacci`.
        served: The types that the graph shows for the name. If one is another version of
            `expected`, its text has the type hashes of both.
    """

    expected: str = ""
    served: tuple[str, ...] = ()


class GoalUnknownError(PermanentError):
    """No server of the action knows the goal that the call was attached to.

    The id is wrong, the server was restarted or has not accepted the goal yet, or the goal ended
    long ago.
    """


class GoalNotReplacedError(PermanentError):
    """Nothing was sent: the earlier goal, which had to stop first, may still be running.

    Attributes:
        earlier: What is known about the goals of the earlier call that may be running.
    """

    earlier: tuple[GoalReport, ...] = ()


class GoalRejectedError(PermanentError):
    """The server refused to accept the goal; it never ran."""


class GoalAbortedError(PermanentError):
    """The server gave up on the goal; `result` is the result that it sent."""


class GoalCanceledError(PermanentError):
    """Somebody else cancelled the goal. `result` is the server's result. Never retried."""


class ResultLostError(PermanentError):
    """The goal ended, but its result is lost: it has expired, or the server never sent it.

    Attributes:
        status: The terminal state of the goal if it is known, else `None`.
    """

    status: GoalState | None = None


class ClassifyError(PermanentError):
    """The function given as `classify=` returned no valid verdict, so this is not a success.

    There are three cases:

    - The function raised, or returned neither a `Verdict` nor `None`.
    - It did not answer before the call's deadline, or within 10 seconds if that is earlier or if no
      deadline is set. After a cancel, or when the client closes, it has at most `timeouts.cancel`.
    - It returned SUCCESS for a goal that was rejected, canceled by somebody else, or failed without
      a result.

    `__cause__` is the error that the function raised, or the error of that failed goal.
    """


class DeadlineExceededError(ActionKitError, TimeoutError):
    """The time for the whole call ran out, and the call had a server.

    The goal was cancelled, and the server had `timeouts.cancel` seconds to confirm that. If the
    call had no server, the error is a `ServerUnavailableError`, which is also a `TimeoutError`. If
    a local wait such as `future.result(timeout=1)` runs out, it raises a plain `TimeoutError`, and
    the goal goes on.

    Attributes:
        phase: What the call was waiting for: `"server"`, `"replace"` (the goal that it replaces
            has to stop first), `"accept"`, `"execute"`, `"pause"` (between two attempts) or
            `"cancel"` (for the confirmation, after the caller itself had cancelled).
        cancel: How the cancellation went: `CONFIRMED`, `REFUSED`, `UNKNOWN` or `NOT_NEEDED`; never
            `None`.
        late_result: The result, if the goal succeeded while it was being cancelled.
        status: The terminal state of the goal if it is known, else `None`. `SUCCEEDED` without a
            `late_result` means that the goal succeeded, but its result did not come.
    """

    phase: str = ""
    # Narrower than in the base class: only `explain` assigns it, and never None.
    cancel: CancelReport = CancelReport.NOT_NEEDED  # pyright: ignore[reportIncompatibleVariableOverride]
    late_result: Any = None
    status: GoalState | None = None


class RetriesExhaustedError(ActionKitError):
    """The retries ended, and the error of the last attempt would not explain why.

    Either the last goal succeeded, but `classify=` returned TRANSIENT; `__cause__` says so. Or
    `stop=` or `wait=` of the `RetryPolicy` raised, did not answer in time, or returned an invalid
    value; `__cause__` is the error that it raised, or the error of the last attempt.
    """


class LedgerError(ActionKitError, OSError):
    """The file of a `Ledger` cannot be used, or another process cancels or follows the goal.

    Nothing was sent.
    """


class SecurityError(ActionKitError, PermissionError):
    """ROS security (SROS 2) keeps this process, or this action, out of the graph.

    Files of the enclave are missing, the middleware has no security, or the policy does not allow
    the action. Nothing was sent.
    """


class ClientClosedError(ActionKitError):
    """The client was closed: before the call, or while its goal was in flight."""
