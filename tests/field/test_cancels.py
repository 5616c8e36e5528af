"""Goals of servers of the field are cancelled in each way. Contract C13.3.

What is expected comes from the servers' own logs.
"""

from __future__ import annotations

import pytest

from actionkit import CancelReport, GoalState, Timeouts
from tests.field.conftest import Field
from tests.field.kind import Kind
from tests.field.test_calls import has
from tests.waiting import until


def _has_status(kind: Kind) -> bool:
    return kind.has_status and "long" in kind.goals


@pytest.mark.field("Cancel")
def test_a_cancel_is_honoured(field: Field) -> None:
    future = field.running()
    future.cancel()
    outcome = future.outcome()
    field.server.wait_for("canceled")
    assert (outcome.status, outcome.cancel) == (GoalState.CANCELED, CancelReport.CONFIRMED)
    assert not future.known_to_run


@pytest.mark.field("At once")
def test_a_goal_is_cancelled_as_soon_as_it_is_accepted(field: Field) -> None:
    future = field.client.call_async(field.goal("long"), timeout=60.0)
    future.wait_accepted()
    future.cancel()
    outcome = future.outcome()
    assert (outcome.status, outcome.cancel) == (GoalState.CANCELED, CancelReport.CONFIRMED)
    # Whether its work had begun or not: nothing of it runs, and the next goal does.
    assert field.client.call_async(field.goal("short"), timeout=20.0).outcome().ok
    field.server.wait_for("succeeded")
    ended = field.server.count("canceled")
    assert field.server.count("executing") == ended + 1


@pytest.mark.field("Ignored", can=has("ignores"))
def test_a_goal_that_ignores_its_cancel_is_told(field: Field) -> None:
    client = field.another_client(timeouts=Timeouts(server=30.0, cancel=0.3))
    future = client.call_async(field.goal("ignores"), timeout=60.0)
    field.server.wait_for("executing")
    future.cancel()
    outcome = future.outcome()
    assert not field.server.count("succeeded")
    assert outcome.cancel is CancelReport.UNKNOWN
    assert future.known_to_run
    field.server.wait_for("succeeded")
    assert until(lambda: not future.known_to_run)


@pytest.mark.field("`attach`, its cancel", can=_has_status)
def test_a_goal_of_another_client_is_followed_and_cancelled(field: Field) -> None:
    future = field.running()
    other = field.another_client()
    attached = other.attach(future.goal_id, timeout=60.0)
    next(iter(attached.feedback()))
    attached.cancel()
    for each in (attached, future):
        outcome = each.outcome()
        assert outcome.status is GoalState.CANCELED, outcome.error
    field.server.wait_for("canceled")


@pytest.mark.field("`cancel_everything`", can=_has_status)
def test_everything_is_cancelled(field: Field) -> None:
    future = field.running()
    told = field.another_client().cancel_everything()
    assert told == {future.goal_id: CancelReport.CONFIRMED}
    field.server.wait_for("canceled")
    assert future.outcome().status is GoalState.CANCELED


@pytest.mark.field("`actionkit cancel`")
def test_the_command_cancel(field: Field) -> None:
    future = field.running()
    said = field.command("cancel", field.kind.action_name, str(future.goal_id))
    field.server.wait_for("canceled")
    assert said.code == 0, said
    assert future.outcome().status is GoalState.CANCELED


@pytest.mark.field("`actionkit stop`", can=_has_status)
def test_the_command_stop(field: Field) -> None:
    future = field.running()
    said = field.command("stop", "--timeout", "8")
    field.server.wait_for("canceled")
    assert said.code == 0, said
    assert future.outcome().status is GoalState.CANCELED
    assert field.command("stop", "--release").code == 0


@pytest.mark.field("`watch`, `doctor`", can=_has_status)
def test_the_commands_that_look(field: Field) -> None:
    future = field.running()
    watched = field.command("watch", field.kind.action_name, "--once")
    assert watched.code == 0, watched
    [line] = [line for line in watched.out.splitlines() if str(future.goal_id)[:8] in line]
    assert "EXECUTING" in line or "ACCEPTED" in line, watched
    seen = field.command("doctor", field.kind.action_name)
    assert seen.code == 0, seen
    assert not field.server.count("canceled")  # to look is harmless
    future.cancel()
