"""Every way to fail, provoked through real servers, in the three forms (C3.1, C3.2)."""

from __future__ import annotations

import pickle
import re
import time
from dataclasses import dataclass, field
from typing import Any

import pytest
import rclpy
from test_msgs.action import Fibonacci, NestedMessage

import actionkit as ak
from actionkit import CancelReport, GoalFate, GoalState, RetryPolicy, Timeouts
from actionkit.cli._shared.exits import Exit, exit_of
from tests.conftest import (
    FORMS,
    NEVER,
    all_is_logged,
    ask,
    cancels,
    is_accepted,
    runs_nothing,
)


@dataclass
class Scenario:
    server: str | None
    error: type[ak.ActionKitError]
    text: str
    options: dict[str, Any] = field(default_factory=dict)
    goal: Any = None
    timeouts: Timeouts = Timeouts()  # noqa: RUF009  frozen
    timeout: float | None = 20.0
    status: GoalState | None = None
    cancel: CancelReport | None = None
    fate: GoalFate | None = GoalFate.ENDED
    """Of its goal; `None` where none is sent."""
    code: Exit = Exit.FAILED
    """Of `actionkit call`, if it ends so."""


SCENARIOS = {
    "no server": Scenario(
        None,
        ak.ServerUnavailableError,
        "No action server has come into sight so far",
        timeouts=Timeouts(server=0.2),
        status=GoalState.TIMED_OUT,
        cancel=CancelReport.NOT_NEEDED,
        fate=None,
        code=Exit.NO_SERVER,
    ),
    "no acceptance": Scenario(
        "silent",
        ak.AcceptanceTimeoutError,
        "neither accepted nor rejected",
        timeouts=Timeouts(accept=0.3, cancel=0.3),
        status=GoalState.TIMED_OUT,
        cancel=CancelReport.UNKNOWN,
        fate=GoalFate.UNANSWERED,
        code=Exit.NO_ANSWER,
    ),
    "server gone": Scenario(
        "vanishes",
        ak.ServerLostError,
        "was lost",
        status=GoalState.LOST,
        cancel=CancelReport.UNKNOWN,
        fate=GoalFate.LOST,
        code=Exit.SERVER_LOST,
    ),
    "stalled": Scenario(
        "never_finishes",
        ak.FeedbackStalledError,
        "no feedback for 0.3 s",
        timeouts=Timeouts(feedback=0.3),
        cancel=CancelReport.CONFIRMED,
        code=Exit.STALLED,
    ),
    "invalid goal": Scenario(
        "fibonacci",
        ak.InvalidGoalError,
        "order: 'x'",
        goal={"order": "x"},
        fate=None,
        code=Exit.USAGE,
    ),
    "wrong type": Scenario(
        "wrong_type",
        ak.ActionTypeMismatchError,
        "test_msgs/action/NestedMessage",
        fate=None,
        code=Exit.TYPE_MISMATCH,
    ),
    "rejected": Scenario(
        "fibonacci",
        ak.GoalRejectedError,
        "rejected",
        goal={"order": -1},
        status=GoalState.REJECTED,
        fate=GoalFate.REJECTED,
        code=Exit.REJECTED,
    ),
    "aborted": Scenario(
        "aborts",
        ak.GoalAbortedError,
        "aborted",
        status=GoalState.ABORTED,
        code=Exit.ABORTED,
    ),
    "raised in execute": Scenario(
        "raises",
        ak.GoalAbortedError,
        "aborted",
        status=GoalState.ABORTED,
        code=Exit.ABORTED,
    ),
    "cancelled by another": Scenario(
        "cancels_itself",
        ak.GoalCanceledError,
        "not by this client",
        status=GoalState.CANCELED,
        code=Exit.CANCELED,
    ),
    "no result": Scenario(
        "no_result",
        ak.ResultLostError,
        "ended as SUCCEEDED, but its result cannot be had",
        timeouts=Timeouts(result=1.0),
        timeout=None,
        status=GoalState.LOST,
        code=Exit.RESULT_LOST,
    ),
    "no result until the deadline": Scenario(  # the limit is for calls without one
        "no_result",
        ak.DeadlineExceededError,
        "ended as SUCCEEDED",
        timeouts=Timeouts(result=0.1, cancel=0.5),
        timeout=3.0,
        status=GoalState.TIMED_OUT,
        cancel=CancelReport.CONFIRMED,
        code=Exit.RESULT_LOST,
    ),
    "deadline while executing": Scenario(
        "never_finishes",
        ak.DeadlineExceededError,
        "ran out before the goal ended",
        timeout=0.3,
        cancel=CancelReport.CONFIRMED,
        code=Exit.TIMED_OUT,
    ),
    "deadline, cancel refused": Scenario(
        "refuses_cancel",
        ak.DeadlineExceededError,
        "STILL RUNNING",
        goal={"order": 200},
        timeout=0.3,
        status=GoalState.TIMED_OUT,
        cancel=CancelReport.REFUSED,
        fate=GoalFate.RUNNING,
        code=Exit.CANCEL_REFUSED,
    ),
    "deadline, cancel unconfirmed": Scenario(
        "slow_cancel",
        ak.DeadlineExceededError,
        "MAY STILL BE RUNNING",
        options={"gate": 1},
        timeouts=Timeouts(cancel=0.3),
        timeout=0.3,
        status=GoalState.TIMED_OUT,
        cancel=CancelReport.UNKNOWN,
        fate=GoalFate.RUNNING,
        code=Exit.CANCEL_UNKNOWN,
    ),
    "deadline without a server": Scenario(
        None,
        ak.ServerUnavailableError,
        "nothing was sent",
        timeout=0.1,
        status=GoalState.TIMED_OUT,
        cancel=CancelReport.NOT_NEEDED,
        fate=None,
        code=Exit.NO_SERVER,
    ),
    "deadline, not accepted": Scenario(
        "silent",
        ak.DeadlineExceededError,
        "waiting for acceptance",
        timeouts=Timeouts(cancel=0.3),
        timeout=0.3,
        cancel=CancelReport.UNKNOWN,
        fate=GoalFate.UNANSWERED,
        code=Exit.CANCEL_UNKNOWN,
    ),
    "timeout of zero": Scenario(
        "fibonacci",
        ak.DeadlineExceededError,
        "was not sent, though a server is ready: the time given to the call, 0 s, ran out first",
        timeout=0,
        cancel=CancelReport.NOT_NEEDED,
        fate=None,
        code=Exit.TIMED_OUT,
    ),
}


# All three forms end in the same code, so two failures show that they do.
IN_ALL_FORMS = ("aborted", "deadline while executing")


@pytest.mark.parametrize(
    ("name", "form"),
    [
        (name, form)
        for name in SCENARIOS
        for form in (FORMS if name in IN_ALL_FORMS else FORMS[1:2])
    ],
)
@pytest.mark.every
def test_each_failure_is_one_error(name, form, action_server, make_client):
    scenario = SCENARIOS[name]
    server = action_server(scenario.server, **scenario.options) if scenario.server else None
    client = make_client(timeouts=scenario.timeouts, retry=RetryPolicy.none())
    if server is not None and scenario.server != "wrong_type":
        assert client.wait_for_server(10)  # so that a short deadline is not spent on discovery
    goal = scenario.goal or Fibonacci.Goal(order=3)
    answer = ask(form, client, goal, timeout=scenario.timeout)
    error = answer.error
    assert answer.result is None
    assert type(error) is scenario.error, f"{error!r}"
    assert scenario.text in str(error)
    assert client.action_name in str(error)
    assert error.action_name == client.action_name
    assert error.attempts == (0 if name == "invalid goal" else 1)
    assert error.cancel is scenario.cancel
    if answer.outcome is not None:
        assert answer.outcome.error is error
        assert answer.outcome.cancel is scenario.cancel
        assert answer.outcome.timeline == error.timeline
        reports = answer.outcome.goals
        assert [goal.fate for goal in reports] == ([scenario.fate] if scenario.fate else [])
        refused = scenario.cancel is CancelReport.REFUSED
        assert all(goal.cancel_refused is refused for goal in reports)
        assert exit_of(answer.outcome) is scenario.code
        if scenario.status is not None:
            assert answer.outcome.status is scenario.status
    if server is not None and scenario.cancel in (CancelReport.CONFIRMED, CancelReport.NOT_NEEDED):
        assert runs_nothing(server)
    assert client.pending == 0
    copy = pickle.loads(pickle.dumps(error))
    assert type(copy) is type(error)
    assert str(copy) == str(error)
    assert copy.timeline == error.timeline


def test_an_expired_result_is_lost_not_empty(action_server, make_client):
    # Many of them are gone even when asked for at once (R25), with one thread nearly all: one of
    # 300 will be.
    action_server("expires", result_timeout=0.0, threads=1)
    client = make_client()
    answers = (ask("blocking", client, {"order": 1}, timeout=20) for _ in range(300))
    lost = None
    for answer in answers:
        if answer.error is None:
            assert list(answer.result.sequence) == [0, 1]
        else:
            lost = answer.error
            break
    assert isinstance(lost, ak.ResultLostError)
    assert lost.status in (None, GoalState.SUCCEEDED)  # the status topic may still show it
    assert "result_timeout" in str(lost)


@pytest.mark.long
def test_a_server_is_said_to_be_lost_when_it_was(action_server, make_client):
    server = action_server("never_finishes")
    client = make_client(timeouts=Timeouts(server=1), retry=RetryPolicy(resend="server_gone"))
    future = client.call_async({"order": 3})
    server.wait_for("executing")
    server.terminate()
    error = future.exception(30)
    assert isinstance(error, ak.ServerLostError)
    (lost,) = [event for event in error.timeline if event.state is GoalState.LOST]
    after = lost.monotonic - error.timeline[0].monotonic
    assert f"was lost {after:.1f} s into the call" in str(error)
    assert error.elapsed > after + 1  # another attempt waited for a server without success


@pytest.mark.parametrize("how", ["deadline", "cancel", "close"])
@pytest.mark.long
def test_a_goal_that_ended_without_a_result_is_told_as_such(how, action_server, make_client, capfd):
    server = action_server("no_result")
    client = make_client(timeouts=Timeouts(cancel=0.5), retry=RetryPolicy(resend="always"))
    future = client.call_async({"order": 3}, timeout=4.0 if how == "deadline" else None)
    assert is_accepted(future)
    while future.known_to_run:  # until the test's limit
        NEVER.wait(0.01)
    if how == "cancel":
        future.cancel()
    elif how == "close":
        client.close()
    error = future.exception(20)
    assert "ended as SUCCEEDED" in str(error)
    assert not re.search("was cancelled|STILL", str(error))
    assert error.cancel is CancelReport.CONFIRMED
    assert getattr(error, "status", None) is (None if how == "close" else GoalState.SUCCEEDED)
    client.close()
    assert all_is_logged()
    assert "STILL" not in capfd.readouterr().err
    assert (cancels(server), server.count("accepted")) == ([], 1)


def test_the_results_of_failures_are_kept(action_server, make_client):
    action_server("aborts")
    with pytest.raises(ak.GoalAbortedError) as caught:
        make_client().call({"order": 3}, 10)
    assert list(caught.value.result.sequence)


def test_a_late_success_is_not_thrown_away(action_server, make_client):
    server = action_server("ignores_cancel", period=0.05)
    client = make_client()
    assert client.wait_for_server(10)
    with pytest.raises(ak.DeadlineExceededError) as caught:
        client.call({"order": 10}, timeout=0.3)
    assert caught.value.cancel is CancelReport.CONFIRMED
    assert caught.value.late_result is not None
    assert caught.value.phase == "execute"
    assert isinstance(caught.value, TimeoutError)
    assert len(server.wait_for("succeeded")) == 1


def test_an_absent_server_is_explained(action_server, make_client):
    action_server("fibonacci", action_name="/arm/fibonacci")
    action_server("wrong_type", action_name="fibonaci")
    # Discovery may take some seconds, and what is not seen cannot be named.
    assert make_client(name="/arm/fibonacci").wait_for_server(30)
    with pytest.raises(ak.ActionTypeMismatchError):
        make_client(name="fibonaci", timeouts=Timeouts(server=30)).call({"order": 1})
    client = make_client(name="fibonacci", timeouts=Timeouts(server=0.5), retry=RetryPolicy.none())
    with pytest.raises(ak.ServerUnavailableError) as caught:
        client.call({"order": 1})
    text = str(caught.value)
    assert "'/fibonaci' (test_msgs/action/NestedMessage)" in text
    assert "'/arm/fibonacci' (test_msgs/action/Fibonacci)" in text
    assert "ROS_DOMAIN_ID=" in text
    assert "rmw_" in text


def test_the_type_that_is_served_is_named(action_server, make_client):
    action_server("wrong_type")
    with pytest.raises(ak.ActionTypeMismatchError) as caught:
        make_client(timeouts=Timeouts(server=None)).call({"order": 1})
    assert caught.value.expected == "test_msgs/action/Fibonacci"
    assert caught.value.served == ("test_msgs/action/NestedMessage",)


def test_another_type_is_told_in_a_process_that_had_a_client_before(action_server, make_client):
    """The next client's node discovers everything again, perhaps long after its first look."""
    action_server("fibonacci")
    for limit in (0.15, 0.3, 0.5, 0.7, 30.0):
        with make_client() as before:
            assert before.call({"order": 3}, 30)
        client = make_client(
            NestedMessage, timeouts=Timeouts(server=limit), retry=RetryPolicy.none()
        )
        with client, pytest.raises(ak.ActionKitError) as caught:
            client.call({})
        if not isinstance(caught.value, ak.ActionTypeMismatchError):
            assert isinstance(caught.value, ak.ServerUnavailableError)  # it is not seen yet
            assert "similar name" not in str(caught.value)
    assert isinstance(caught.value, ak.ActionTypeMismatchError)
    assert caught.value.expected == "test_msgs/action/NestedMessage"
    assert caught.value.served == ("test_msgs/action/Fibonacci",)


def test_another_type_is_told_that_comes_while_a_call_waits(action_server, make_client):
    client = make_client(timeouts=Timeouts(server=None))
    future = client.call_async({"order": 1})
    assert future.state is GoalState.SENDING
    action_server("wrong_type")
    with pytest.raises(ak.ActionTypeMismatchError):
        future.result(30)


@pytest.mark.long
def test_another_type_beside_ours_does_not_matter(action_server, make_client):
    server = action_server("fibonacci")
    client = make_client()
    assert client.wait_for_server(30)
    action_server("wrong_type")
    connection = client._session.connection
    until = time.monotonic() + 30
    while len(connection.runtime.run(connection.actions)["/fibonacci"]) < 2:
        assert time.monotonic() < until
        NEVER.wait(0.01)
    assert client.call({"order": 1}, 30)
    assert len(server.wait_for("succeeded")) == 1


@pytest.mark.long
def test_another_type_is_told_after_rclpy_s_shutdown(action_server, make_client):
    action_server("wrong_type")
    rclpy.init()
    node = rclpy.create_node("before")
    with make_client(name="elsewhere", node=node) as before:
        assert not before.wait_for_server(0)
    node.destroy_node()
    rclpy.shutdown()
    with pytest.raises(ak.ActionTypeMismatchError):
        make_client(timeouts=Timeouts(server=30)).call({"order": 1})


def test_an_invalid_goal_is_a_type_and_a_value_error(action_server, make_client):
    server = action_server("fibonacci")
    client = make_client()
    for goal, path in [
        ({"order": 2**31}, "order"),
        ({"order": None}, "order"),
        ({"ordr": 1}, "ordr"),
        (None, ""),
        (Fibonacci.Result(), ""),
    ]:
        with pytest.raises(ak.InvalidGoalError) as caught:
            client.call(goal)
        assert caught.value.field == path
        assert isinstance(caught.value, TypeError)
        assert isinstance(caught.value, ValueError)
        assert caught.value.__cause__ is not None
    assert client.call({"order": 1}, 10)
    assert len(server.wait_for("goal_received")) == 1
