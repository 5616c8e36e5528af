"""What a tool returns: how a goal ended, in words that a language model can reason about."""

from __future__ import annotations

from typing import Any

from actionkit import (
    AcceptanceTimeoutError,
    ActionTypeMismatchError,
    ClientClosedError,
    DeadlineExceededError,
    GoalAbortedError,
    GoalCanceledError,
    GoalRejectedError,
    GoalState,
    InvalidGoalError,
    Outcome,
    ResultLostError,
    ServerLostError,
    ServerUnavailableError,
)
from actionkit._model.printable import visible
from actionkit.agents._plain import plain_json
from actionkit.agents._values import ToolResult

DATA = "data_from_robot"
"""The key that names the fields with what the robot sent, which nobody has checked."""
_STATUSES: tuple[tuple[type[BaseException], str, bool, str, str], ...] = (
    # error, status, whether the same call makes sense again, what happened, advice
    (
        InvalidGoalError,
        "refused",
        False,
        "the goal does not fit the action {action}",
        "Change the arguments.",
    ),
    (
        ServerUnavailableError,
        "no_server",
        True,
        "no server of the action {action} was ready within {seconds} s",
        "The part of the robot that does this is not running; try again later, or do without it.",
    ),
    (
        AcceptanceTimeoutError,
        "no_answer",
        True,
        "the server of the action {action} did not say whether it takes the goal",
        "The server is there and does not answer; try again later, or do without it.",
    ),
    (
        ServerLostError,
        "lost",
        True,
        "the server of the action {action} went out of sight while it had the goal; what it has"
        " done is not known",
        "The server went away while it worked; look at the state of the robot before going on.",
    ),
    (
        GoalRejectedError,
        "rejected",
        False,
        "the server of the action {action} rejected the goal, and gives no reason",
        "The same goal would be rejected again; change it, or wait until the robot can take it.",
    ),
    (
        GoalAbortedError,
        "aborted",
        False,
        "the server of the action {action} aborted the goal after {seconds} s",
        "The robot gave up on it; `result` may say why. Change the goal or the plan.",
    ),
    (
        GoalCanceledError,
        "canceled",
        False,
        "the goal was cancelled after {seconds} s, and not by this toolbox",
        "Somebody else stopped it, most likely on purpose: do not send it again unasked.",
    ),
    (
        ResultLostError,
        "result_lost",
        False,
        "the goal has ended, and its result did not come",
        "It ended, and how is not known; look at the state of the robot before going on.",
    ),
    (
        DeadlineExceededError,
        "timed_out",
        False,
        "the time that this tool may take ran out after {seconds} s",
        "A goal that was sent is cancelled then; ask for less at a time.",
    ),
    (
        ActionTypeMismatchError,
        "failed",
        False,
        "the action {action} is served as {served}, and the toolbox has it as {expected}",
        "The toolbox is not set up for this robot; tell a human.",
    ),
)
_MAY_RUN = (
    "It may still be running: the tool `goals` tells what is known of it. Send nothing that must"
    " not run beside it."
)
_GOALS_KEPT = 100
"""An outcome tells of so many goals that have ended."""
STATUSES = tuple(
    dict.fromkeys(["succeeded", "canceled", "cancel_unconfirmed", "failed"])
    | dict.fromkeys(row[1] for row in _STATUSES)
)
"""Every `status` of an action's tool."""


def error_value(kind: str, message: str, *, retry: bool, advice: str) -> dict[str, Any]:
    """Return the `error` of a result."""
    # Also a message may hold words of others, such as the name of a type that a server has.
    return {"type": kind, "message": visible(message), "retry": retry, "advice": advice}


def refusal(tool: str, kind: str, message: str, *, retry: bool, advice: str) -> ToolResult:
    """Return the result of a call that sent nothing."""
    error = error_value(kind, message, retry=retry, advice=advice)
    return ToolResult({**_blank(tool, "refused"), "error": error}, is_error=True)


def goal_value(
    tool: str, outcome: Outcome[Any], feedback: object | None, why_cancelled: str
) -> dict[str, Any]:
    """Return how a goal ended, as a JSON object.

    Args:
        tool: The tool's name.
        outcome: Of the call.
        feedback: The latest feedback message.
        why_cancelled: Why this toolbox cancelled it, `""` where it did not.
    """
    may_run = may_still_run(outcome)
    known = len(outcome.goals)  # an attempt that finds no server sends none
    sent = known if known < _GOALS_KEPT else outcome.attempts
    status, error = _judged(outcome, why_cancelled, may_run)
    return {
        **_blank(tool, status),
        "result": None if outcome.result is None else plain_json(outcome.result),
        "error": error,
        "may_still_run": may_run,
        "cancel": None if outcome.cancel is None else outcome.cancel.value.lower(),
        "elapsed": round(outcome.elapsed, 3),
        "goal_id": str(outcome.goal_id) if sent else None,
        "attempts": sent,
        "feedback": None if feedback is None else plain_json(feedback),
        "feedback_count": outcome.feedback_count,
    }


def may_still_run(outcome: Outcome[Any]) -> bool:
    """Tell whether a goal of the call may be running, though the call is over."""
    return any(goal.fate.may_run for goal in outcome.goals)


def _judged(
    outcome: Outcome[Any], why_cancelled: str, may_run: bool
) -> tuple[str, dict[str, Any] | None]:
    """Return the status and the error."""
    # Also where it succeeded while it was being cancelled: the robot has done it.
    if outcome.error is None or (
        outcome.status is GoalState.SUCCEEDED and outcome.result is not None
    ):
        return "succeeded", None
    if why_cancelled and not outcome.status.is_terminal and may_run:
        message = f"{why_cancelled}; the server has not confirmed that the goal stopped"
        error = error_value("cancel_unconfirmed", message, retry=False, advice=_MAY_RUN)
        return "cancel_unconfirmed", error
    if why_cancelled and outcome.status is GoalState.ABORTED:
        message = f"{why_cancelled}; the robot gave up on the goal meanwhile"
        advice = _MAY_RUN if may_run else "Look at the robot, and ask before sending it again."
        return "aborted", error_value("cancelled", message, retry=False, advice=advice)
    ended = outcome.status.is_terminal
    stopped = outcome.status in (GoalState.CANCELED, GoalState.REJECTED)
    cancelled = outcome.attempts == 0 or stopped or not ended
    if (why_cancelled and cancelled) or isinstance(outcome.error, ClientClosedError):
        message = why_cancelled or "the toolbox was closed"
        advice = _MAY_RUN if may_run else "Ask before sending it again."
        return "canceled", error_value("cancelled", message, retry=False, advice=advice)
    return _failure(outcome, may_run)


def _failure(outcome: Outcome[Any], may_run: bool) -> tuple[str, dict[str, Any] | None]:
    """Return the status and the error of a call that failed by itself.

    In words of its own: the error's are for people who write Python, who find them in the log.
    """
    known = (row[1:] for row in _STATUSES if isinstance(outcome.error, row[0]))
    failed = ("failed", False, "the call failed", "Do without this, or ask a human.")
    status, retry, message, advice = next(known, failed)
    message = message.format(
        action=getattr(outcome.error, "action_name", ""),
        seconds=f"{outcome.elapsed:.1f}",
        served=" and ".join(getattr(outcome.error, "served", ())),
        expected=getattr(outcome.error, "expected", ""),
    )
    if not outcome.goals:
        message += "; nothing was sent"
    if may_run:
        retry, advice = False, _MAY_RUN
    return status, error_value(status, message, retry=retry, advice=advice)


def _blank(tool: str, status: str) -> dict[str, Any]:
    return {
        "tool": tool,
        "status": status,
        "result": None,
        "error": None,
        "may_still_run": False,
        "cancel": None,
        "elapsed": 0.0,
        "goal_id": None,
        "attempts": 0,
        "feedback": None,
        "feedback_count": 0,
        DATA: ["result", "feedback"],
    }
