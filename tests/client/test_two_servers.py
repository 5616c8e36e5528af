"""Two servers answer on one name, and each runs every goal: what one says is not said of the other.

(C2.8, C4.2)
"""

from __future__ import annotations

import itertools
import os
import threading
import time
import uuid

import pytest

import actionkit as ak
from actionkit import CancelReport, GoalFate, GoalState, RetryPolicy, Timeouts, retry_aborted
from actionkit._ros.servers_in_sight.monitor import _IN_SIGHT_WITHIN
from actionkit.servers import _process
from tests.conftest import NEVER, all_is_logged, runs_nothing
from tests.waiting import until

ONCE = RetryPolicy.none()
PATIENT = Timeouts(server=30.0, accept=20.0)


def sees(client, servers: int) -> bool:
    """Whether the client comes to see so many servers, each of which answers."""
    give_up = time.monotonic() + 20
    readiness = client._session.connection.link.readiness
    while not (readiness.ready and len(readiness.servers) == servers):
        if time.monotonic() > give_up:
            return False
        NEVER.wait(0.01)
    return True


def test_what_one_server_aborts_is_not_sent_again_while_another_may_run_it(
    action_server, make_client
):
    stopped, aborts = action_server("never_finishes"), action_server("aborts")
    client = make_client(retry=RetryPolicy(attempts=3, initial=0.05), classify=retry_aborted())
    assert sees(client, 2)
    stopped.pause()
    with pytest.raises(ak.GoalAbortedError, match="may still run"):
        client.call({"order": 1}, 10)
    aborts.sync()
    assert aborts.count("accepted") == 1
    stopped.resume()
    # It takes the goal late, and is asked to cancel it.
    stopped.wait_for("canceled")
    assert runs_nothing(stopped)
    assert stopped.count("accepted") == 1


def test_a_cancel_is_not_confirmed_by_one_server_where_the_other_has_gone(
    action_server, make_client
):
    vanishes, slow = action_server("vanishes"), action_server("slow_accept", gate=1, period=0.1)
    client = make_client(retry=ONCE)
    assert sees(client, 2)
    future = client.call_async({"order": 50})
    vanishes.wait_for("vanished")
    slow.release()
    slow.wait_for("executing")
    future.cancel()
    outcome = future.outcome(10)
    slow.wait_for("canceled")
    assert outcome.error.cancel is CancelReport.UNKNOWN
    assert outcome.error.late_result is None  # the other one's is not that of a success
    assert str(future.goal_id) in str(outcome.error)
    assert [goal.fate for goal in outcome.goals] == [GoalFate.LOST]


@pytest.mark.long
def test_closing_waits_until_the_other_server_has_cancelled_what_has_ended(
    action_server, make_client
):
    """A program that ends at once would take the request to cancel it along."""
    quick, slow = action_server("fibonacci", gate=1), action_server("never_finishes")
    client = make_client(retry=ONCE, timeouts=Timeouts(server=30.0, cancel=20.0))
    assert sees(client, 2)
    future = client.call_async({"order": 1})
    for server in (quick, slow):
        server.wait_for("executing")
    slow.pause()
    quick.release()
    assert future.outcome(10).cancel is CancelReport.UNKNOWN
    resume = threading.Timer(0.3, slow.resume)
    resume.start()
    client.close()
    assert future.known_to_run is False
    slow.wait_for("canceled")


def test_who_cancels_waits_for_both_servers(action_server, make_client):
    quick, slow = action_server("never_finishes"), action_server("slow_accept", gate=1, period=0.1)
    client = make_client(retry=ONCE)
    assert sees(client, 2)
    future = client.call_async({"order": 50})
    quick.wait_for("executing")
    future.cancel()
    quick.wait_for("canceled")
    assert not future.done()
    slow.release()
    outcome = future.outcome(10)
    assert outcome.status is GoalState.CANCELED
    assert [goal.fate for goal in outcome.goals] == [GoalFate.ENDED]
    assert all(map(runs_nothing, (quick, slow)))


@pytest.mark.long
def test_a_server_that_accepts_after_the_other_has_refused_to_cancel_is_told_to(
    action_server, make_client
):
    """A refusal that is believed does not end the wish to cancel (C2.4)."""
    refuses = action_server("refuses_cancel", period=0.1)
    slow = action_server("slow_accept", gate=1, period=0.1)
    client = make_client(retry=ONCE, timeouts=Timeouts(cancel=1.0))
    assert sees(client, 2)
    future = client.call_async({"order": 50})
    refuses.wait_for("executing")
    future.cancel()
    until(lambda: any(event.cancel_refused for event in future.timeline))
    assert not future.done()
    slow.release()
    slow.wait_for("canceled", goal_id=str(future.goal_id))
    assert runs_nothing(slow)
    assert isinstance(future.exception(10), ak.DeadlineExceededError)  # nobody else cancelled it


@pytest.mark.long
def test_closing_names_each_goal_that_only_one_of_two_servers_has_cancelled(
    action_server, make_client, caplog, monkeypatch
):
    # A test of a command may have muted it in this process.
    monkeypatch.setattr("actionkit._calls.futures.goals_left._muted", False)
    quick, slow = action_server("never_finishes"), action_server("slow_accept", gate=1, period=0.1)
    client = make_client(retry=ONCE, timeouts=Timeouts(cancel=0.5))
    assert sees(client, 2)
    told = client.call_async({"order": 50}, timeout=0.5)
    assert told.exception(10).cancel is CancelReport.UNKNOWN
    future = client.call_async({"order": 50})
    quick.wait_for("executing", goal_id=str(future.goal_id))
    client.close()
    error = future.exception(10)
    assert isinstance(error, ak.ClientClosedError)
    assert error.cancel is CancelReport.UNKNOWN
    assert all_is_logged()
    last = [r.getMessage() for r in caplog.records if "RUNNING" in r.getMessage()][-1]
    assert last.startswith("2 goals MAY STILL BE RUNNING")
    assert all(str(each.goal_id) in last for each in (told, future))
    slow.release()
    slow.wait_for("canceled", count=2)  # the client looks after it for a while
    assert runs_nothing(slow)


def test_what_one_of_two_servers_has_stopped_may_run_on_the_other(action_server, make_client):
    quick, slow = action_server("never_finishes"), action_server("slow_cancel", gate=1)
    others = make_client(retry=ONCE, on_close="abandon")
    client = make_client(retry=ONCE, timeouts=Timeouts(cancel=0.5))
    assert sees(others, 2)
    assert sees(client, 2)
    future = others.call_async({"order": 50})
    for server in (quick, slow):
        server.wait_for("executing")
    ours = client.attach(future.goal_id)
    assert client.cancel_everything(2.0) == {future.goal_id: CancelReport.UNKNOWN}
    quick.wait_for("canceled")
    assert future.done()
    assert ours.known_to_run is not False
    slow.release()
    slow.wait_for("canceled")
    assert all(map(runs_nothing, (quick, slow)))


BUSY = """
import os, sys
import rclpy
from rclpy.action import ActionServer
from test_msgs.action import Fibonacci

def execute(handle):
    print(bytes(handle.goal_id.uuid).hex(), flush=True)
    sys.stdin.readline()  # it has no other thread
    server.destroy()
    os._exit(0)

rclpy.init()
node = rclpy.create_node(sys.argv[1])
server = ActionServer(node, Fibonacci, "fibonacci", execute)
print("up", flush=True)
rclpy.spin(node)
"""


def test_nothing_is_sent_while_a_server_that_seems_replaced_is_there(
    run_script, action_server, make_client, monkeypatch
):
    """Its silence, and the name of the second one, are a guess: it was started twice (C4.2)."""
    monkeypatch.setattr(_process, "_instances", itertools.repeat("twice"))
    first = run_script(BUSY, f"reference_server_{os.getpid()}_twice")
    assert first.line() == "up"
    policy = RetryPolicy(initial=0.05, jitter=0.0, resend="server_gone")
    client = make_client(retry=policy, timeouts=PATIENT)
    future = client.call_async({"order": 1}, timeout=60)
    busy = str(uuid.UUID(first.line()))
    NEVER.wait(2 * _IN_SIGHT_WITHIN)  # one that comes sooner may have got the goal, too
    second = action_server("fibonacci")
    second.wait_for("cancel_requested", goal_id=busy, count=2, timeout=20)
    until(lambda: future._call.machine._waits_for_earlier)
    assert (future.state, second.count("goal_received")) == (GoalState.SENDING, 0)
    (lost,) = (event for event in future.timeline if event.state is GoalState.LOST)
    assert lost.detail.startswith("it was restarted, or started twice")
    assert first.finish()[0] == 0
    assert len(future.result(20).sequence) == 2
    assert future.outcome().attempts == 2


def test_a_server_that_only_seems_replaced_cancels_for_this_client(
    action_server, make_client, monkeypatch
):
    """Its successor does not know the goal, which tells nothing of the request to the first one."""
    monkeypatch.setattr(_process, "_instances", itertools.repeat("twice"))
    first = action_server("never_finishes")
    policy = RetryPolicy(initial=0.05, jitter=0.0, resend="server_gone")
    client = make_client(retry=policy, timeouts=PATIENT)
    future = client.call_async({"order": 1}, timeout=60)
    earlier = str(future.goal_id)
    first.wait_for("executing")
    NEVER.wait(2 * _IN_SIGHT_WITHIN)  # one that comes sooner may have got the goal, too
    first.pause()
    second = action_server("never_finishes")
    second.wait_for("cancel_requested", goal_id=earlier, count=2, timeout=20)
    until(lambda: future._call.machine._waits_for_earlier)
    first.resume()
    first.wait_for("canceled", goal_id=earlier)
    assert second.wait_for("accepted")  # the next goal: nobody else has cancelled the first one
    assert not future.done()
    future.cancel()
    assert future.outcome(20).attempts == 2
    assert runs_nothing(second)
