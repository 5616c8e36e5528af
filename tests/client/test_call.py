"""The two calls in their three forms, when all goes well (C1.1, C1.3, C1.4, C1.7)."""

from __future__ import annotations

import concurrent.futures
import copy
import uuid

import pytest
from test_msgs.action import Fibonacci, NestedMessage

from actionkit import CancelReport, GoalState
from tests.conftest import FORMS, ask, cancels

FIRST_TEN = [0, 1, 1, 2, 3, 5, 8, 13, 21, 34, 55]


@pytest.mark.parametrize("form", FORMS)
def test_a_call_returns_the_result(form, action_server, make_client):
    server = action_server("fibonacci")
    answer = ask(form, make_client(), Fibonacci.Goal(order=10), timeout=10.0)
    assert answer.error is None
    assert isinstance(answer.result, Fibonacci.Result)
    assert list(answer.result.sequence) == FIRST_TEN
    assert len(server.wait_for("accepted")) == 1
    if answer.outcome is not None:
        assert answer.outcome.ok
        assert answer.outcome.status is GoalState.SUCCEEDED
        assert answer.outcome.state is answer.outcome.status
        assert answer.outcome.result == answer.result
        assert answer.outcome.attempts == 1
        assert answer.outcome.cancel is None


@pytest.mark.long
def test_a_goal_may_be_a_mapping_and_is_copied(action_server, make_client):
    action_server("fibonacci")
    client = make_client()
    assert list(client.call({"order": 3}, 10).sequence) == FIRST_TEN[:4]
    goal = Fibonacci.Goal(order=1)
    futures = []
    for order in (4, 5, 6):
        goal.order = order
        futures.append(client.call_async(goal))
    assert [len(f.result(10).sequence) for f in futures] == [5, 6, 7]


def test_a_future_shows_the_goal_live(action_server, make_client):
    server = action_server("fibonacci", gate=1, period=0.01)
    future = make_client().call_async({"order": 5})
    goal_id = future.goal_id
    (accepted,) = server.wait_for("accepted")
    assert future.goal_id == goal_id == uuid.UUID(accepted.goal_id)
    server.wait_for("feedback", count=4)
    for feedback in future.feedback():
        if len(feedback.sequence) >= 6:
            break
    assert future.running()
    assert not future.done()
    assert future.state is GoalState.EXECUTING
    assert len(future.latest_feedback.sequence) == 6
    server.release()
    assert list(future.result(10).sequence) == FIRST_TEN[:6]
    states = [event.state for event in future.timeline]
    assert states[:3] == [GoalState.SENDING, GoalState.SENT, GoalState.ACCEPTED]
    assert states[-1] is GoalState.SUCCEEDED
    assert states.count(GoalState.FEEDBACK) == 2  # the first and the last are kept
    assert not future.running()
    assert future.cancel() is False
    server.wait_for("succeeded")  # the journal comes by a way of its own
    assert future.outcome().feedback_count == server.count("feedback")


def test_the_stdlib_waits_for_it(action_server, make_client):
    action_server("fibonacci")
    client = make_client()
    futures = [client.call_async({"order": order}) for order in range(1, 6)]
    done, pending = concurrent.futures.wait(futures, timeout=10)
    assert not pending
    assert {len(f.result().sequence) for f in done} == {2, 3, 4, 5, 6}
    # A copy of one, alone or in what is copied, is the same: a real copy would never end.
    assert (copy.copy(futures[0]), copy.deepcopy(futures)) == (futures[0], futures)
    again = [client.call_async({"order": order}) for order in range(1, 6)]
    assert len(list(concurrent.futures.as_completed(again, timeout=10))) == 5


@pytest.mark.long
def test_a_done_callback_gets_the_future(action_server, make_client, own_threads):
    from actionkit.testing import EventLog

    action_server("fibonacci")
    client = make_client()
    seen: EventLog = EventLog()
    future = client.call_async({"order": 2})
    future.add_done_callback(lambda _: 1 / 0)  # is logged, and ends nothing
    future.add_done_callback(seen)
    assert seen.wait_for(1) == [future]
    future.add_done_callback(seen)  # at once, when it is done
    assert len(seen) == 2
    assert client.call({"order": 2}, 10)


def test_a_local_wait_leaves_the_goal_alone(action_server, make_client):
    server = action_server("fibonacci", gate=1)
    future = make_client().call_async({"order": 2})
    server.wait_for("executing")
    for wait in (future.result, future.exception, future.outcome):
        with pytest.raises(TimeoutError, match="was not cancelled"):
            wait(0.01)
        with pytest.raises(concurrent.futures.TimeoutError):
            wait(0)
    server.release()
    assert future.result(10)
    assert cancels(server) == []


def test_servers_can_be_waited_for(action_server, make_client):
    client = make_client()
    assert client.server_is_ready() is False
    assert client.wait_for_server(0) is False
    assert client.wait_for_server(0.05) is False
    action_server("fibonacci")
    assert client.wait_for_server(10) is True
    assert client.server_is_ready() is True
    assert client.pending == 0


def test_cancel_all_cancels_this_client_only(action_server, make_client):
    server = action_server("never_finishes")
    mine, other = make_client(), make_client()
    futures = [mine.call_async({"order": 1}) for _ in range(3)]
    kept = other.call_async({"order": 1})
    server.wait_for("executing", count=4)
    assert (mine.pending, other.pending) == (3, 1)
    assert mine.cancel_all() == 3
    for future in futures:
        assert future.outcome(10).cancel is CancelReport.CONFIRMED
        assert future.cancelled()
    assert mine.pending == 0
    server.wait_for("canceled", count=3)
    assert server.running() == {str(kept.goal_id)}


def test_nested_goals_and_results(action_server, make_client):
    action_server("wrong_type", action_name="nested")
    client = make_client(NestedMessage, "nested")
    future = client.call_async({"nested_field_no_pkg": {"duration_value": {"sec": 3}}})
    assert isinstance(future.result(10), NestedMessage.Result)


@pytest.mark.long
def test_two_clients_share_one_thread(action_server, make_client, own_threads):
    action_server("fibonacci")
    clients = [make_client() for _ in range(3)]
    for client in clients:
        assert client.call({"order": 1}, 10)
    assert own_threads().count("actionkit") == 1
