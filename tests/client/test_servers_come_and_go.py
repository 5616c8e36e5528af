"""Servers that appear, vanish, are busy, or are two (C5.1-C5.3, C5.5, C5.6)."""

from __future__ import annotations

import logging
import time
from types import SimpleNamespace

import pytest

import actionkit as ak
from actionkit import GoalState, RetryPolicy, Timeouts
from actionkit._calls.sending import session
from tests.conftest import NEVER, all_is_logged, is_accepted, runs_nothing
from tests.player import player
from tests.waiting import until

ONCE = RetryPolicy.none()
_QUESTIONS = 3
"""How often one client asks a server at most, before it takes it for busy."""


def test_a_call_waits_for_its_server(action_server, make_client):
    client = make_client(retry=ONCE, timeouts=Timeouts(server=None))
    future = client.call_async({"order": 3})
    assert future.state is GoalState.SENDING
    server = action_server("fibonacci")
    assert len(future.result(20).sequence) == 4
    assert len(server.wait_for("accepted")) == 1


@pytest.mark.parametrize("end", ["terminate", "interrupt"])
def test_a_clean_end_is_noticed(end, action_server, make_client):
    server = action_server("never_finishes")
    client = make_client(retry=ONCE)
    future = client.call_async({"order": 1})
    server.wait_for("executing")
    began = time.monotonic()
    getattr(server, end)()
    with pytest.raises(ak.ServerLostError) as caught:
        future.result(10)
    assert time.monotonic() - began < 2
    assert caught.value.transient
    assert future.outcome().status is GoalState.LOST
    server.restart()
    assert client.wait_for_server(20)
    again = client.call_async({"order": 1})
    server.wait_for("executing", count=2)
    again.cancel()
    assert again.outcome(10).status is GoalState.CANCELED


@pytest.mark.parametrize("end", ["terminate", pytest.param("kill", marks=pytest.mark.long)])
def test_a_node_that_only_publishes_feedback_is_not_a_server(
    end, action_server, make_client, caplog
):
    with player():
        server = action_server("never_finishes")
        client = make_client(retry=ONCE)
        future = client.call_async({"order": 1})
        server.wait_for("executing")
        until(client._session.connection.only_publishing)
        getattr(server, end)()
        began = time.monotonic()
        with pytest.raises(ak.ServerLostError):
            future.result(40)
        assert time.monotonic() - began < (2 if end == "terminate" else 30)
        with pytest.raises(ak.ServerUnavailableError) as caught:
            client.call({"order": 1}, timeout=0.5)
        assert "is published by /player, without its services" in str(caught.value)
        server.restart()
        assert is_accepted(client.call_async({"order": 1}))
    assert "has 2 servers" not in caplog.text


@pytest.mark.long
def test_the_last_word_of_a_server_does_not_seem_to_bring_it_back(
    action_server, make_client, own_threads
):
    rest = ["accept", "never"]
    server = action_server("scripted", script=[rest, [{"feedback": 13, "period": 0.1}], rest])
    client = make_client(retry=ONCE)
    assert client.wait_for_server(10)
    futures = [client.call_async({"order": 1})]
    client.call({"order": 1})  # takes more than a second, so the status topic is read by now
    # Faster than it is read: some of it is there to be read when the server is gone.
    futures += [client.call_async({"order": 1}) for _ in range(8)]
    server.wait_for("executing", count=10)
    server.terminate()
    for future in futures:
        assert future.outcome(10).status is GoalState.LOST
    with pytest.raises(TimeoutError):
        client.call_async({"order": 1}).result(0.3)  # long enough for what is left to be read
    client.close()
    # A goal that still seemed to be on a server would be watched, and keep the thread.
    assert "actionkit" not in own_threads()


@pytest.mark.long
def test_no_more_lost_goals_are_kept_than_can_be(action_server, make_client, monkeypatch, caplog):
    monkeypatch.setattr(session, "_MOST", 3)
    server = action_server("never_finishes")
    client = make_client(retry=RetryPolicy.none())
    futures = [client.call_async({"order": 1}) for _ in range(6)]
    assert all(map(is_accepted, futures))
    server.terminate()
    assert [type(future.exception(30)) for future in futures] == [ak.ServerLostError] * 6
    assert client._session.connection.table_sizes()["goals"] == 3
    assert all_is_logged()
    forgotten = [r.args[0] for r in caplog.records if "it is not cancelled any more" in r.msg]
    assert len(forgotten) == 3
    assert {future.known_to_run for future in futures} == {None}  # none is known to have stopped


@pytest.mark.long
def test_a_killed_server_is_noticed_with_its_lease(action_server, make_client):
    server = action_server("never_finishes")
    future = make_client(retry=ONCE).call_async({"order": 1})
    server.wait_for("executing")
    server.kill()
    with pytest.raises(ak.ServerLostError):
        future.result(40)


@pytest.mark.long
def test_a_killed_server_does_not_outlast_the_deadline(action_server, make_client):
    server = action_server("never_finishes")
    client = make_client(retry=ONCE, timeouts=Timeouts(cancel=0.5))
    assert client.wait_for_server(10)
    future = client.call_async({"order": 1}, timeout=1.0)
    server.wait_for("executing")
    server.kill()
    began = time.monotonic()
    with pytest.raises(ak.DeadlineExceededError) as caught:
        future.result(20)
    assert time.monotonic() - began < 3
    assert caught.value.cancel is ak.CancelReport.UNKNOWN


@pytest.mark.parametrize("point", ["before_accept", "after_accept", "feedback", "before_result"])
def test_a_crash_at_any_point_never_looks_like_success(point, action_server, make_client):
    action_server("crashes", point=point)
    client = make_client(retry=ONCE, timeouts=Timeouts(accept=0.5, cancel=0.3))
    assert client.wait_for_server(10)
    with pytest.raises(ak.ActionKitError) as caught:
        client.call({"order": 5}, timeout=4)
    assert isinstance(
        caught.value,
        ak.AcceptanceTimeoutError | ak.DeadlineExceededError | ak.ResultLostError,
    )


@pytest.mark.parametrize("how", ["blocked in its callback", "stopped"])
def test_a_silent_server_is_not_lost(how, action_server, make_client):
    if how == "stopped":
        server = action_server("fibonacci", gate=1)
    else:
        server = action_server("blocking", gate=1)
    client = make_client(retry=ONCE)
    future = client.call_async({"order": 3})
    server.wait_for("executing")
    if how == "stopped":
        server.pause()
    with pytest.raises(TimeoutError):
        future.result(3.0)  # a local wait, longer than C5.2 and C5.3 allow for a loss
    assert not future.done()
    assert future.state in (GoalState.ACCEPTED, GoalState.EXECUTING, GoalState.SENT)
    if how == "stopped":
        server.resume()
    server.release()
    assert future.result(10)


def test_two_servers_give_one_outcome_and_one_warning(action_server, make_client, caplog):
    server = action_server("twins", gate=1)
    with caplog.at_level(logging.WARNING, "actionkit"):
        client = make_client(retry=ONCE)
        assert client.wait_for_server(10)
        held = client.call_async({"order": 3})
        with pytest.raises(TimeoutError):
            held.result(1.5)  # the names in the warning are known after a moment
        server.release()
        assert list(held.result(10).sequence) == [0, 1, 1, 2]
        for _ in range(10):
            assert list(client.call({"order": 3}, 10).sequence) == [0, 1, 1, 2]
    assert all_is_logged()
    warnings = [r for r in caplog.records if "servers" in r.getMessage()]
    assert len(warnings) == 1


def test_servers_that_come_at_one_moment_count_once(action_server, make_client):
    """Fast DDS may tell of both in its first event, and then of the second one again."""
    action_server("twins")
    client = make_client()
    link = client._session.connection.link
    assert until(lambda: len(link.readiness.servers) == 2 and link.readiness.ready)

    def tell_again() -> int:
        event = SimpleNamespace(total_count=2, total_count_change=1, current_count=2)
        matched = link._entities.matched
        handler = matched._handler
        matched.use(SimpleNamespace(take_data=lambda: event))
        matched.take()
        matched.use(handler)  # the thread waits for that one
        return len(link.readiness.servers)

    assert client._session.connection.runtime.run(tell_again) == 2


def test_both_servers_see_the_cancel(action_server, make_client):
    server = action_server("twins", gate=1)
    client = make_client(retry=ONCE)
    assert client.wait_for_server(10)
    future = client.call_async({"order": 3})
    server.wait_for("executing", count=2)
    future.cancel()
    assert future.outcome(10).status is GoalState.CANCELED
    server.wait_for("canceled", count=2)
    assert runs_nothing(server)


def test_a_goal_that_one_server_finished_is_cancelled_on_the_other(action_server, make_client):
    action_server("fibonacci")
    client = make_client(retry=ONCE)
    assert client.call({"order": 1}, 10)
    endless = action_server("never_finishes")
    give_up = time.monotonic() + 20
    while not endless.count("accepted"):  # it takes a moment to be known to us
        assert time.monotonic() < give_up
        assert list(client.call({"order": 1}, 10).sequence) == [0, 1]
    last = client.call_async({"order": 1})
    assert last.result(10)
    endless.wait_for("canceled", goal_id=str(last.goal_id))
    assert runs_nothing(endless)


@pytest.mark.long
def test_nobody_is_asked_again_when_both_servers_have_ended_a_goal(
    action_server, make_client, caplog
):
    server = action_server("twins", gate=1)
    client = make_client(retry=ONCE)
    assert client.wait_for_server(10)
    future = client.call_async({"order": 3})
    server.wait_for("executing", count=2)
    server.release()
    assert future.result(10)
    give_up = time.monotonic() + 10  # for less time than it would be asked for without success
    both_ended = False
    while client._session.connection.table_sizes()["goals"] or not both_ended:
        both_ended = server.count("succeeded") + server.count("canceled") == 2
        assert time.monotonic() < give_up
        NEVER.wait(0.01)
    assert all_is_logged()
    assert "MAY STILL BE RUNNING" not in caplog.text


@pytest.mark.long
def test_the_death_of_our_thread_fails_every_call_loudly(action_server, make_client, caplog):
    server = action_server("never_finishes")
    client = make_client(retry=ONCE)
    future = client.call_async({"order": 1})
    server.wait_for("executing")

    def die() -> None:
        raise SystemExit("for the test")  # what no handler of ours catches

    client._session.connection.runtime.call_soon(die)
    with pytest.raises(ak.ServerLostError, match="communication thread") as lost:
        future.result(10)
    assert "no longer wants it" not in str(lost.value)  # the caller did not give up
    assert all_is_logged()
    assert "communication thread" in caplog.text
    with pytest.raises(
        ak.ClientClosedError, match="thread of ActionKit died: make a new"
    ) as caught:
        client.call_async({"order": 1})
    assert isinstance(caught.value.__cause__, SystemExit)
    with pytest.raises(ak.ClientClosedError):
        client.wait_for_server(10)
    assert client.closed
    again = make_client().call_async({"order": 1})
    server.wait_for("executing", count=2)
    again.cancel()
    assert again.outcome(10).status is GoalState.CANCELED


@pytest.mark.long
def test_a_deaf_server_does_not_block_the_goals_behind(action_server, make_client):
    # More goals than may be unanswered at a time: each still has its own end.
    action_server("silent")
    client = make_client(retry=ONCE, timeouts=Timeouts(accept=0.3, cancel=0.2))
    assert client.wait_for_server(10)
    futures = [client.call_async({"order": 1}) for _ in range(20)]
    for future in futures:
        with pytest.raises(ak.AcceptanceTimeoutError):
            future.result(20)


@pytest.mark.long
def test_a_busy_server_is_asked_a_few_times_and_no_more(action_server, make_client):
    """Each question waits in its queue, and an rclpy server may be held up by each for 0.1 s."""
    server = action_server("blocking", gate=1)
    first = make_client().call_async({"order": 1}, timeout=60)
    server.wait_for("executing")
    server.sync()
    before = server.count("cancel_requested")
    newcomer = make_client()
    assert newcomer.wait_for_server(30)  # it counts as busy
    server.release()
    assert first.result(30)
    assert newcomer.call({"order": 1}, 30)  # what it asked is answered by now
    server.sync()
    assert server.count("cancel_requested") - before <= _QUESTIONS


@pytest.mark.long
def test_fresh_clients_ask_a_server_a_few_times_each(action_server, make_client):
    server = action_server("fibonacci")
    for _ in range(10):
        with make_client() as client:  # with a node of its own
            assert client.call({"order": 1}, 30)
    server.sync()
    assert server.count("cancel_requested") <= 10 * _QUESTIONS
