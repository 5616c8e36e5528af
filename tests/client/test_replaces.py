"""Replacing the goal of an earlier call (C1.15)."""

from __future__ import annotations

import concurrent.futures
import logging

import pytest

import actionkit as ak
from actionkit import CancelReport, GoalFate, GoalState, RetryPolicy, Timeouts, retry_aborted
from tests.conftest import runs_nothing
from tests.waiting import until

LONG = {"order": 100}
PATIENT = Timeouts(server=30.0, cancel=20.0)


def running(server, client, **settings):
    future = client.call_async(LONG, **settings)
    server.wait_for("executing", goal_id=str(future.goal_id))
    return future


def test_the_new_goal_is_sent_when_the_earlier_one_has_stopped(action_server, make_client):
    server = action_server("slow_cancel", gate=1)
    client = make_client(timeouts=PATIENT)
    first = running(server, client)
    second = client.call_async({"order": 100}, replaces=first)
    server.wait_for("cancel_accepted", goal_id=str(first.goal_id))
    assert second.state is GoalState.SENDING
    assert server.count("goal_received") == 1
    server.release()
    server.wait_for("executing", goal_id=str(second.goal_id))
    assert first.outcome(20).status is GoalState.CANCELED
    assert first.cancelled()
    assert server.max_running == 1
    second.cancel()
    second.outcome(20)


def test_a_blocking_call_replaces(action_server, make_client):
    server = action_server("fibonacci", period=0.05)
    client = make_client()
    first = running(server, client)
    assert len(client.call({"order": 3}, 20, replaces=first).sequence) == 4
    assert first.outcome(0).cancel is CancelReport.CONFIRMED
    # One that is over is nothing to wait for.
    assert len(client.call({"order": 3}, 20, replaces=first).sequence) == 4
    assert server.max_running == 1


def test_nothing_is_sent_if_the_server_refuses_to_stop(action_server, make_client):
    server = action_server("refuses_cancel", period=0.1)
    client = make_client(timeouts=Timeouts(server=30.0, cancel=1.0))
    first = running(server, client)
    with pytest.raises(ak.GoalNotReplacedError) as caught:
        client.call({"order": 1}, replaces=first)
    error = caught.value
    (earlier,) = error.earlier
    assert (earlier.goal_id, earlier.fate) == (first.goal_id, GoalFate.RUNNING)
    assert earlier.cancel_refused
    assert error.cancel is CancelReport.NOT_NEEDED
    kept = f"goal {first.goal_id} MAY STILL BE RUNNING (the server refused to cancel it)"
    assert f"was not sent. It was to replace an earlier goal, and {kept}, 1 s after" in str(error)
    assert server.count("goal_received") == 1
    assert not first.done()


def test_nothing_is_sent_if_the_earlier_goal_was_lost(action_server, make_client):
    server = action_server("never_finishes")
    client = make_client(timeouts=Timeouts(server=30.0, cancel=0.3), retry=RetryPolicy.none())
    first = running(server, client)
    server.kill()
    for _ in range(2):
        with pytest.raises(ak.GoalNotReplacedError, match=r"MAY STILL BE RUNNING \(the server "):
            client.call(LONG, 5.0, replaces=first)
        first.outcome(20)  # now its call is over, and its goal may run


def test_a_goal_that_was_not_sent_never_is(action_server, make_client):
    client = make_client(timeouts=PATIENT)
    first = client.call_async(LONG)
    second = client.call_async({"order": 1}, replaces=first)
    server = action_server("fibonacci")
    assert len(second.result(30).sequence) == 2
    assert first.outcome(0).attempts == 1
    server.sync()
    assert server.count("goal_received") == 1


@pytest.mark.parametrize("end", ["deadline", "cancel", "close", "invalid"])
def test_what_ends_the_wait_sends_nothing(end, action_server, make_client):
    server = action_server("refuses_cancel", period=0.1)
    client = make_client(timeouts=PATIENT)
    first = running(server, client)
    goal = {"order": "one"} if end == "invalid" else {"order": 1}
    second = client.call_async(goal, timeout=0.3 if end == "deadline" else None, replaces=first)
    if end == "cancel":
        server.wait_for("cancel_refused")
        second.cancel()
    elif end == "close":
        server.wait_for("cancel_refused")
        client.close()
    error = {
        "deadline": ak.DeadlineExceededError,
        "cancel": concurrent.futures.CancelledError,
        "close": ak.ClientClosedError,
        "invalid": ak.InvalidGoalError,
    }[end]
    with pytest.raises(error) as caught:
        second.result(20)
    if end == "deadline":
        assert caught.value.phase == "replace"
        assert "waiting for the goal that it replaces to stop" in str(caught.value)
    server.sync()
    assert server.count("goal_received") == 1
    if end == "invalid":
        assert server.count("cancel_refused") == 0


def test_a_server_that_preempts_gets_the_goal_at_once(action_server, make_client, caplog):
    server = action_server("preemptive", period=0.05)
    client = make_client(retry=RetryPolicy(initial=0.0), classify=retry_aborted())
    first = running(server, client)
    with caplog.at_level(logging.INFO, "actionkit"):
        second = client.call_async({"order": 3}, replaces=first, preempt=True)
        assert len(second.result(20).sequence) == 4
        outcome = first.outcome(20)
    assert (outcome.status, outcome.state, outcome.attempts) == (GoalState.REPLACED,) * 2 + (1,)
    assert outcome.cancel is CancelReport.CONFIRMED
    assert first.cancelled()
    with pytest.raises(concurrent.futures.CancelledError, match="was replaced by its caller"):
        first.result(0)
    assert [event.state for event in outcome.timeline][-2:] == [
        GoalState.ABORTED,
        GoalState.REPLACED,
    ]
    assert outcome.timeline[-1].detail == f"by goal {second.goal_id}"
    server.sync()
    assert server.count("cancel_accepted") == 0
    assert server.count("goal_received") == 2


def test_a_new_goal_that_is_rejected_replaces_nothing(action_server, make_client):
    server = action_server("preemptive", period=0.05)
    client = make_client()
    first = client.call_async({"order": 20})
    server.wait_for("executing", goal_id=str(first.goal_id))
    with pytest.raises(ak.GoalRejectedError):
        client.call({"order": -1}, replaces=first, preempt=True)
    assert len(first.result(20).sequence) == 21
    later = running(server, client)
    with pytest.raises(ak.GoalRejectedError):
        client.call({"order": -1}, replaces=later, preempt=True)
    client.call({"order": 1})  # which does not say that it replaces anything
    assert isinstance(later.exception(20), ak.GoalAbortedError)
    last = running(server, client)
    rejected = client.call_async({"order": -1}, replaces=last, preempt=True)
    assert isinstance(rejected.exception(20), ak.GoalRejectedError)
    client.call({"order": 1}, replaces=rejected)
    assert last.outcome(20).status is GoalState.CANCELED  # before the server could abort it


def test_what_has_no_goal_at_a_server_is_replaced_at_once(make_client):
    client = make_client(timeouts=PATIENT)
    first = client.call_async(LONG)
    second = client.call_async(LONG, replaces=first, preempt=True)
    assert first.outcome(20).status is GoalState.REPLACED
    third = client.call_async(LONG, replaces=first, preempt=True)
    assert first.outcome(0).attempts == 1
    for future in (second, third):
        assert not future.done()


def test_wrong_arguments_are_explained(make_client):
    client, other = make_client(timeouts=PATIENT), make_client(name="other", timeouts=PATIENT)
    future = client.call_async(LONG)
    with pytest.raises(ValueError, match="of another client: give a future of the client"):
        other.call_async(LONG, replaces=future)
    with pytest.raises(ValueError, match="preempt=True needs replaces="):
        client.call_async(LONG, preempt=True)
    with pytest.raises(TypeError, match="preempt=1 must be True or False"):
        client.call_async(LONG, replaces=future, preempt=1)
    with pytest.raises(TypeError, match="replaces="):
        client.call_async(LONG, replaces=future.goal_id)
    assert client.pending == 1


@pytest.mark.parametrize("preempt", [False, True])
def test_replacing_many_in_a_row_leaves_one(preempt, action_server, make_client):
    server = action_server("preemptive" if preempt else "fibonacci", period=0.5)
    client = make_client(timeouts=PATIENT)
    future, earlier = running(server, client), []
    for _ in range(50):
        earlier.append(future)
        future = client.call_async(LONG, replaces=future, preempt=preempt)
    server.wait_for("executing", goal_id=str(future.goal_id))
    assert server.max_running == 1
    until(lambda: client.pending == 1)
    ended = {each.outcome(0).status for each in earlier if each.outcome(0).attempts}
    if preempt:
        assert ended == {GoalState.REPLACED}
    assert all(each.cancelled() for each in earlier)
    future.cancel()
    assert future.outcome(20).cancel is CancelReport.CONFIRMED
    until(lambda: runs_nothing(server))


@pytest.mark.parametrize("how", ["invalid", "cancelled"])
def test_a_call_that_replaced_nothing_passes_on_what_it_was_to_replace(
    how, action_server, make_client
):
    server = action_server("slow_cancel", gate=1)
    client = make_client(timeouts=PATIENT)
    first = running(server, client)
    second = client.call_async({"order": "no" if how == "invalid" else 1}, replaces=first)
    if how == "cancelled":
        second.cancel()
    third = client.call_async(LONG, replaces=second)
    server.wait_for("cancel_accepted", goal_id=str(first.goal_id))
    assert server.count("goal_received") == 1
    server.release()
    server.wait_for("executing", goal_id=str(third.goal_id))
    assert first.cancelled()
    assert server.max_running == 1
    third.cancel()
    third.outcome(20)
