"""Cancelling, giving up, and what happens to the goal (C1.5, C2.3, C2.4)."""

from __future__ import annotations

import concurrent.futures
import time

import pytest

import actionkit as ak
from actionkit import CancelReport, GoalState, Timeouts
from actionkit._calls.sending import session as _session
from actionkit.testing import EventLog
from tests.conftest import asked_to_cancel, cancels, is_accepted, runs_nothing
from tests.waiting import until

REFUSES_UNTIL_RELEASED = ["refuse_cancel", "gate", "heed_cancel", "never"]


def test_cancel_before_the_send_sends_nothing(action_server, make_client):
    client = make_client(timeouts=Timeouts(server=None))
    future = client.call_async({"order": 1})
    assert future.cancel()
    assert future.outcome(5).cancel is CancelReport.NOT_NEEDED
    assert future.cancelled()
    with pytest.raises(concurrent.futures.CancelledError):
        future.result()
    server = action_server("fibonacci")
    assert client.call({"order": 1}, 10)
    assert len(server.wait_for("goal_received")) == 1


def test_cancel_at_once_after_the_call_sends_nothing_or_cancels(action_server, make_client):
    server = action_server("never_finishes")
    client = make_client()
    assert client.wait_for_server(10)
    for _ in range(50):
        future = client.call_async({"order": 1})
        future.cancel()
        assert future.outcome(10).cancel in (CancelReport.CONFIRMED, CancelReport.NOT_NEEDED)
        assert future.cancelled()
    assert runs_nothing(server)


def test_cancel_while_it_runs(action_server, make_client):
    server = action_server("never_finishes")
    future = make_client().call_async({"order": 1})
    server.wait_for("executing")
    assert future.cancel()
    outcome = future.outcome(10)
    assert outcome.cancel is CancelReport.CONFIRMED
    assert outcome.status is GoalState.CANCELED
    assert isinstance(outcome.error, concurrent.futures.CancelledError)
    assert future.cancelled()
    assert GoalState.CANCELED in [event.state for event in outcome.timeline]
    assert runs_nothing(server)
    assert future.cancel()  # as in concurrent.futures: it is cancelled


def test_a_refused_cancel_leaves_the_goal_to_wait_for(action_server, make_client):
    server = action_server("refuses_cancel", period=0.05)
    future = make_client().call_async({"order": 10})
    server.wait_for("executing")
    future.cancel()
    assert list(future.result(10).sequence)
    server.sync()
    # Asked once more, where it runs for so long; a request that is not answered soon is repeated.
    assert 1 <= server.count("cancel_refused") <= 4
    assert future.outcome().cancel is CancelReport.REFUSED


@pytest.fixture
def refused(action_server, make_client):
    """A call that ended with a refused cancel; and its server, which heeds the next one."""
    server = action_server("scripted", script=REFUSES_UNTIL_RELEASED)
    client = make_client(timeouts=Timeouts(cancel=0.5))
    assert client.wait_for_server(20)
    future = client.call_async({"order": 1}, timeout=0.5)
    assert future.outcome(20).cancel is CancelReport.REFUSED
    assert future.known_to_run
    server.release()
    server.wait_for("step", count=4)
    return server, client, future


def test_a_future_whose_call_is_over_asks_again(refused):
    server, client, future = refused
    assert not future.cancel()
    server.wait_for("canceled")
    until(lambda: future.known_to_run is False)
    client.close()
    server.sync()
    assert server.count("cancel_accepted") == 1


@pytest.mark.parametrize("policy", ["cancel", "abandon"])
def test_closing_asks_again_for_what_was_refused(policy, refused):
    server, client, future = refused
    client._session._abandon = policy == "abandon"
    client.close()
    server.sync()
    asked = policy == "cancel"
    assert server.count("cancel_accepted") == asked
    assert future.known_to_run is not asked


REFUSED_BEFORE = """
import actionkit
from actionkit import Timeouts
from test_msgs.action import Fibonacci
actionkit.cancel_on_signals()
client = actionkit.Client(Fibonacci, "fibonacci", timeouts=Timeouts(cancel=0.5))
assert client.wait_for_server(20)
print(client.call_async({"order": 1}, timeout=0.5).outcome().cancel, flush=True)
input()
"""


@pytest.mark.long
@pytest.mark.parametrize("how", ["exit", "signal"])
def test_a_program_that_ends_asks_again_for_what_was_refused(how, action_server, run_script):
    server = action_server("scripted", script=REFUSES_UNTIL_RELEASED)
    program = run_script(REFUSED_BEFORE)
    assert program.line() == "REFUSED"
    server.release()
    server.wait_for("step", count=4)
    if how == "exit":
        print(file=program.process.stdin, flush=True)
    else:
        program.process.terminate()
    server.wait_for("canceled")
    program.process.wait(20)


def test_a_cancel_that_is_not_confirmed_ends_the_call(action_server, make_client):
    server = action_server("slow_cancel", gate=1)
    future = make_client(timeouts=Timeouts(cancel=1.0)).call_async({"order": 1})
    server.wait_for("executing")
    future.cancel()
    assert not future.done()  # cancel() does not block
    with pytest.raises(ak.DeadlineExceededError) as caught:
        future.result(10)
    late = "the server is cancelling it, and did not end it within 1 s, the time of Timeouts(cancel"
    assert late in str(caught.value)
    assert caught.value.phase == "cancel"
    assert caught.value.cancel is CancelReport.UNKNOWN
    server.release()
    server.wait_for("canceled")


def test_late_acceptance_after_the_deadline_is_cancelled(action_server, make_client):
    server = action_server("slow_accept", gate=1, period=0.1)
    told = EventLog()
    client = make_client(timeouts=Timeouts(cancel=0.2), observers=[told])
    assert client.wait_for_server(10)
    with pytest.raises(ak.DeadlineExceededError) as caught:
        client.call({"order": 50}, timeout=0.3)
    assert caught.value.cancel is CancelReport.UNKNOWN
    assert server.count("accepted") == 0
    server.release()
    server.wait_for("canceled")
    assert runs_nothing(server)
    told.wait_for(lambda event: event.state is GoalState.CANCELED)  # though the call is over (C6.2)


def test_late_acceptance_after_closing_is_cancelled(action_server, make_client, own_threads):
    server = action_server("slow_accept", gate=1, period=0.1)
    client = make_client(timeouts=Timeouts(cancel=0.2))
    assert client.wait_for_server(10)
    future = client.call_async({"order": 50}, timeout=0.3)
    server.wait_for("goal_received")
    client.close()
    assert future.done()
    server.release()
    server.wait_for("canceled")
    assert runs_nothing(server)


def test_late_acceptance_during_the_grace_is_confirmed(action_server, make_client):
    server = action_server("slow_accept", gate=1, period=0.1)
    client = make_client(timeouts=Timeouts(cancel=5))
    assert client.wait_for_server(10)
    future = client.call_async({"order": 50}, timeout=0.2)
    server.wait_for("goal_received")
    with pytest.raises(TimeoutError, match="TIMED_OUT after the local wait"):
        future.result(0.6)
    server.release()
    with pytest.raises(ak.DeadlineExceededError) as caught:
        future.result(10)
    assert caught.value.cancel is CancelReport.CONFIRMED
    assert caught.value.phase == "accept"
    assert runs_nothing(server)


@pytest.mark.parametrize(
    ("given_up_by", "grace"),
    [("cancel", 2.0), ("cancel", 0.1), ("deadline", 2.0), ("deadline", 0.03)],
)
def test_a_goal_is_cancelled_while_its_server_is_still_accepting_it(
    run_script, make_client, given_up_by, grace
):
    """Then rclpy's server answers as if it refused, and as if there were no such goal (R12)."""
    server = run_script("from tests.accepting_server import main; main()", "0.15")
    assert server.line() == "up"
    client = make_client(timeouts=Timeouts(cancel=grace))
    assert client.wait_for_server(10)
    for _ in range(3):
        timeout = 0.05 if given_up_by == "deadline" else None
        future = client.call_async({"order": 1}, timeout=timeout)
        assert server.line() == "accepting"
        if given_up_by == "cancel":
            future.cancel()
        outcome = future.outcome(20)
        in_time = outcome.cancel is CancelReport.CONFIRMED
        # A refusal that was believed for want of time is asked about all the same.
        assert in_time == (grace > 1.0 or given_up_by == "cancel"), outcome.timeline
        goal = str(outcome.timeline[0].goal_id)
        assert [server.line(), server.line()] == [f"executing {goal}", f"canceled {goal}"]


def test_cancelling_one_leaves_the_others_alone(action_server, make_client):
    server = action_server("fibonacci", period=0.05, gate=1)
    client = make_client()
    seen: dict[int, list[list[int]]] = {}
    futures = {}
    for order in (4, 5, 6, 7):
        seen[order] = []
        futures[order] = client.call_async(
            {"order": order},
            on_feedback=lambda fb, order=order: seen[order].append(list(fb.sequence)),
        )
    server.wait_for("executing", count=4)
    assert is_accepted(futures[5])
    began = time.monotonic()
    futures[5].cancel()
    server.wait_for("canceled")
    futures[5].outcome(10)
    waited = time.monotonic() - began
    server.release()
    for order in (4, 6, 7):
        assert len(futures[order].result(10).sequence) == order + 1
        assert [len(s) for s in seen[order]] == list(range(3, order + 2))
    assert futures[5].cancelled()
    server.wait_for("succeeded", count=3)
    assert asked_to_cancel(server, futures[5].goal_id, waited=waited)


@pytest.mark.parametrize("policy", ["cancel", "abandon"])
def test_closing_settles_what_is_in_flight(policy, action_server, make_client, own_threads):
    server = action_server("never_finishes")
    client = make_client(on_close=policy)
    futures = [client.call_async({"order": 1}) for _ in range(3)]
    server.wait_for("executing", count=3)
    client.close()
    assert all(future.done() for future in futures)
    for future in futures:
        with pytest.raises(ak.ClientClosedError):
            future.result()
    if policy == "cancel":
        assert {f.outcome().cancel for f in futures} == {CancelReport.CONFIRMED}
        assert runs_nothing(server)
    else:
        assert {f.outcome().cancel for f in futures} == {CancelReport.UNKNOWN}
        assert len(server.running()) == 3
        assert cancels(server) == []
    assert "actionkit" not in own_threads()
    client.close()
    with pytest.raises(ak.ClientClosedError, match="closed"):
        client.call({"order": 1})


def test_closing_says_that_a_goal_was_never_sent(make_client):
    client = make_client()
    future = client.call_async({"order": 1})
    client.close()
    with pytest.raises(ak.ClientClosedError, match=r"was not sent: its client was closed first\."):
        future.result(0)
    assert future.outcome().cancel is CancelReport.NOT_NEEDED


@pytest.mark.long
def test_a_goal_that_is_watched_no_more_leaves_nothing_on_a_shared_thread(
    action_server, make_client, monkeypatch
):
    monkeypatch.setattr(_session, "LINGER", 0.1)
    server = action_server("silent")
    make_client(name="other")  # it keeps the thread
    client = make_client(timeouts=Timeouts(server=30.0, accept=60.0, cancel=0.2))
    future = client.call_async({"order": 1})
    server.wait_for("goal_received")
    session = client._session
    (attempt,) = session._attempts
    client.close()
    assert future.outcome(0).cancel is CancelReport.UNKNOWN
    assert session.connection.freed.wait(10)
    # One that is left asks over destroyed entities, and subscribes to the status again.
    assert len(attempt._timers) == 0


def test_a_silent_server_does_not_hold_up_closing(action_server, make_client, capfd, monkeypatch):
    # A test of a command may have muted it in this process.
    monkeypatch.setattr("actionkit._calls.futures.goals_left._muted", False)
    server = action_server("silent")
    client = make_client(timeouts=Timeouts(cancel=0.3))
    future = client.call_async({"order": 1})
    server.wait_for("goal_received")
    client.close()
    assert "1 goal MAY STILL BE RUNNING" in capfd.readouterr().err  # nobody has looked at its end
    with pytest.raises(ak.ClientClosedError, match=r"(?i)may still be running"):
        future.result(0)
