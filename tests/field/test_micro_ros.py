"""What is different with micro-ROS' servers: no status, one result, no cancel of all goals."""

from __future__ import annotations

import uuid
from pathlib import Path
from typing import Any

import pytest

from actionkit import (
    AcceptanceTimeoutError,
    CancelReport,
    DeadlineExceededError,
    GoalFuture,
    GoalState,
    Timeouts,
)
from tests.docs.snippets import ROOT, run_page
from tests.field.conftest import Field
from tests.field.kind import Kind
from tests.field.kinds.micro_ros import ATTACHED, CANCELLED_EARLY, FULL, KINDS
from tests.waiting import until

_PLACES = 10
"""How many goals the server has room for."""
_GUIDE = ROOT / "docs" / "guides" / "micro-ros.md"
_NOT_ALL = "cannot, or will not, cancel all goals (return code 2"


def _is_micro_ros(kind: Kind) -> bool:
    return kind in KINDS


def _cancel_by_id(field: Field, future: GoalFuture[Any, Any]) -> None:
    """Cancel the goal from outside in the way that is left; its own client gets the result."""
    assert not field.server.count("canceled")
    said = field.command("cancel", field.kind.action_name, str(future.goal_id))
    field.server.wait_for("canceled")
    assert said.code == 0, said
    assert future.outcome().status is GoalState.CANCELED


@pytest.mark.field("`attach`, its cancel", can=_is_micro_ros)
def test_its_own_client_gets_no_result_after_another_has_attached(field: Field) -> None:
    future = field.running(timeout=12.0)
    attached = field.another_client().attach(future.goal_id, timeout=60.0)
    next(iter(attached.feedback()))
    attached.cancel()
    outcome = attached.outcome()
    field.server.wait_for("canceled")
    assert (outcome.status, outcome.cancel) == (GoalState.CANCELED, CancelReport.CONFIRMED)
    assert not future.done()
    with pytest.raises(DeadlineExceededError) as caught:
        future.result()
    assert caught.value.cancel is CancelReport.NOT_NEEDED
    assert future.known_to_run is False
    field.saw("yes, its own call gets no result")
    field.told(ATTACHED, "`DeadlineExceededError`, and that the goal has ended")


@pytest.mark.field("`cancel_everything`", can=_is_micro_ros)
def test_not_everything_is_cancelled(field: Field) -> None:
    future = field.running()
    told = field.another_client().cancel_everything()
    assert told == {uuid.UUID(int=0): CancelReport.UNKNOWN}
    assert field.client.cancel_everything() == {
        uuid.UUID(int=0): CancelReport.UNKNOWN,
        future.goal_id: CancelReport.CONFIRMED,  # its own client knows the goal
    }
    field.server.wait_for("canceled")
    field.saw("`UNKNOWN`, except from the client that sent it")


@pytest.mark.field("`actionkit stop`", can=_is_micro_ros)
def test_the_command_stop_says_what_it_cannot_stop(field: Field) -> None:
    future = field.running()
    for command in (("stop", "--timeout", "8"), ("cancel", field.kind.action_name, "--all")):
        said = field.command(*command)
        assert said.code == 23, said
        assert _NOT_ALL in said.out + said.err, said
        assert "cancel each by its id. GOALS MAY STILL BE RUNNING." in said.out + said.err, said
    _cancel_by_id(field, future)
    assert field.command("stop", "--release").code == 0
    field.saw("`UNKNOWN`")


@pytest.mark.field("`watch`, `doctor`", can=_is_micro_ros)
def test_the_commands_that_look_say_that_there_is_no_status(field: Field) -> None:
    future = field.running()
    for command in (
        ("watch", field.kind.action_name, "--once"),
        ("cancel", field.kind.action_name),
    ):
        said = field.command(*command)
        assert said.code == 0, said
        assert "No goal is known: no status has come from the server." in said.out, said
        assert "it may be running some" in said.out, said
    seen = field.command("doctor", field.kind.action_name)
    assert seen.code == 0, seen
    _cancel_by_id(field, future)
    field.saw("say that no status came")


@pytest.mark.field(can=_is_micro_ros)
def test_goals_that_are_cancelled_while_they_are_accepted_run_no_more(field: Field) -> None:
    def cancelled() -> GoalFuture[Any, Any]:
        future = field.client.call_async(field.goal("long"), timeout=60.0)
        assert until(lambda: any(event.state is GoalState.SENT for event in future.timeline))
        future.cancel()
        return future

    for future in [cancelled() for _ in range(_PLACES)]:
        outcome = future.outcome()
        assert (outcome.status, outcome.cancel) == (GoalState.CANCELED, CancelReport.CONFIRMED)
    field.server.wait_for("executing", _PLACES)
    field.server.wait_for("canceled", _PLACES)
    field.told(CANCELLED_EARLY, "`CONFIRMED`: it has asked again")


@pytest.mark.field(can=_is_micro_ros)
def test_a_goal_that_waited_for_a_place_is_cancelled_when_it_gets_one(field: Field) -> None:
    running = [field.running() for _ in range(_PLACES)]
    client = field.another_client(timeouts=Timeouts(server=30.0, accept=1.0))
    waiting = client.call_async(field.goal("long"), timeout=60.0)
    with pytest.raises(AcceptanceTimeoutError) as caught:
        waiting.result()
    assert caught.value.cancel is CancelReport.UNKNOWN
    assert field.server.count("executing") == _PLACES
    for future in running:
        future.cancel()
    assert all(future.outcome().cancel is CancelReport.CONFIRMED for future in running)
    field.server.wait_for("executing", _PLACES + 1)
    field.server.wait_for("canceled", _PLACES + 1)
    assert until(lambda: waiting.known_to_run is False)
    field.told(FULL, "nothing until it is accepted, or `AcceptanceTimeoutError`")


@pytest.mark.field(can=_is_micro_ros)
def test_the_guide(field: Field, tmp_path: Path) -> None:
    run_page(_GUIDE, tmp_path)
    field.server.wait_for("canceled")
