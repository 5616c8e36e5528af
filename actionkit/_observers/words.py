"""The log levels and texts for transitions and for the ends of calls."""

from __future__ import annotations

import concurrent.futures
import logging
from typing import Any

from actionkit._model.values import GoalEvent, GoalState, Outcome

LEVELS = {
    GoalState.SENDING: logging.DEBUG,
    GoalState.SENT: logging.DEBUG,
    GoalState.ACCEPTED: logging.INFO,
    GoalState.REJECTED: logging.WARNING,
    GoalState.EXECUTING: logging.DEBUG,
    GoalState.FEEDBACK: logging.DEBUG,
    GoalState.CANCELING: logging.INFO,
    GoalState.SUCCEEDED: logging.INFO,
    GoalState.CANCELED: logging.INFO,
    GoalState.ABORTED: logging.WARNING,
    GoalState.LOST: logging.WARNING,
    GoalState.RETRYING: logging.WARNING,
    GoalState.TIMED_OUT: logging.WARNING,
    GoalState.REPLACED: logging.INFO,
}


def level_of(event: GoalEvent) -> int:
    """Return the `logging` level of a transition."""
    return logging.WARNING if event.cancel_refused else LEVELS[event.state]


def level_of_outcome(outcome: Outcome[Any]) -> int:
    """Return the level of a call's end: not an error, because the caller handles that."""
    if outcome.error is None:
        return logging.DEBUG  # the end of its goal is already logged
    cancelled = isinstance(outcome.error, concurrent.futures.CancelledError)
    return logging.INFO if cancelled else logging.WARNING


def outcome_word(outcome: Outcome[Any]) -> str:
    """Return a stable word for how a call ended: `ok`, `cancelled` or the name of its error."""
    if outcome.error is None:
        return "ok"
    if isinstance(outcome.error, concurrent.futures.CancelledError):
        return "cancelled"
    return type(outcome.error).__name__


def sentence(event: GoalEvent, action_name: str, elapsed_ms: float) -> str:
    """Return a transition as a line for people."""
    attempt = f", attempt {event.attempt}" if event.attempt > 1 else ""
    detail = f": {event.detail}" if event.detail else ""
    return (
        f"{action_name} goal {event.goal_id} {event.state} after {elapsed_ms:.1f} ms{attempt}"
        f"{detail}"
    )


def outcome_sentence(outcome: Outcome[Any], action_name: str) -> str:
    """Return the end of a call as a line for people."""
    if outcome.error is None:
        attempts = f" at attempt {outcome.attempts}" if outcome.attempts > 1 else ""
        return f"{action_name} call succeeded after {outcome.elapsed * 1000:.1f} ms{attempts}"
    if isinstance(outcome.error, concurrent.futures.CancelledError):
        return f"{action_name} call cancelled: {outcome.error}"
    return f"{action_name} call failed ({outcome_word(outcome)}): {outcome.error}"
