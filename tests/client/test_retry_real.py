"""Retries over real servers: safe, limited, and stopped by users (C4, C3.3)."""

from __future__ import annotations

import concurrent.futures
import math
import threading
import time
from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import pytest
import tenacity

import actionkit as ak
from actionkit import (
    CancelReport,
    GoalState,
    RetryBudget,
    RetryPolicy,
    Timeouts,
    Verdict,
    classify_by_field,
)
from actionkit.testing import EventLog
from tests.conftest import FORMS, NEVER, ask
from tests.waiting import until

QUICK = RetryPolicy(initial=0.05, jitter=0.0)


def transient(outcome):
    return Verdict.TRANSIENT


def executed(server):
    server.sync()
    return Counter(e.goal_id for e in server.events if e.event == "executing")


@pytest.mark.parametrize("form", FORMS)
def test_transient_failures_are_tried_again(form, action_server, make_client):
    server = action_server("aborts")
    client = make_client(retry=QUICK, classify=transient)
    answer = ask(form, client, {"order": 2}, timeout=20)
    assert isinstance(answer.error, ak.GoalAbortedError)
    assert answer.error.attempts == 3
    assert "all 3 attempts of the retry policy are used up" in str(answer.error)
    assert len(server.wait_for("aborted", count=3)) == 3
    assert server.max_running == 1
    states = [event.state for event in answer.error.timeline]
    assert states.count(GoalState.RETRYING) == 2
    assert {event.attempt for event in answer.error.timeline} == {1, 2, 3}
    assert len({event.goal_id for event in answer.error.timeline}) == 3


def test_permanent_failures_are_not(action_server, make_client):
    server = action_server("aborts")
    with pytest.raises(ak.GoalAbortedError) as caught:
        make_client(retry=QUICK).call({"order": 2}, 10)
    assert caught.value.attempts == 1
    assert len(server.wait_for("aborted")) == 1


def test_a_goal_cancelled_by_another_is_never_tried_again(action_server, make_client):
    server = action_server("cancels_itself")
    with pytest.raises(ak.GoalCanceledError) as caught:
        make_client(retry=QUICK, classify=transient).call({"order": 2}, 10)
    assert caught.value.attempts == 1
    assert len(server.wait_for("canceled")) == 1


STOPS_SLOWLY = """
import sys
import time
import rclpy
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from test_msgs.action import Fibonacci

def execute(handle):
    print("executing", flush=True)
    while not handle.is_cancel_requested:
        handle.publish_feedback(Fibonacci.Feedback())
        time.sleep(0.05)
    if "at once" not in sys.argv[1]:
        time.sleep(1.5)  # in silence
    handle.canceled() if sys.argv[1] == "canceled" else handle.abort()
    return Fibonacci.Result()

rclpy.init()
node = rclpy.create_node("slow")
group = ReentrantCallbackGroup()
accept = lambda _: CancelResponse.ACCEPT
server = ActionServer(
    node, Fibonacci, "fibonacci", execute, cancel_callback=accept, callback_group=group
)
print("up", flush=True)
rclpy.spin(node, MultiThreadedExecutor(4))
"""


def reads_status(client):
    """Whether the server's status comes to the client, as it does while a goal may be retried."""
    source = client._session.link._status._source
    return source is not None and source.subscription.get_publisher_count() > 0


@pytest.mark.parametrize("end", ["canceled", "aborted", "aborted at once"])
def test_what_an_operator_cancels_is_not_sent_again(end, run_script, make_client):
    server = run_script(STOPS_SLOWLY, end)
    assert server.line() == "up"
    client = make_client(timeouts=Timeouts(feedback=1.0), retry=QUICK, classify=transient)
    future = client.call_async({"order": 2}, timeout=30)
    assert server.line() == "executing"
    assert future.wait_accepted(10)
    until(lambda: reads_status(client))
    assert make_client().cancel_everything(10) == {future.goal_id: CancelReport.CONFIRMED}
    error = future.exception(10)
    assert type(error) is (ak.GoalCanceledError if end == "canceled" else ak.GoalAbortedError)
    assert error.attempts == 1
    if end != "canceled":
        assert "somebody else has cancelled it" in str(error)


def test_a_success_may_be_judged_a_failure(action_server, make_client):
    server = action_server("fibonacci")
    client = make_client(retry=QUICK)
    judge = classify_by_field("sequence[0]", transient={0})
    with pytest.raises(ak.RetriesExhaustedError) as caught:
        client.call({"order": 2}, 10, classify=judge)
    assert list(caught.value.result.sequence) == [0, 1, 1]
    assert isinstance(caught.value.__cause__, ak.TransientError)
    assert caught.value.attempts == 3
    with pytest.raises(ak.PermanentError) as caught:
        client.call({"order": 2}, 10, classify=classify_by_field("sequence[0]", ok={7}))
    assert caught.value.attempts == 1
    assert len(server.wait_for("succeeded", count=4)) == 4


def test_an_abort_may_be_judged_a_success(action_server, make_client):
    action_server("aborts")
    future = make_client(classify=lambda outcome: Verdict.SUCCESS).call_async({"order": 2})
    assert list(future.result(10).sequence)
    assert future.outcome().status is GoalState.ABORTED
    assert future.outcome().ok


def test_a_field_that_does_not_exist_is_refused_when_the_client_is_made(make_client):
    with pytest.raises(ValueError, match="error_code"):
        make_client(classify=classify_by_field("error_code", ok={0}))


DROPS_THE_FIRST = """
import rclpy
from rclpy.action import ActionServer
from test_msgs.action import Fibonacci

class Drops(ActionServer):
    requests = 0

    async def _execute_goal_request(self, request):
        self.requests += 1
        print("request", flush=True)
        if self.requests > 1:
            await super()._execute_goal_request(request)

def execute(handle):
    print("executing", flush=True)
    handle.succeed()
    return Fibonacci.Result(sequence=[1])

rclpy.init()
node = rclpy.create_node("drops")
server = Drops(node, Fibonacci, "fibonacci", execute)
print("up", flush=True)
rclpy.spin(node)
"""


def test_a_request_that_is_not_answered_is_not_sent_a_second_time(run_script, make_client):
    """It may be on its way yet, and a server in C++ that gets an id twice dies (R5)."""
    server = run_script(DROPS_THE_FIRST)
    assert server.line() == "up"
    client = make_client(timeouts=Timeouts(accept=8.0, cancel=0.2))
    first = client.call_async({"order": 1})
    assert isinstance(first.exception(20), ak.AcceptanceTimeoutError)
    assert first.outcome().cancel is CancelReport.UNKNOWN
    assert list(client.call({"order": 1}, 10).sequence) == [1]
    # One for each goal.
    assert [server.line() for _ in range(3)] == ["request", "request", "executing"]


def test_a_server_that_takes_long_to_accept_runs_the_goal_once(action_server, make_client):
    server = action_server("slow_accept", delay=4.0)
    client = make_client(retry=RetryPolicy.none(), timeouts=Timeouts(accept=20))
    assert client.wait_for_server(10)
    future = client.call_async({"order": 4}, timeout=30)
    assert len(future.result(30).sequence) == 5
    assert future.outcome().attempts == 1
    server.wait_for("succeeded")
    assert set(executed(server).values()) == {1}
    assert server.count("goal_received") == 1


@pytest.mark.long
def test_a_restarted_server_gets_the_goal_again(action_server, make_client):
    server = action_server("fibonacci", gate=1)
    client = make_client(retry=replace(QUICK, resend="server_gone"))
    future = client.call_async({"order": 3}, timeout=40)
    server.wait_for("executing")
    server.terminate()
    server.restart()
    server.wait_for("executing", count=2, timeout=20)
    server.release()
    assert len(future.result(20).sequence) == 4
    assert future.outcome().attempts >= 2
    assert server.max_running == 1


def test_a_killed_and_restarted_server_is_noticed(action_server, make_client):
    server = action_server("fibonacci", gate=1, period=0.5)
    client = make_client(retry=QUICK)
    # Two seconds of work, in which the names of its nodes come to be known.
    future = client.call_async({"order": 5}, timeout=60)
    server.wait_for("feedback", count=4)
    server.kill()
    server.restart()
    began = time.monotonic()
    error = future.exception(30)
    assert time.monotonic() - began < 15  # well before the lease of the dead one runs out
    assert isinstance(error, ak.ServerLostError)
    assert "it was restarted, or started twice" in str(error)
    assert f"{future.goal_id} of this call MAY STILL BE RUNNING" in str(error)
    assert "resend='server_gone' tries again when its server has left the graph" in str(error)


@pytest.mark.long
def test_a_killed_and_restarted_server_gets_the_goal_when_the_dead_one_has_left(
    action_server, make_client
):
    server = action_server("fibonacci", gate=1, period=0.1)
    timeouts = Timeouts(server=5.0, accept=20.0)
    client = make_client(retry=replace(QUICK, resend="server_gone"), timeouts=timeouts)
    assert client.wait_for_server(20)
    future = client.call_async({"order": 5})
    server.wait_for("feedback", count=4)
    server.kill()
    server.restart()
    server.wait_for("executing", count=2, timeout=40)  # the lease is 20 s
    server.release()
    assert len(future.result(20).sequence) == 6
    assert future.outcome().attempts == 2  # though that was longer than `Timeouts.server`


@pytest.mark.long
def test_a_stalled_goal_is_stopped_before_another_is_sent(action_server, make_client):
    server = action_server("never_finishes")
    client = make_client(timeouts=Timeouts(feedback=0.3), retry=QUICK)
    with pytest.raises(ak.FeedbackStalledError) as caught:
        client.call({"order": 1}, 20)
    assert caught.value.attempts == 3
    assert len(server.wait_for("canceled", count=3)) == 3
    assert server.max_running == 1


def test_nothing_is_sent_again_while_the_first_may_run(action_server, make_client):
    server = action_server("refuses_cancel", period=1.0)
    client = make_client(timeouts=Timeouts(feedback=0.3), retry=QUICK)
    with pytest.raises(ak.FeedbackStalledError, match="may still run") as caught:
        client.call({"order": 50}, 20)
    assert caught.value.attempts == 1
    assert caught.value.cancel is CancelReport.REFUSED
    assert len(server.wait_for("goal_received")) == 1


@pytest.mark.parametrize("resend", ["never_accepted", "confirmed_stopped", "always"])
def test_the_policy_decides_about_accepted_goals(resend, action_server, make_client):
    server = action_server("aborts")
    policy = RetryPolicy(attempts=2, initial=0.01, resend=resend)
    with pytest.raises(ak.GoalAbortedError) as caught:
        make_client(retry=policy, classify=transient).call({"order": 1}, 10)
    sent = 1 if resend == "never_accepted" else 2
    assert caught.value.attempts == sent
    server.wait_for("aborted", count=sent)


def test_cancel_ends_a_pause_at_once(action_server, make_client):
    server = action_server("aborts")
    client = make_client(retry=RetryPolicy(initial=60, max_pause=60), classify=transient)
    future = client.call_async({"order": 1})
    server.wait_for("aborted")
    with pytest.raises(TimeoutError, match="RETRYING"):
        future.result(0.5)
    future.cancel()
    with pytest.raises(concurrent.futures.CancelledError):
        future.result(5)
    assert future.outcome().cancel is CancelReport.NOT_NEEDED


@pytest.mark.long
def test_closing_ends_a_pause_at_once(action_server, make_client):
    server = action_server("aborts")
    client = make_client(retry=RetryPolicy(initial=60, max_pause=60), classify=transient)
    future = client.call_async({"order": 1})
    server.wait_for("aborted")
    with pytest.raises(TimeoutError, match="RETRYING"):
        future.result(0.5)
    client.close()
    with pytest.raises(ak.ClientClosedError, match=r"ran no more \(ABORTED\), and was not tried"):
        future.result(0)


def test_a_pause_that_would_cross_the_deadline_is_not_begun(action_server, make_client):
    action_server("aborts")
    client = make_client(retry=RetryPolicy(initial=60, max_pause=60), classify=transient)
    began = time.monotonic()
    with pytest.raises(ak.GoalAbortedError, match="crossed the deadline"):
        client.call({"order": 1}, timeout=20)
    assert time.monotonic() - began < 10


@pytest.mark.long
def test_tenacitys_strategies(action_server, make_client):
    server = action_server("aborts")
    policy = RetryPolicy(stop=tenacity.stop_after_attempt(5), wait=tenacity.wait_fixed(0.01))
    with pytest.raises(ak.GoalAbortedError, match="stop strategy"):
        make_client(retry=policy, classify=transient).call({"order": 1}, 20)
    assert len(server.wait_for("aborted", count=5)) == 5


def test_the_budget_stops_a_fleet(action_server, make_client):
    server = action_server("aborts")
    budget = RetryBudget(capacity=4)
    clients = [make_client(retry=QUICK, classify=transient, retry_budget=budget) for _ in range(2)]
    for client in clients:
        assert client.retry_budget is budget
    errors = []
    for n in range(6):
        with pytest.raises(ak.GoalAbortedError) as caught:
            clients[n % 2].call({"order": 1}, 20)
        errors.append(caught.value)
    assert "retry budget" in str(errors[-1])
    assert not budget.allows_retry
    # Two failures use up the half that may be used; from then on each call is sent once.
    assert len(server.wait_for("aborted", count=7)) == 7


@pytest.mark.long
@pytest.mark.parametrize(
    ("strategies", "told", "cause"),
    [
        ({"stop": lambda state: 1 / 0}, "stop=.* raised ZeroDivisionError", ZeroDivisionError),
        ({"wait": lambda state: 1 / 0}, "wait=.* raised ZeroDivisionError", ZeroDivisionError),
        ({"stop": lambda state: None}, "stop=.* returned None", ak.GoalAbortedError),
        ({"wait": lambda state: "1"}, "wait=.* returned '1'", ak.GoalAbortedError),
        ({"wait": lambda state: math.nan}, "wait=.* returned nan", ak.GoalAbortedError),
        ({"stop": lambda state: NEVER.wait(60)}, "stop=.* call's deadline", ak.GoalAbortedError),
    ],
    ids=["stop raises", "wait raises", "stop None", "wait text", "wait NaN", "stop blocks"],
)
def test_a_strategy_that_does_not_work_ends_the_call(
    strategies, told, cause, action_server, make_client
):
    server = action_server("aborts")
    client = make_client(retry=RetryPolicy(**strategies), classify=transient)
    assert client.wait_for_server(10)
    future = client.call_async({"order": 1}, timeout=2.0)
    with pytest.raises(ak.RetriesExhaustedError, match=told) as caught:
        future.result(20)
    assert "was aborted by the server" in str(caught.value)
    assert isinstance(caught.value.__cause__, cause)
    assert list(caught.value.result.sequence)
    assert len(server.wait_for("aborted")) == 1


@pytest.mark.parametrize("end", ["cancel", "close"])
def test_a_call_whose_strategy_blocks_can_be_ended(end, action_server, make_client):
    action_server("aborts")
    asked, leave = threading.Event(), threading.Event()

    def stop(state):
        asked.set()
        leave.wait(60)
        return False

    client = make_client(retry=RetryPolicy(stop=stop), classify=transient)
    future = client.call_async({"order": 1})
    try:
        assert asked.wait(20)
        if end == "cancel":
            future.cancel()
            with pytest.raises(concurrent.futures.CancelledError):
                future.result(5)
        else:
            client.close()
            with pytest.raises(ak.ClientClosedError):
                future.result(0)
    finally:
        leave.set()


@pytest.mark.parametrize("returns", [False, True])
def test_liveness_notices_a_stopped_server(returns, action_server, make_client):
    server = action_server("never_finishes")
    client = make_client(timeouts=Timeouts(liveness=0.5, cancel=0.5), retry=RetryPolicy.none())
    future = client.call_async({"order": 1})
    server.wait_for("executing")
    server.pause()
    with pytest.raises(ak.ServerLostError, match=r"answered nothing for 0\.5 s"):
        future.result(10)
    if returns:
        # It was alive after all: what its caller gave up on is cancelled.
        server.resume()
        server.wait_for("canceled")


@pytest.mark.parametrize("resend", ["server_gone", "always"])
def test_a_lost_goal_is_told_of_when_no_server_comes_back(resend, action_server, make_client):
    server = action_server("never_finishes")
    policy = RetryPolicy(initial=0.05, jitter=0.0, resend=resend)
    client = make_client(timeouts=Timeouts(server=0.2), retry=policy)
    assert client.wait_for_server(10)
    future = client.call_async({"order": 1})
    lost = server.wait_for("executing")[0].goal_id
    server.terminate()
    # Not ServerUnavailableError, which says that nothing was sent.
    why = r"not tried again: no server was ready within 0\.2 s, and all 3 attempts"
    with pytest.raises(ak.ServerLostError, match=why) as caught:
        future.result(20)
    assert str(caught.value.goal_id) == lost
    assert caught.value.attempts == 3


def test_a_stopped_server_is_not_confirmed_stopped_by_another(action_server, make_client):
    # It is silent, so its goal is lost; but it may go on at any time.
    stopped = action_server("never_finishes")
    policy = RetryPolicy(initial=0.05, jitter=0.0, resend="server_gone")
    states: EventLog[GoalState] = EventLog()
    client = make_client(
        timeouts=Timeouts(liveness=0.5, cancel=0.5),
        retry=policy,
        observers=[SimpleNamespace(on_event=lambda event, call: states(event.state))],
    )
    future = client.call_async({"order": 1}, timeout=60)
    lost = stopped.wait_for("executing")[0].goal_id
    stopped.pause()
    states.wait_for(lambda state: state is GoalState.LOST)
    other = action_server("never_finishes")
    other.wait_for("cancel_requested", goal_id=lost, count=3)
    # Neither to the other one, nor to the one that is stopped, which would run both.
    assert [event.state for event in future.timeline].count(GoalState.SENT) == 1
    assert other.count("goal_received") == 0
    stopped.resume()
    stopped.wait_for("canceled", goal_id=lost)
    other.wait_for("executing")
    assert str(future.goal_id) != lost
    future.cancel()
