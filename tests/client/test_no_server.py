"""Without a server there is one error, in time, and no retry (C2.7)."""

from __future__ import annotations

import concurrent.futures
import threading
import time
from types import SimpleNamespace

import pytest
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.qos import QoSProfile, ReliabilityPolicy
from test_msgs.action import Fibonacci

import actionkit as ak
from actionkit import CancelReport, GoalState, RetryBudget, RetryPolicy, Timeouts, Verdict
from actionkit.testing import EventLog
from tests.client.test_node import spinning, user_node
from tests.conftest import FORMS, NEVER, ask

EAGER = RetryPolicy(attempts=5, initial=0.0, jitter=0.0)
LIMITS = {
    # The time there is, and for how long a server is looked for.
    "timeouts.server": (Timeouts(server=0.5), None, 0.5),
    "the deadline": (Timeouts(server=5.0), 0.5, 0.5),
    "the deadline alone": (Timeouts(server=None), 0.5, 0.5),
    "timeouts.server before the deadline": (Timeouts(server=0.5), 60.0, 0.5),
    "both at once": (Timeouts(server=0.5), 0.5, 0.5),
    "no time": (Timeouts(), 0, 0.0),
}


def transient(outcome):
    return Verdict.TRANSIENT


@pytest.mark.parametrize(
    ("limit", "form"),
    [*((limit, "future") for limit in LIMITS), *(("the deadline", form) for form in FORMS[::2])],
)
def test_no_server_is_one_error(limit, form, make_client):
    timeouts, timeout, time_there_was = LIMITS[limit]
    budget = RetryBudget()
    before = budget.tokens
    client = make_client(timeouts=timeouts, retry=EAGER, classify=transient, retry_budget=budget)
    assert not client.server_is_ready()
    answer = ask(form, client, {"order": 3}, timeout=timeout)
    error = answer.error
    assert type(error) is ak.ServerUnavailableError
    assert isinstance(error, TimeoutError)
    assert error.transient
    assert (error.attempts, error.cancel) == (1, CancelReport.NOT_NEEDED)
    # At once, except on a busy machine; `unit/call_life.py` has a clock that tells to the instant.
    assert time_there_was <= error.elapsed < time_there_was + 5
    assert "tried again" not in str(error)
    assert "used up" not in str(error)
    assert [event.state for event in error.timeline] == [GoalState.SENDING, GoalState.TIMED_OUT]
    if answer.outcome is not None:
        assert answer.outcome.status is GoalState.TIMED_OUT
        assert answer.outcome.cancel is CancelReport.NOT_NEEDED
    assert budget.tokens == before  # a server that is not there is not hammered


def test_a_call_without_a_time_of_its_own_has_that_of_its_client(make_client):
    client = make_client(timeouts=Timeouts(server=None, total=0.2))
    without_limit = client.call_async({"order": 3}, timeout=None)
    error = client.call_async({"order": 3}).exception(10)
    assert type(error) is ak.ServerUnavailableError
    assert error.elapsed >= 0.2
    assert not without_limit.done()


@pytest.mark.long
def test_without_time_nothing_is_sent_to_a_server_either(action_server, make_client):
    """That call had a server, so it is the deadline's error."""
    server = action_server("fibonacci")
    client = make_client()
    assert client.wait_for_server(10)
    with pytest.raises(ak.DeadlineExceededError) as caught:
        client.call({"order": 3}, timeout=0)
    assert (caught.value.phase, caught.value.cancel) == ("server", CancelReport.NOT_NEEDED)
    assert "was not sent" in str(caught.value)
    assert "visible" not in str(caught.value)
    assert client.call({"order": 3}, timeout=20)
    assert len(server.wait_for("goal_received")) == 1


def test_a_server_that_has_not_answered_so_far_is_told_of(action_server, make_client):
    server = action_server("fibonacci")
    assert make_client().wait_for_server(10)
    server.pause()
    try:
        with pytest.raises(ak.ServerUnavailableError) as caught:
            make_client().call({"order": 3}, timeout=0.2)
    finally:
        server.resume()
    assert "is visible, but has not answered" in str(caught.value)
    assert "No action server" not in str(caught.value)


def test_a_best_effort_server_is_told_of(ros_domain, make_client):
    profile = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
    with user_node(ros_domain) as node:
        profiles = {"goal_service_qos_profile": profile, "feedback_pub_qos_profile": profile}
        server = ActionServer(node, Fibonacci, "fibonacci", lambda _: None, **profiles)
        client = make_client()
        until = time.monotonic() + 20
        while not client._session.connection.actions():
            assert time.monotonic() < until
            NEVER.wait(0.01)
        with pytest.raises(ak.ServerUnavailableError) as caught:
            client.call({"order": 3}, timeout=0.2)
        server.destroy()
    assert "is visible, but best-effort for send_goal. It is not" in str(caught.value)


@pytest.mark.parametrize("found_by", ["a call", "wait_for_server", "server_is_ready"])
def test_a_server_with_best_effort_feedback_is_called(found_by, ros_domain, make_client):
    def execute(goal):
        until = time.monotonic() + 20
        while not goal.is_cancel_requested and time.monotonic() < until:
            goal.publish_feedback(Fibonacci.Feedback(sequence=[goal.request.order]))
            NEVER.wait(0.01)
            if goal.request.order < 9:
                goal.succeed()
                return Fibonacci.Result(sequence=[goal.request.order])
        goal.canceled()
        return Fibonacci.Result()

    profile = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
    profiles = {"status_pub_qos_profile": profile, "feedback_pub_qos_profile": profile}
    accept = {"cancel_callback": lambda _: CancelResponse.ACCEPT}
    with user_node(ros_domain) as node:
        group = ReentrantCallbackGroup()
        server = ActionServer(
            node, Fibonacci, "fibonacci", execute, callback_group=group, **accept, **profiles
        )
        with spinning(node, "multi"):
            client = make_client()
            if found_by == "wait_for_server":
                assert client.wait_for_server(20)
            until = time.monotonic() + 20
            while found_by == "server_is_ready" and not client.server_is_ready():
                assert time.monotonic() < until
                NEVER.wait(0.01)
            assert client.call({"order": 2}, 20).sequence[0] == 2
            feedback = EventLog()
            future = client.call_async({"order": 9}, timeout=20, on_feedback=feedback)
            feedback.wait_for(3, 20)
            assert future.cancel()
            assert future.outcome(20).cancel is CancelReport.CONFIRMED
            server.destroy()


def test_a_cancel_ends_the_wait_for_a_server(make_client):
    future = make_client(timeouts=Timeouts(server=None)).call_async({"order": 3})
    assert future.cancel()
    with pytest.raises(concurrent.futures.CancelledError):
        future.result(20)


# --- a call that had a server ------------------------------------------------------------------


def had_a_server(action_server, make_client, timeouts, timeout):
    """Return the future of a call after its server aborted the goal and went away."""
    server = action_server("aborts")
    gone = threading.Event()
    states: EventLog[GoalState] = EventLog()

    def judge(outcome):
        gone.wait(60)
        return Verdict.TRANSIENT

    client = make_client(
        retry=RetryPolicy(attempts=2, initial=0.0, jitter=0.0),
        classify=judge,
        observers=[SimpleNamespace(on_event=lambda event, call: states(event.state))],
        timeouts=timeouts,
    )
    assert client.wait_for_server(10)
    future = client.call_async({"order": 2}, timeout=timeout)
    states.wait_for(lambda state: state is GoalState.ABORTED)
    server.terminate()
    until = time.monotonic() + 20
    while client.server_is_ready():
        assert time.monotonic() < until
        NEVER.wait(0.01)
    gone.set()
    return future


def test_the_failure_of_the_server_there_was_is_told(action_server, make_client):
    future = had_a_server(action_server, make_client, Timeouts(server=0.3), None)
    with pytest.raises(ak.GoalAbortedError) as caught:
        future.result(20)
    why = "no server was ready within 0.3 s, and all 2 attempts of the retry policy are used up"
    assert f"It was not tried again: {why}." in str(caught.value)
    assert caught.value.attempts == 2
    states = [event.state for event in caught.value.timeline]
    assert states[-3:] == [GoalState.RETRYING, GoalState.SENDING, GoalState.TIMED_OUT]
    assert caught.value.goal_id == caught.value.timeline[0].goal_id


@pytest.mark.long
def test_the_deadline_of_a_call_that_had_a_server_is_the_deadlines_error(
    action_server, make_client
):
    future = had_a_server(action_server, make_client, Timeouts(server=None), 8.0)
    with pytest.raises(ak.DeadlineExceededError, match="waiting for a server that could") as caught:
        future.result(30)
    assert (caught.value.phase, caught.value.cancel) == ("server", CancelReport.NOT_NEEDED)
    assert caught.value.attempts == 2
