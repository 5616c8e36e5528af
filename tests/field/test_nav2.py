"""What only Nav2's `SimpleActionServer` does, judged by its own log."""

from __future__ import annotations

from typing import Any

import pytest

from actionkit import (
    CancelReport,
    GoalAbortedError,
    GoalCanceledError,
    GoalFuture,
    GoalRejectedError,
    GoalState,
    ServerLostError,
)
from tests.field.conftest import Field
from tests.field.kinds import nav2
from tests.field.native import obey

ON_ONE = pytest.mark.field(kinds=[nav2.OWN_THREAD])  # as most of Nav2's servers are
ON_BOTH = pytest.mark.field(kinds=nav2.KINDS)


@ON_ONE
def test_a_server_that_is_deactivated_aborts_its_goal_and_rejects_others(field: Field) -> None:
    server = field.server
    future = field.running()
    server.tell("deactivate")
    assert future.outcome().status is GoalState.ABORTED
    server.wait_for("aborted")
    assert not future.known_to_run
    with pytest.raises(GoalRejectedError):
        field.client.call(field.goal("short"), timeout=20.0)
    server.wait_for("rejected")
    server.wait_for_text("SRV deactivated")
    obey(server, "activate")
    assert field.client.call_async(field.goal("short"), timeout=20.0).outcome().ok
    server.wait_for("succeeded")
    order = server.order("executing", "aborted", "rejected", "succeeded")
    assert order == ["executing", "aborted", "rejected", "executing", "succeeded"]
    field.told(nav2.DEACTIVATED, "`GoalAbortedError`, and then `GoalRejectedError`")


@ON_ONE
def test_a_goal_that_is_aborted_from_outside_has_ended_though_its_work_goes_on(
    field: Field,
) -> None:
    """Nobody but the server knows of that work; the next goal waits for its end."""
    server = field.server
    future = field.client.call_async(nav2.looks_at_nothing(25), timeout=20.0)
    server.wait_for("executing")
    server.tell("terminate_all")
    with pytest.raises(GoalAbortedError) as caught:
        future.result()
    server.wait_for("aborted")
    assert list(caught.value.result.sequence) == nav2.TERMINATED
    assert field.client.call_async(field.goal("short"), timeout=20.0).outcome().ok
    server.wait_for("work_done", 2)
    order = server.order("executing", "aborted", "work_done")
    assert order == ["executing", "aborted", "work_done", "executing", "work_done"]
    field.told(nav2.ENDED_OUTSIDE, "`GoalAbortedError`; the next goal waits for that work")


@ON_ONE
@pytest.mark.parametrize(
    ("goal", "what"),
    [(nav2.RETURNS, nav2.RETURNED), (nav2.RAISES, nav2.RAISED)],
    ids=["returns", "raises"],
)
def test_work_without_an_end_is_an_abort(goal: nav2.Goal, what: str, field: Field) -> None:
    future = field.client.call_async(goal, timeout=20.0)
    with pytest.raises(GoalAbortedError):
        future.result()
    field.server.wait_for("aborted")
    assert field.server.count("executing") == 1
    assert field.server.count("raised") == (goal == nav2.RAISES)
    field.told(what, "`GoalAbortedError`")


@ON_ONE
def test_a_goal_that_refuses_to_be_preempted_goes_on(field: Field) -> None:
    first = field.client.call_async(nav2.refuses_preemption(25), timeout=20.0)
    field.server.wait_for("executing")
    second = field.client.call_async(
        field.goal("short"), timeout=20.0, replaces=first, preempt=True
    )
    with pytest.raises(GoalAbortedError):
        second.result()
    field.server.wait_for("aborted")
    assert first.known_to_run
    assert first.outcome().ok, first.outcome().error
    field.server.wait_for("succeeded")
    order = field.server.order("executing", "aborted", "succeeded")
    assert order == ["executing", "aborted", "succeeded"]
    field.told(nav2.REFUSED, "`GoalAbortedError` for the new one; the other goes on")


@ON_ONE
def test_of_three_goals_the_one_in_the_middle_never_runs(field: Field) -> None:
    """While the first one is busy, the server keeps one more, and the last one counts."""
    first = field.client.call_async(nav2.looks_at_nothing(25), timeout=20.0)
    field.server.wait_for("executing")
    second = field.client.call_async(field.goal("long"), timeout=20.0)
    assert second.wait_accepted(20.0)
    third = field.client.call_async(field.goal("short"), timeout=20.0)
    with pytest.raises(GoalAbortedError):
        second.result()
    field.server.wait_for("aborted")
    assert first.outcome().ok
    assert third.outcome().ok
    field.server.wait_for("succeeded", 2)
    assert field.server.order("executing", "succeeded") == ["executing", "succeeded"] * 2
    field.told(nav2.THREE, "`GoalAbortedError` for the first of them, which never ran")


@ON_ONE
def test_a_cancel_of_a_goal_that_waits_is_confirmed_when_the_server_looks_at_it(
    field: Field,
) -> None:
    first = field.client.call_async(nav2.looks_at_nothing(25), timeout=20.0)
    field.server.wait_for("executing")
    second = field.client.call_async(field.goal("long"), timeout=20.0)
    assert second.wait_accepted(20.0)
    second.cancel()
    outcome = second.outcome()
    field.server.wait_for("canceled")
    assert (outcome.status, outcome.cancel) == (GoalState.CANCELED, CancelReport.CONFIRMED)
    assert first.outcome().ok
    order = field.server.order("executing", "succeeded", "canceled")
    assert order == ["executing", "succeeded", "executing", "canceled"]
    field.told(nav2.WAITED, "`CONFIRMED`, when the server looks at it")


def _another_waits(field: Field) -> tuple[GoalFuture[Any, Any], GoalFuture[Any, Any]]:
    """Send two goals; the server will look at the second one some 0.1 s later."""
    first = field.running()
    next(iter(first.feedback()))
    second = field.client.call_async(field.goal("long"), timeout=60.0)
    assert second.wait_accepted(20.0)
    return first, second


@ON_ONE
def test_a_cancel_of_a_goal_that_waits_to_preempt_another_ends_both(field: Field) -> None:
    events = ("executing", "aborted", "canceled")
    for tried in range(1, 11):
        first, second = _another_waits(field)
        second.cancel()
        field.server.wait_for("canceled", tried)
        ended = first.outcome().status, second.outcome().status
        if field.server.order(*events)[-3:] == [*events]:  # it was in time: the second never ran
            break
    assert field.server.order(*events)[-3:] == [*events]
    assert ended == (GoalState.ABORTED, GoalState.CANCELED)
    field.told(nav2.BOTH_END, "`GoalAbortedError` for the other; the server aborts it, too")


@ON_ONE
def test_a_cancel_that_crosses_a_preemption_ends_as_the_server_says(field: Field) -> None:
    crossed = ["cancel_requested", "aborted", "executing", "cancel_requested", "canceled"]
    events = ("cancel_requested", "aborted", "executing", "canceled")
    for _ in range(1, 11):
        first, second = _another_waits(field)
        first.cancel()
        outcome = first.outcome()
        already = field.server.count("canceled")
        second.cancel()
        assert second.outcome().status is GoalState.CANCELED
        field.server.wait_for("canceled", already + 1)
        if field.server.order(*events)[-5:] == crossed:
            break
    assert field.server.order(*events)[-5:] == crossed, field.server.log
    assert (outcome.status, outcome.cancel) == (GoalState.ABORTED, CancelReport.CONFIRMED)
    assert not first.known_to_run
    field.told(nav2.CROSSED, "`GoalAbortedError`, and `CONFIRMED`")


@ON_BOTH
def test_a_server_that_is_destroyed_ends_the_call(field: Field) -> None:
    """It drops the goal. If it still has its endpoints then, rclpy's clients are told CANCELED."""
    future = field.client.call_async(nav2.WORKS, timeout=60.0)
    field.server.wait_for("executing")
    field.server.tell("destroy")
    with pytest.raises((ServerLostError, GoalCanceledError)) as caught:
        future.result(12.0)  # and not only after 20 s, as for a process that was killed
    is_lost = isinstance(caught.value, ServerLostError)
    assert future.known_to_run is (None if is_lost else False)
    assert field.server.count("executing") == 1
    field.told(nav2.DESTROYED, "`ServerLostError`, or `GoalCanceledError`")
