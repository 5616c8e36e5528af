"""Attaching to a goal that somebody else has sent (C1.16)."""

from __future__ import annotations

import asyncio
import concurrent.futures
import threading
import time
import uuid
from types import SimpleNamespace

import pytest

import actionkit as ak
from actionkit import CancelReport, GoalFate, GoalState, RetryPolicy, Timeouts
from tests.conftest import cancels, runs_nothing
from tests.waiting import until

LONG = {"order": 100}
SETTINGS = {"timeouts": Timeouts(server=30.0, cancel=5.0)}


@pytest.fixture
def others(make_client):
    """A client that sends goals; another one attaches to them."""
    return make_client(**SETTINGS, on_close="abandon", retry=RetryPolicy.none())


@pytest.fixture
def client(make_client):
    return make_client(**SETTINGS)


def running(server, others, goal=LONG):
    future = others.call_async(goal)
    server.wait_for("executing", goal_id=str(future.goal_id))
    return future


def test_it_follows_a_goal_to_its_end(action_server, others, client):
    server = action_server("fibonacci", period=0.2, gate=1)
    theirs, heard = others.call_async({"order": 9}), []
    server.wait_for("executing")
    ours = client.attach(theirs.goal_id, on_feedback=heard.append)
    assert ours.goal_id == theirs.goal_id
    assert ours.wait_accepted(20).goal_id == theirs.goal_id
    until(lambda: ours.state is GoalState.EXECUTING and heard)
    server.release()
    outcome = ours.outcome(20)
    assert list(outcome.result.sequence) == list(theirs.result(20).sequence)
    assert (outcome.status, outcome.ok, outcome.cancel) == (GoalState.SUCCEEDED, True, None)
    assert outcome.feedback_count == len(heard) > 0
    states = [event.state for event in outcome.timeline if event.state is not GoalState.FEEDBACK]
    assert states == [GoalState.ACCEPTED, GoalState.EXECUTING, GoalState.SUCCEEDED]
    assert server.count("goal_received") == 1


def test_it_cancels_a_goal_of_another_client(action_server, others, client):
    server = action_server("never_finishes")
    theirs = running(server, others)
    ours = client.attach(str(theirs.goal_id))
    ours.cancel()
    assert ours.outcome(20).cancel is CancelReport.CONFIRMED
    assert ours.cancelled()
    with pytest.raises(ak.GoalCanceledError):
        theirs.result(20)
    assert runs_nothing(server)


def test_a_goal_that_an_earlier_call_gave_up_on_is_taken_over(action_server, make_client):
    script = ["refuse_cancel", "gate", "heed_cancel", {"feedback": 1}, "never"]
    server = action_server("scripted", script=script)
    client = make_client(timeouts=Timeouts(server=30.0, cancel=0.5))
    assert client.wait_for_server(20)
    earlier, heard = client.call_async(LONG, timeout=0.5), []
    assert earlier.outcome(20).cancel is CancelReport.REFUSED
    ours = client.attach(earlier.goal_id, on_feedback=heard.append)
    with pytest.raises(ValueError, match="is followed by this client already: use that future"):
        client.attach(earlier.goal_id)
    assert ours.wait_accepted(20).goal_id == earlier.goal_id
    asked = len(cancels(server))
    assert not earlier.cancel()  # it is for the new call to decide
    server.release()
    until(lambda: heard)
    assert (ours.state, earlier.known_to_run) == (GoalState.EXECUTING, True)
    assert len(cancels(server)) == asked
    ours.cancel()
    assert ours.outcome(20).cancel is CancelReport.CONFIRMED
    assert ours.cancelled()
    assert earlier.known_to_run is False
    assert runs_nothing(server)


@pytest.mark.parametrize("how", ["deadline", pytest.param("everything", marks=pytest.mark.long)])
def test_a_goal_that_an_earlier_call_is_cancelling_is_followed_to_its_end(
    how, action_server, make_client, others
):
    server = action_server("slow_cancel", gate=1)
    client = make_client(timeouts=Timeouts(server=30.0, cancel=0.3))
    assert client.wait_for_server(20)
    if how == "deadline":
        earlier = client.call_async(LONG, timeout=0.5)
        assert earlier.outcome(20).cancel is CancelReport.UNKNOWN
    else:
        earlier = running(server, others)
        assert client.cancel_everything(2.0)[earlier.goal_id] is CancelReport.UNKNOWN
    server.wait_for("cancel_accepted")
    ours = client.attach(earlier.goal_id)
    until(lambda: ours.state is GoalState.CANCELING)
    server.release()
    # `cancel_everything` cancels more than its own calls.
    who = "an earlier call of this client had" if how == "deadline" else "and not by this client"
    with pytest.raises(ak.GoalCanceledError, match=who):
        ours.result(20)
    until(lambda: earlier.known_to_run is False)


def test_a_goal_that_has_ended_gives_its_result(action_server, others, client):
    action_server("fibonacci")
    theirs = others.call_async({"order": 4})
    result = theirs.result(20)
    assert client.attach(theirs.goal_id).result(20) == result


def test_clear_ends(action_server, make_client, others, client):
    with pytest.raises(ak.ServerUnavailableError, match="is ready after"):
        make_client(name="nobody", timeouts=Timeouts(server=0.3)).attach(uuid.uuid4()).result(20)
    action_server("expires")
    unknown = uuid.uuid4()
    future = client.attach(unknown)
    with pytest.raises(ak.GoalUnknownError, match=f"'/fibonacci' knows goal {unknown}") as caught:
        future.result(20)
    assert "`actionkit watch` shows" in str(caught.value)
    assert future.outcome(0).goals[0].fate is GoalFate.ENDED
    expired = others.call_async({"order": 1})
    expired.outcome(20)
    lost = (ak.ResultLostError, ak.GoalUnknownError)  # it forgets the result first
    until(lambda: isinstance(client.attach(expired.goal_id).exception(20), lost))


def test_wrong_arguments_are_explained(client):
    for wrong, error, told in (
        ("abc", ValueError, "'abc' is not a goal id, which has 32 hexadecimal digits"),
        (uuid.UUID(int=0), ValueError, "servers take it for all goals"),
        (7, TypeError, "7 must be the id of a goal: a uuid.UUID, or text"),
    ):
        with pytest.raises(error, match=told):
            client.attach(wrong)
    with pytest.raises(ValueError, match="on_give_up='stop' must be 'leave' or 'cancel'"):
        client.attach(uuid.uuid4(), on_give_up="stop")
    future = client.attach(goal := uuid.uuid4())
    with pytest.raises(ValueError, match="is followed by this client already"):
        client.attach(goal)
    future.cancel()


@pytest.mark.parametrize("on_give_up", ["leave", "cancel"])
@pytest.mark.parametrize("how", ["deadline", "task", "close"])
def test_giving_up_leaves_it_or_cancels_it(how, on_give_up, action_server, others, client):
    server = action_server("never_finishes")
    theirs = running(server, others)
    timeout = 0.5 if how == "deadline" else None
    ours = client.attach(theirs.goal_id, timeout=timeout, on_give_up=on_give_up)
    ours.wait_accepted(20)
    if how == "task":

        async def main():
            with pytest.raises(asyncio.TimeoutError):
                await asyncio.wait_for(ours, 0.05)

        asyncio.run(main())
        assert ours.done() == (on_give_up == "cancel")
    elif how == "close":
        client.close()
        with pytest.raises(ak.ClientClosedError) as caught:
            ours.result(0)
    else:
        with pytest.raises(ak.DeadlineExceededError) as caught:
            ours.result(20)
    if on_give_up == "leave":
        if how != "task":
            assert " It was left to run on the server. " in str(caught.value)
            assert caught.value.cancel is CancelReport.UNKNOWN
        assert not theirs.done()
        assert str(theirs.goal_id) in server.running()
        assert cancels(server) == []
        theirs.cancel()
    with pytest.raises((ak.GoalCanceledError, concurrent.futures.CancelledError)):
        theirs.result(20)
    assert runs_nothing(server)


@pytest.mark.parametrize("how", ["terminate", pytest.param("kill", marks=pytest.mark.long)])
def test_a_server_that_ends_is_noticed(how, action_server, others, client):
    server = action_server("never_finishes")
    theirs = running(server, others)
    ours = client.attach(theirs.goal_id)
    ours.wait_accepted(20)
    getattr(server, how)()
    server.restart()
    with pytest.raises((ak.ServerLostError, ak.ResultLostError)):
        ours.result(60)
    # The new one does not know it. One that was killed is in sight for 20 s more, and silent.
    unknown = ak.GoalUnknownError
    until(lambda: isinstance(client.attach(theirs.goal_id).exception(60), unknown), bound=60.0)


def test_two_attach_while_another_cancels(action_server, others, client, make_client):
    server = action_server("slow_cancel", gate=1)
    theirs = running(server, others)
    second = make_client(**SETTINGS)
    futures = [client.attach(theirs.goal_id), second.attach(theirs.goal_id)]
    theirs.cancel()
    server.wait_for("cancel_accepted")
    futures.append(make_client(**SETTINGS).attach(theirs.goal_id))
    until(lambda: all(future.state is GoalState.CANCELING for future in futures))
    server.release()
    for future in futures:
        with pytest.raises(ak.GoalCanceledError):
            future.result(20)
    assert theirs.outcome(20).cancel is CancelReport.CONFIRMED


def test_a_silent_server_is_not_waited_for_without_end(action_server, client, make_client):
    server = action_server("blocking", gate=1)
    others = make_client(**SETTINGS, on_close="abandon")
    theirs = others.call_async({"order": 1})
    server.wait_for("executing")
    asking = make_client(timeouts=Timeouts(server=30.0, accept=0.5))
    assert others.server_is_ready()
    future = asking.attach(uuid.uuid4(), timeout=20)
    with pytest.raises((ak.AcceptanceTimeoutError, ak.ServerUnavailableError)):
        future.result(40)
    server.release()
    theirs.outcome(20)


def test_a_program_that_is_told_to_end_leaves_it_too(action_server, others, run_script):
    server = action_server("never_finishes")
    theirs = running(server, others)
    program = run_script(
        f"""
import actionkit, signal
from test_msgs.action import Fibonacci
actionkit.cancel_on_signals(signal.SIGTERM)
client = actionkit.Client(Fibonacci, "fibonacci")
future = client.attach("{theirs.goal_id}")
future.wait_accepted()
print("attached", flush=True)
print(type(future.exception()).__name__, flush=True)
"""
    )
    assert program.line() == "attached"
    program.process.terminate()
    program.finish()
    assert not theirs.done()
    assert str(theirs.goal_id) in server.running()
    assert cancels(server) == []
    theirs.cancel()
    theirs.outcome(20)


def test_everything_is_cancelled_also_what_others_have_sent(action_server, others, client):
    server = action_server("never_finishes")
    theirs = [running(server, others) for _ in range(3)]
    ours = running(server, client)
    told = client.cancel_everything()
    assert told == {future.goal_id: CancelReport.CONFIRMED for future in (*theirs, ours)}
    assert runs_nothing(server)
    assert client.cancel_everything() == {}
    assert client.pending == 0


def test_its_own_timeout_counts_for_goals_that_stop_slowly(action_server, make_client, others):
    server = action_server("slow_cancel", gate=1)
    client = make_client(timeouts=Timeouts(server=30.0, cancel=0.2))
    sent = [running(server, each) for each in (others, client)]
    told = []
    asking = threading.Thread(target=lambda: told.append(client.cancel_everything(20)))
    asking.start()
    assert sent[1].outcome(20).cancel is CancelReport.UNKNOWN  # its call ends before
    server.wait_for("cancel_accepted", count=2)
    server.release(2)
    asking.join(20)
    assert told == [{future.goal_id: CancelReport.CONFIRMED for future in sent}]
    assert runs_nothing(server)


def test_a_request_that_comes_late_cancels_nothing_that_was_sent_after_it(
    action_server, others, client, monkeypatch
):
    """The server gets it at once; but for its time stamp, it was sent before the goal."""
    server = action_server("never_finishes")
    theirs = running(server, others)
    monkeypatch.setattr("actionkit._ros.others_goals.watch.StatusReader._take", lambda *_: None)
    earlier = SimpleNamespace(monotonic=time.monotonic, time=lambda: time.time() - 60.0)
    monkeypatch.setattr("actionkit._calls.cancel_everything.time", earlier)
    assert client.cancel_everything() == {}
    server.sync()
    assert str(theirs.goal_id) in server.running()
    assert not theirs.done()


def test_what_refuses_is_told_and_followed_no_more(action_server, others, client):
    server = action_server("refuses_cancel", period=0.1)
    theirs = running(server, others)
    assert client.cancel_everything(3.0) == {theirs.goal_id: CancelReport.REFUSED}
    until(lambda: client.pending == 0)
    assert str(theirs.goal_id) in server.running()


def test_the_goals_of_a_server_that_stands_still_are_unknown(action_server, others, client):
    server = action_server("never_finishes")
    theirs = running(server, others)
    assert client.wait_for_server(20)
    server.pause()
    told = client.cancel_everything(2.0)
    assert told[uuid.UUID(int=0)] is CancelReport.UNKNOWN
    assert set(told.values()) == {CancelReport.UNKNOWN}
    server.resume()
    told = client.cancel_everything()
    assert uuid.UUID(int=0) not in told
    theirs.outcome(20)
    assert runs_nothing(server)


CANNOT_CANCEL_ALL = """
import rclpy
from action_msgs.srv import CancelGoal
from rclpy.action import ActionServer
from test_msgs.action import Fibonacci

class LikeRclc(ActionServer):
    async def _execute_cancel_request(self, header_and_message):
        response = CancelGoal.Response(return_code=CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID)
        self._handle.send_cancel_response(header_and_message[0], response)

rclpy.init()
node = rclpy.create_node("rclc")
server = LikeRclc(node, Fibonacci, "fibonacci", lambda handle: Fibonacci.Result())
print("up", flush=True)
rclpy.spin(node)
"""


def test_the_goals_of_a_server_that_cannot_cancel_all_are_unknown(run_script, client):
    assert run_script(CANNOT_CANCEL_ALL).line() == "up"
    assert client.wait_for_server(20)
    assert client.cancel_everything(5.0) == {uuid.UUID(int=0): CancelReport.UNKNOWN}


def test_without_a_server_nothing_counts_as_cancelled(client):
    with pytest.raises(
        ak.ServerUnavailableError, match="only this client's own calls were cancelled"
    ):
        client.cancel_everything(0.2)


def test_what_this_client_gave_up_on_before_is_cancelled_again(action_server, make_client):
    server = action_server("refuses_cancel", period=0.1)
    client = make_client(timeouts=Timeouts(server=30.0, cancel=0.5))
    future = client.call_async(LONG, timeout=1.0)
    assert isinstance(future.exception(20), ak.DeadlineExceededError)
    before = server.count("cancel_refused")
    assert client.cancel_everything(1.5) == {future.goal_id: CancelReport.REFUSED}
    assert server.count("cancel_refused") > before


def test_a_cancel_before_a_server_is_in_sight_is_not_lost(action_server, make_client, others):
    server = action_server("never_finishes")
    theirs = running(server, others)
    with make_client(timeouts=Timeouts(server=None, cancel=20.0)) as client:
        ours = client.attach(theirs.goal_id)
        ours.cancel()
    assert ours.cancelled()
    with pytest.raises(ak.GoalCanceledError):
        theirs.result(20)


def test_a_goal_that_was_never_followed_may_run(make_client):
    client = make_client(timeouts=Timeouts(server=None, cancel=0.3))
    ours = client.attach(uuid.uuid4())
    ours.cancel()
    error = ours.exception(20)
    assert isinstance(error, ak.DeadlineExceededError)
    assert (error.phase, error.cancel) == ("cancel", CancelReport.UNKNOWN)
    assert "no server was in sight within 0.3 s: IT MAY STILL BE RUNNING, and is not" in str(error)
    with pytest.raises(ak.GoalNotReplacedError, match="MAY STILL BE RUNNING"):
        client.call(LONG, 5.0, replaces=ours)


def test_goals_of_this_client_alone_are_waited_for_no_longer_than_they_take(action_server, client):
    server = action_server("never_finishes")
    ours = [running(server, client) for _ in range(2)]
    told = client.cancel_everything(1e6)  # the limit of the test is shorter
    assert told == {future.goal_id: CancelReport.CONFIRMED for future in ours}


def test_a_goal_of_this_client_that_stops_at_once_is_told_of(action_server, client, monkeypatch):
    future = running(action_server("never_finishes"), client)

    def wait_for_server(self, timeout):
        until(lambda: not self.calls)
        return True

    monkeypatch.setattr("actionkit._calls.sending.session.Session.wait_for_server", wait_for_server)
    assert client.cancel_everything(30) == {future.goal_id: CancelReport.CONFIRMED}
