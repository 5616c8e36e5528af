"""Turns the ending of a call into the error that tells its user what happened (C3.2)."""

from __future__ import annotations

import concurrent.futures
from dataclasses import replace
from typing import Any

from actionkit._calls.errors.error_context import ErrorContext
from actionkit._calls.errors.error_texts import TEXTS, invalid_text
from actionkit._calls.errors.still_running import name_others_left
from actionkit._goal.effects import End, Ending
from actionkit._model import errors
from actionkit._model.field_errors import FieldProblem
from actionkit._model.printable import full_stop
from actionkit._model.values import Verdict

_BY_CLASSIFY = (End.REJECTED_BY_CLASSIFIER, End.CLASSIFIER_FAILED)


def explain(ending: Ending, call: ErrorContext) -> BaseException | None:
    """Return the error for an ending, or `None` for a success."""
    if ending.end is End.SUCCEEDED:
        return None
    rejected = ending.end is End.REJECTED_BY_CLASSIFIER
    judged_transient = rejected and ending.verdict is Verdict.TRANSIENT
    if ending.strategy_fault is not None or (judged_transient and ending.not_retried):
        return _exhausted(ending, call)
    if ending.end in (End.REPLACED, End.CANCELLED_BY_CALLER):
        how = "replaced" if ending.end is End.REPLACED else "cancelled"
        happened = (
            f"goal {call.goal_id} of action {call.action_name!r} was {how} by its caller after"
            f" {call.elapsed:.1f} s"
        )
        left = name_others_left(happened, ending, call)
        return concurrent.futures.CancelledError(f"{happened}.{left}" if left else happened)
    cls, text = TEXTS[ending.end]
    if isinstance(ending.error, errors.LedgerError):
        cls, text = errors.LedgerError, lambda ending, _: str(ending.error)
    if judged_transient:
        cls = errors.TransientError
    note = f" It was not tried again: {ending.not_retried}." if ending.not_retried else ""
    if ending.classifier_fault is not None and ending.end is not End.CLASSIFIER_FAILED:
        note += f" It was not tried again, because {full_stop(ending.classifier_fault.problem)}"
    happened = text(ending, call) + note
    error = cls(happened + name_others_left(happened, ending, call), **_common(call))
    if ending.cancel is not None:
        error.cancel = ending.cancel
    _add_facts(error, ending, call)
    return error


def _exhausted(ending: Ending, call: ErrorContext) -> BaseException:
    """Return the error for retries that ended if the last failure does not tell why they ended."""
    last = explain(replace(ending, strategy_fault=None, not_retried=""), call)
    fault = ending.strategy_fault
    reason = ending.not_retried if fault is None else fault.problem
    text = f"{last} The retries ended: {full_stop(reason)}"
    error = errors.RetriesExhaustedError(text, **_common(call))
    error.result, error.cancel = ending.result, ending.cancel
    error.__cause__ = last if fault is None or fault.cause is None else fault.cause
    return error


def _common(call: ErrorContext) -> dict[str, Any]:
    return {
        "action_name": call.action_name,
        "goal_id": call.goal_id,
        "attempts": call.attempts,
        "timeline": call.timeline,
        "elapsed": call.elapsed,
    }


def _add_facts(error: errors.ActionKitError, ending: Ending, call: ErrorContext) -> None:
    if ending.end in (End.ABORTED, End.CANCELED_BY_OTHER, *_BY_CLASSIFY):
        error.result = ending.result
    if isinstance(error, errors.DeadlineExceededError):
        error.phase = ending.phase
        error.late_result = ending.result
        error.status = ending.ended_as
    elif isinstance(error, errors.ActionTypeMismatchError):
        error.expected = call.type_name
        error.served = ending.served
    elif isinstance(error, errors.ResultLostError):
        error.status = ending.ended_as
    elif isinstance(error, errors.GoalNotReplacedError):
        error.earlier = ending.earlier
    elif isinstance(error, errors.InvalidGoalError):
        error.field = getattr(ending.error, "path", "")
    if ending.error is not None:
        error.__cause__ = ending.error
    if ending.end is End.CLASSIFIER_FAILED and ending.classifier_fault is not None:
        error.__cause__ = ending.classifier_fault.cause


def invalid_goal(action_name: str, problem: FieldProblem) -> errors.InvalidGoalError:
    """Return the error for a goal that was only checked, and belongs to no call."""
    error = errors.InvalidGoalError(invalid_text(action_name, problem), action_name=action_name)
    error.field = problem.path
    return error
