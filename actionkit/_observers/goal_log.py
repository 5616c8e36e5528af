"""Writes each transition as one record of the standard library's logging (C6.2)."""

from __future__ import annotations

import logging
from typing import Any

from actionkit._model.values import CancelReport, GoalEvent, GoalState, Outcome
from actionkit._observers.protocol import CallInfo
from actionkit._observers.words import (
    LEVELS,
    level_of,
    level_of_outcome,
    outcome_sentence,
    outcome_word,
    sentence,
)
from actionkit._threads.diagnostics import dated, is_enabled_for

logger = logging.getLogger("actionkit.goal")
logger.addHandler(logging.NullHandler())  # silent if the user has not set up logging


class GoalLog:
    """Writes to the logger `actionkit.goal`; every record has the same extra fields."""

    def __repr__(self) -> str:
        return "the log 'actionkit.goal'"

    def wants(self, event: GoalEvent) -> bool:
        """Whether the logger writes this transition."""
        return is_enabled_for(logger, level_of(event))

    def wants_feedback(self) -> bool:
        """Whether the logger writes feedback messages."""
        return is_enabled_for(logger, LEVELS[GoalState.FEEDBACK])

    def wants_outcome(self, outcome: Outcome[Any]) -> bool:
        """Whether the logger writes the end of this call."""
        return is_enabled_for(logger, level_of_outcome(outcome))

    def on_event(self, event: GoalEvent, call: CallInfo) -> None:
        """Write a transition."""
        elapsed_ms = call.elapsed_ms(event)
        _write(
            level_of(event),
            sentence(event, call.action_name, elapsed_ms),
            event.wall,
            call,
            kind="event",
            goal_id=str(event.goal_id),
            attempt=event.attempt,
            state=event.state.value,
            elapsed_ms=elapsed_ms,
            detail=event.detail,
            cancel_refused=event.cancel_refused,
            outcome="",
        )

    def on_outcome(self, outcome: Outcome[Any], call: CallInfo) -> None:
        """Write the end of a call."""
        _write(
            level_of_outcome(outcome),
            outcome_sentence(outcome, call.action_name),
            call.wall + outcome.elapsed,
            call,
            kind="outcome",
            goal_id=str(outcome.goal_id),
            attempt=outcome.attempts,
            state=outcome.status.value,
            elapsed_ms=round(outcome.elapsed * 1000, 3),
            detail="" if outcome.error is None else str(outcome.error),
            cancel_refused=outcome.cancel is CancelReport.REFUSED,
            outcome=outcome_word(outcome),
        )


def _write(level: int, text: str, wall: float, call: CallInfo, **fields: object) -> None:
    if not logger.isEnabledFor(level):
        return
    extra = {
        "call_id": str(call.call_id),
        "action_name": call.action_name,
        "action_type": call.action_type,
        "node_name": call.node_name,
        **fields,
    }
    where = f"[{call.node_name}] " if call.node_name else ""
    record = logger.makeRecord(
        logger.name, level, __file__, 0, "%s%s", (where, text), None, extra=extra
    )
    logger.handle(dated(record, wall))
