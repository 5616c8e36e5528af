"""What only joint_trajectory_controller does with its goals, judged by its own log."""

from __future__ import annotations

import pytest

from actionkit import (
    ActionKitError,
    CancelReport,
    GoalAbortedError,
    GoalRejectedError,
    GoalState,
    Timeouts,
)
from tests.field.conftest import Field
from tests.field.kinds import ros2_control
from tests.field.native import obey
from tests.waiting import until

ON_IT = pytest.mark.field(kinds=[ros2_control.CONTROLLER])


@ON_IT
def test_a_controller_that_is_deactivated_aborts_its_goal_and_rejects_others(field: Field) -> None:
    server = field.server
    future = field.running()
    server.tell("deactivate")
    with pytest.raises(GoalAbortedError) as caught:
        future.result()
    assert list(caught.value.result.sequence) == ros2_control.DEACTIVATED
    with pytest.raises(GoalRejectedError):
        field.client.call(field.goal("short"), timeout=20.0)
    server.wait_for_text("SRV reject: not running")
    obey(server, "activate")
    assert field.client.call_async(field.goal("short"), timeout=20.0).outcome().ok
    server.wait_for("succeeded")
    assert server.order("executing", "aborted", "succeeded") == [
        *("executing", "aborted"),
        *("executing", "succeeded"),
    ]
    field.told(ros2_control.STOPPED, "`GoalAbortedError`, and then `GoalRejectedError`")


@ON_IT
def test_of_three_goals_at_once_the_last_one_is_run(field: Field) -> None:
    futures = [field.client.call_async(field.goal("long"), timeout=20.0) for _ in range(2)]
    assert field.client.call_async(field.goal("short"), timeout=20.0).outcome().ok
    field.server.wait_for("succeeded")
    assert [future.outcome().status for future in futures] == [GoalState.ABORTED] * 2
    field.server.wait_for("aborted", 2)
    field.told(ros2_control.THREE, "`GoalAbortedError` for the first two")


@ON_IT
def test_a_cancel_just_after_the_success_leaves_a_goal_that_the_next_one_ends(
    field: Field,
) -> None:
    """The controller accepts the cancel, and then tells neither success nor end."""
    server = field.server
    client = field.another_client(timeouts=Timeouts(server=30.0, cancel=0.5))
    for tried in range(1, 31):
        future = client.call_async(ros2_control.RACE, timeout=20.0)
        server.wait_for("succeeded", tried)
        future.cancel()
        outcome = future.outcome()
        if not outcome.ok:
            break
    assert server.order("succeeded", "cancel_requested")[-2:] == ["succeeded", "cancel_requested"]
    server.wait_for_text("SRV cancel request, active=no")
    assert (outcome.status, outcome.cancel) == (GoalState.TIMED_OUT, CancelReport.UNKNOWN)
    assert future.known_to_run

    said = field.command("cancel", field.kind.action_name, "--all", "--timeout", "1")
    assert said.code == 23, said
    assert "MAY STILL BE RUNNING" in said.out
    with pytest.raises(ActionKitError, match="was not sent"):
        client.call(field.goal("short"), replaces=future, timeout=20.0)
    assert server.count("executing") == tried

    following = client.call_async(field.goal("short"), replaces=future, preempt=True, timeout=20.0)
    assert following.outcome().ok
    server.wait_for("succeeded", tried + 1)
    assert until(lambda: future.known_to_run is False)
    field.told(ros2_control.STUCK, "`UNKNOWN`, and that it MAY STILL BE RUNNING")


@pytest.mark.field(kinds=[ros2_control.OLDER])
def test_an_older_controller_drops_a_preempted_goal_at_the_end_of_the_next_one_at_the_latest(
    field: Field,
) -> None:
    first = field.running()
    second = field.client.call_async(
        field.goal("short"), replaces=first, preempt=True, timeout=20.0
    )
    assert second.outcome().ok
    field.server.wait_for("succeeded")
    outcome = first.outcome()
    assert (outcome.status, outcome.cancel) == (GoalState.REPLACED, CancelReport.CONFIRMED)
    assert not first.known_to_run
