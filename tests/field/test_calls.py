"""Calls to servers of the field, judged by the servers' own logs. Contract C13.3."""

from __future__ import annotations

from typing import Any

import pytest

from actionkit import (
    CancelReport,
    DeadlineExceededError,
    GoalAbortedError,
    GoalRejectedError,
    GoalState,
    ResultLostError,
    ServerLostError,
    Timeouts,
)
from tests.field.conftest import Field
from tests.field.kind import Kind
from tests.waiting import until


def has(*goals: str) -> Any:
    """Return whether a server can do all of this."""
    return lambda kind: {*goals} <= {*kind.goals}


@pytest.mark.field("Result", can=has("short"))
def test_a_goal_succeeds_with_feedback(field: Field) -> None:
    feedback: list[Any] = []
    outcome = field.client.call_async(
        field.goal("short"), on_feedback=feedback.append, timeout=20.0
    ).outcome()
    ended = field.server.wait_for("succeeded")
    assert outcome.ok, outcome.error
    assert field.server.count("executing") == 1
    assert feedback
    if "short" in field.kind.results:
        assert outcome.result is not None
        assert list(outcome.result.sequence) == field.kind.results["short"]
    if "result" in ended.groupdict():
        assert outcome.result is not None
        assert list(outcome.result.sequence) == [int(n) for n in ended["result"].split(",")]


@pytest.mark.field("Abort", can=has("aborts"))
def test_an_abort_is_an_error_with_the_result(field: Field) -> None:
    with pytest.raises(GoalAbortedError) as caught:
        field.client.call(field.goal("aborts"), timeout=20.0)
    field.server.wait_for("aborted")
    assert field.server.count("executing") == 1  # it is not tried again
    assert list(caught.value.result.sequence) == field.kind.results["aborts"]


@pytest.mark.field("Rejection", can=has("rejected"))
def test_a_rejected_goal_is_an_error(field: Field) -> None:
    with pytest.raises(GoalRejectedError):
        field.client.call(field.goal("rejected"), timeout=20.0)
    if "rejected" in field.kind.log:
        field.server.wait_for("rejected")
    field.client.call(field.goal("short"), timeout=20.0)
    field.server.wait_for("succeeded")
    assert field.server.count("executing") == 1  # the second


@pytest.mark.field("Deadline")
def test_a_deadline_cancels_the_goal(field: Field) -> None:
    with pytest.raises(DeadlineExceededError) as caught:
        field.client.call(field.goal("long"), timeout=1.0)
    field.server.wait_for("canceled")
    assert caught.value.cancel is CancelReport.CONFIRMED


@pytest.mark.field("A second goal")
def test_a_second_goal_while_one_runs(field: Field) -> None:
    """Each call ends as the server's log says, whatever the server does with two goals."""
    server, kind = field.server, field.kind
    first = field.accepted() if kind.second == "crashes" else field.running()
    second = field.client.call_async(field.goal("short"), timeout=20.0)
    if kind.second == "queues it":
        assert second.wait_accepted(20.0)
    if kind.second == "preempts":
        assert second.outcome().ok
        server.wait_for("succeeded")
        ended = first.outcome().status
        assert ended in (GoalState.ABORTED, GoalState.CANCELED)
        server.wait_for(ended.name.lower())
    if kind.second == "runs both":
        assert second.outcome().ok
        server.wait_for("succeeded")
        assert not server.count("canceled")
    if kind.second == "crashes":
        server.wait_for_text("Traceback")
        with pytest.raises(ServerLostError):
            first.result()
        assert (server.count("executing"), server.count("succeeded")) == (1, 1)  # the second
        # It crashes just after it has ended that one, and may not have sent the result.
        assert second.outcome().ok or isinstance(second.outcome().error, ResultLostError)
    elif kind.second != "preempts":
        first.cancel()
        assert first.outcome().status is GoalState.CANCELED
        server.wait_for("canceled")
    if kind.second == "queues it":
        assert second.outcome().ok
        order = server.order("executing", "canceled", "succeeded")
        assert order == ["executing", "canceled", "executing", "succeeded"]
    field.saw(kind.second)


@pytest.mark.field("`replaces=`")
def test_the_earlier_goal_has_stopped_before_another_is_sent(field: Field) -> None:
    first = field.running()
    second = field.client.call_async(field.goal("short"), timeout=20.0, replaces=first)
    assert second.outcome().ok
    field.server.wait_for("succeeded")
    order = field.server.order("executing", "canceled", "succeeded")
    assert order == ["executing", "canceled", "executing", "succeeded"]
    assert first.outcome().status is GoalState.CANCELED


def _takes_two(kind: Kind) -> bool:
    return kind.second in ("preempts", "runs both")


@pytest.mark.field("`preempt=True`", can=_takes_two)
def test_the_server_preempts_the_earlier_goal(field: Field) -> None:
    """If it runs both instead, the first call goes on, and can be cancelled."""
    first = field.running()
    second = field.client.call_async(
        field.goal("short"), timeout=20.0, replaces=first, preempt=True
    )
    assert second.outcome().ok
    field.server.wait_for("succeeded")
    if field.kind.second == "preempts":
        assert first.outcome().status is GoalState.REPLACED
        assert until(lambda: not first.known_to_run)
        return
    assert first.known_to_run
    first.cancel()
    assert first.outcome().status is GoalState.REPLACED
    field.server.wait_for("canceled")
    assert not first.known_to_run
    field.saw("both run, the first call goes on")


@pytest.mark.field("Killed, restarted")
def test_a_goal_of_a_killed_server_is_not_sent_again(field: Field) -> None:
    client = field.another_client(timeouts=Timeouts(server=30.0))
    future = client.call_async(field.goal("long"), timeout=60.0)
    field.server.wait_for("executing")
    field.server.kill()
    field.server.start()
    with pytest.raises(ServerLostError):
        future.result()
    client.call(field.goal("short"), timeout=40.0)
    field.server.wait_for("succeeded")
    assert field.server.count("executing") == 2  # the first, and the last
