"""What a model is told of goals that ended while they were being cancelled."""

from __future__ import annotations

import uuid
from concurrent.futures import CancelledError
from typing import Any

import pytest
from test_msgs.action import Fibonacci

from actionkit import CancelReport, DeadlineExceededError, FeedbackStalledError, GoalState, Outcome
from actionkit.agents._results import goal_value


def value(status: GoalState, error: BaseException, why: str, result: Any) -> dict[str, Any]:
    outcome = Outcome(
        status=status,
        result=result,
        error=error,
        attempts=1,
        timeline=(),  # type: ignore[arg-type]
        goal_id=uuid.uuid4(),
        cancel=CancelReport.CONFIRMED,
    )
    return goal_value("count", outcome, None, why)


@pytest.mark.parametrize("error", [DeadlineExceededError, FeedbackStalledError, CancelledError])
def test_what_succeeded_while_it_was_being_cancelled_has_succeeded(
    error: type[BaseException],
) -> None:
    why = "its caller gave up" if error is CancelledError else ""
    told = value(GoalState.SUCCEEDED, error("too late"), why, Fibonacci.Result(sequence=[1]))
    assert (told["status"], told["error"]) == ("succeeded", None)
    assert told["result"] == {"sequence": [1]}


def test_what_aborted_while_it_was_being_cancelled_has_aborted() -> None:
    told = value(GoalState.ABORTED, CancelledError(), "a human stopped it", Fibonacci.Result())
    assert told["status"] == "aborted"
    assert "a human stopped it" in told["error"]["message"]
    assert not told["may_still_run"]


def test_what_was_rejected_while_it_was_being_cancelled_never_ran() -> None:
    told = value(GoalState.REJECTED, CancelledError(), "a human stopped it", None)
    assert told["status"] == "canceled"
    assert told["error"]["message"] == "a human stopped it"
