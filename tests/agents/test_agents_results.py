"""The results for a model of goals that ended while they were being cancelled."""

from __future__ import annotations

import asyncio
import uuid
from concurrent.futures import CancelledError
from contextlib import nullcontext
from dataclasses import asdict
from types import SimpleNamespace
from typing import Any

import pytest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from test_msgs.action import Fibonacci

from actionkit import (
    ActionKitError,
    CancelReport,
    DeadlineExceededError,
    FeedbackStalledError,
    GoalAbortedError,
    GoalFate,
    GoalRejectedError,
    GoalReport,
    GoalState,
    Outcome,
    ServerLostError,
)
from actionkit._calls.futures.call_view import GoalsOfCall
from actionkit._goal.facts import GoalFacts
from actionkit.agents._answers.results import goal_value
from actionkit.agents._tool_calls.goal_call import _ask, _Refused, question_of
from actionkit.agents._tool_calls.goals import Goals, ToolGoal


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
    return asdict(goal_value("count", outcome, None, why))


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


def record_of(status: GoalState) -> tuple[ToolGoal, uuid.UUID, uuid.UUID]:
    """Return the record of a call that lost its first goal, and its two ids."""
    first, second = uuid.uuid4(), uuid.uuid4()
    future: Any = Future(first, second, status)
    record = ToolGoal("count")
    record.follow(future)
    return record, first, second


class Future:
    """Stands in for a call that sent a second goal in place of the first one."""

    latest_feedback = None

    def __init__(self, first: uuid.UUID, second: uuid.UUID, status: GoalState) -> None:
        self.facts = [GoalFacts(one, accepted=True) for one in (first, second)]
        self._call = SimpleNamespace(goals=GoalsOfCall(self.facts))
        self.goal_id = first
        self.state = status
        self._second = second

    def add_done_callback(self, callback: Any) -> None:
        self.goal_id = self._second
        self.callback = callback

    def outcome(self, timeout: float) -> Any:
        return Outcome(
            status=self.state,
            result=None,
            error=DeadlineExceededError("too late"),
            attempts=2,
            timeline=(),  # type: ignore[arg-type]
            goal_id=self.goal_id,
            cancel=CancelReport.UNKNOWN,
            goals=self._call.goals.reports,
        )


def test_a_goal_is_found_by_the_id_of_every_attempt() -> None:
    record, first, second = record_of(GoalState.EXECUTING)
    goals = Goals()
    assert goals.add(record, 1)
    for goal_id in (first, second):
        (report,) = goals.reports(str(goal_id))
        assert report["goal_id"] == str(second)
    assert goals.reports(str(uuid.uuid4())) == ()


def test_what_was_given_up_before_is_not_told_of_as_cancelled_later() -> None:
    record, _, _ = record_of(GoalState.EXECUTING)
    future: Any = record._future
    future.callback(future)
    record.cancel("all goals were cancelled")
    assert record.counts
    assert record.report()["why_cancelled"] is None


@pytest.mark.parametrize("last", [False, True])
def test_one_counts_while_a_goal_may_run_whose_server_has_not_left(last: bool) -> None:
    record, _, _ = record_of(GoalState.EXECUTING)
    future: Any = record._future
    future.callback(future)
    other, facts = future.facts if last else future.facts[::-1]
    other.lost = other.servers_gone = True
    assert record.counts
    other.ended = other.over = True
    assert record.counts
    facts.lost = True  # its server is only silent
    assert record.counts
    assert record.report()["may_still_run"]
    facts.servers_gone = True
    assert not record.counts
    assert record.report()["may_still_run"]
    facts.servers_gone = facts.lost = False  # it is back
    assert record.counts
    facts.ended = facts.over = True
    assert not record.counts
    assert not record.report()["may_still_run"]


def test_an_earlier_goal_that_may_run_is_told_of_where_the_last_one_has_ended() -> None:
    earlier, last = (
        GoalReport(uuid.uuid4(), GoalFate.LOST),
        GoalReport(uuid.uuid4(), GoalFate.ENDED),
    )
    outcome: Outcome[Any] = Outcome(
        status=GoalState.ABORTED,
        result=None,
        error=GoalAbortedError("it gave up"),
        attempts=2,
        timeline=(),  # type: ignore[arg-type]
        goal_id=last.goal_id,
        cancel=CancelReport.UNKNOWN,
        goals=(earlier, last),
    )
    told = asdict(goal_value("count", outcome, None, ""))
    assert (told["status"], told["may_still_run"]) == ("aborted", True)


@pytest.mark.parametrize(
    ("fate", "error", "retry"),
    [
        (GoalFate.ENDED, ServerLostError, True),
        (GoalFate.LOST, ServerLostError, False),
        (GoalFate.REJECTED, GoalRejectedError, False),
    ],
)
@pytest.mark.every
def test_what_may_run_or_cannot_succeed_is_not_to_be_tried_again(
    fate: GoalFate, error: type[ActionKitError], retry: bool
) -> None:
    goal = GoalReport(uuid.uuid4(), fate)
    outcome: Outcome[Any] = Outcome(
        status=GoalState.REJECTED if error is GoalRejectedError else GoalState.LOST,
        result=None,
        error=error("for the test"),
        attempts=1,
        timeline=(),  # type: ignore[arg-type]
        goal_id=goal.goal_id,
        cancel=CancelReport.UNKNOWN,
        goals=(goal,),
    )
    told = asdict(goal_value("count", outcome, None, ""))
    assert told["may_still_run"] == (fate is GoalFate.LOST)
    assert told["error"]["retry"] == retry


@pytest.mark.parametrize(("answer", "sends"), [(True, True), (False, False), ("yes", False)])
@pytest.mark.every
def test_nothing_but_true_is_an_approval(answer: Any, sends: bool) -> None:
    async def approve(request: Any) -> Any:
        return answer

    tool: Any = SimpleNamespace(name="count", action="/fibonacci")
    with nullcontext() if sends else pytest.raises(_Refused, match="did not approve"):
        asyncio.run(_ask(tool, Fibonacci.Goal(), approve))


def test_what_is_stopped_while_its_goal_is_handed_over_is_cancelled() -> None:
    """By another thread, as a human's stop is."""
    record, future = ToolGoal("count"), Future(uuid.uuid4(), uuid.uuid4(), GoalState.SENDING)
    asked: list[str] = []
    future.cancel = lambda: asked.append("cancel")  # type: ignore[attr-defined]
    record.cancel("a human stopped it")
    record.follow(future)  # type: ignore[arg-type]
    assert asked == ["cancel"]


def test_no_goal_is_added_beyond_the_limit_of_its_action() -> None:
    goals = Goals()
    assert [goals.add(ToolGoal(tool, "/a"), 2) for tool in "xyz"] == [True, True, False]
    assert goals.add(ToolGoal("x", "/b"), 2)
    assert len(goals.latest()) == 3


def test_a_human_is_shown_every_field_of_what_they_approve() -> None:
    goal = PoseStamped()
    goal.header.frame_id = "map\u202edab" + "a" * 10_000
    goal.pose.position.x = 7.5
    question = question_of(goal)
    assert len(question) < 4100
    assert "\u202e" not in question
    assert "map\\u202edab" in question
    assert "more characters" in question
    assert '"x": 7.5' in question
    path = question_of(Path(poses=[PoseStamped() for _ in range(1000)]))
    assert len(path) < 4100
    assert "more" in path
