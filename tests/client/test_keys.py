"""A call with a key is done once, however often its program dies (C12)."""

from __future__ import annotations

import sqlite3
import threading
import uuid
from contextlib import closing, suppress
from pathlib import Path

import pytest
from test_msgs.action import NestedMessage

import actionkit as ak
from actionkit import Ledger, RetryPolicy, Timeouts, Verdict
from actionkit._calls.ledger.keys import Asked, KeyState
from actionkit._ros.communication.outbox import WINDOW
from tests.conftest import cancels, runs_nothing
from tests.waiting import until

PROGRAM = """
import sys
from actionkit import Client, RetryPolicy, Verdict
from test_msgs.action import Fibonacci
retry = RetryPolicy(attempts=3, initial=0, jitter=0)
client = Client(Fibonacci, "fibonacci", retry=retry, classify=lambda _: {verdict})
future = client.call_async({{"order": {order}}}, key="leg")
print(future.goal_id, flush=True)
sys.stdin.read()
"""


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ACTIONKIT_LEDGER", str(tmp_path / "goals.db"))
    return tmp_path / "goals.db"


def killed(run_script, server, order=100, event="executing", count=1, verdict=None):
    """Start a program with a goal, and kill it when the server has come so far."""
    program = run_script(PROGRAM.format(order=order, verdict=verdict))
    goal_id = program.line()
    server.wait_for(event, count=count)
    program.process.kill()
    program.process.wait(20)
    return goal_id


def test_what_has_succeeded_is_not_sent_again_and_needs_no_server(action_server, make_client, path):
    server = action_server("fibonacci")
    client = make_client()
    first = client.call_async({"order": 3}, key="leg").outcome(20)
    server.stop()
    again = make_client().call_async({"order": 3}, key="leg", timeout=0.5).outcome(20)
    assert (first.from_ledger, again.from_ledger) == (False, True)
    assert again.result == first.result
    assert again.ok
    assert again.attempts == 0
    assert again.goal_id == first.goal_id
    (event,) = again.timeline
    assert event.detail.startswith("kept in the ledger since 20")
    assert Ledger(path).keys() == {"leg": "succeeded"}
    assert Ledger(path).leftovers() == []


def test_calls_with_keys_give_up_their_places_in_the_window(action_server, make_client, path):
    action_server("fibonacci", period=0.0)
    client = make_client()
    for leg in range(WINDOW + 2):
        client.call({"order": 1}, timeout=20.0, key=f"leg {leg}")


def test_a_goal_that_runs_is_followed(action_server, make_client, run_script, path):
    server = action_server("fibonacci", gate=1)
    goal_id = killed(run_script, server, order=10)
    (left,) = Ledger(path).leftovers()
    assert left.key == "leg"
    client = make_client()
    future = client.call_async({"order": 10}, key="leg")
    assert str(future.goal_id) == goal_id
    future.wait_accepted(20)
    server.release()
    assert len(future.result(30).sequence) == 11
    assert not future.outcome().from_ledger
    assert len(client.call({"order": 10}, key="leg").sequence) == 11
    assert server.count("goal_received") == 1


def test_giving_up_cancels_the_goal_that_is_followed(action_server, make_client, run_script, path):
    server = action_server("never_finishes")
    killed(run_script, server)
    client = make_client()
    assert client.wait_for_server(20)
    with pytest.raises(ak.DeadlineExceededError):
        client.call({"order": 100}, timeout=1.0, key="leg")
    assert runs_nothing(server)
    until(lambda: Ledger(path).keys() == {"leg": "stopped"})


def test_a_goal_is_cancelled_or_left_over_if_its_call_gives_up_before_a_server_is_seen(
    action_server, make_client, run_script, path
):
    server = action_server("never_finishes")
    killed(run_script, server)
    client = make_client(timeouts=Timeouts(cancel=20.0))
    outcome = client.call_async({"order": 100}, timeout=0.01, key="leg").outcome(30)
    assert isinstance(outcome.error, ak.DeadlineExceededError)
    assert runs_nothing(server)
    until(lambda: Ledger(path).keys() == {"leg": "stopped"})

    killed(run_script, server, count=2)
    (left,) = Ledger(path).leftovers()
    server.stop()
    client = make_client(timeouts=Timeouts(cancel=0.2))
    outcome = client.call_async({"order": 100}, timeout=0.01, key="leg").outcome(20)
    assert isinstance(outcome.error, ak.ServerUnavailableError)
    assert [str(goal.goal_id) for goal in outcome.goals if goal.fate.may_run] == [str(left.goal_id)]
    assert [goal.goal_id for goal in Ledger(path).leftovers()] == [left.goal_id]


def test_a_goal_is_left_over_if_its_call_does_not_begin(
    action_server, make_client, run_script, path
):
    server = action_server("never_finishes")
    goal_id = killed(run_script, server)
    client = make_client()
    other = client.attach(uuid.UUID(goal_id), on_give_up="leave")
    other.wait_accepted(20)
    with pytest.raises(ValueError, match=goal_id):
        client.call({"order": 100}, key="leg")
    until(Ledger(path).leftovers)


def test_a_client_goes_on_after_its_server_was_restarted(action_server, make_client, path):
    server = action_server("never_finishes")
    client = make_client()
    future = client.call_async({"order": 1}, key="leg")
    server.wait_for("executing")
    server.restart()
    assert isinstance(future.outcome(20).error, ak.ServerLostError)
    assert client.wait_for_server(20)
    with pytest.raises(ak.GoalUnknownError):
        client.call({"order": 1}, timeout=20.0, key="leg")
    assert Ledger(path).forget("leg")


def test_goals_that_no_server_knows_hold_up_no_others(action_server, make_client, run_script, path):
    server = action_server("fibonacci", gate=1)
    killed(run_script, server)
    server.restart()
    client = make_client()
    assert client.wait_for_server(20)
    future = client.call_async({"order": 100}, key="leg")
    until(lambda: client._session.watched(future.goal_id))
    assert client._session.connection.table_sizes()["outbox"] == 0
    assert isinstance(future.outcome(20).error, ak.GoalUnknownError)


@pytest.mark.parametrize(
    ("kind", "options"),
    [("aborts", {}), ("flaky", {"fails": 1, "how": "rejects"}), ("never_finishes", {})],
)
def test_what_has_failed_is_sent_again(kind, options, action_server, make_client, path):
    server = action_server(kind, **options)
    client = make_client()
    for time_ in (1, 2):
        future = client.call_async({"order": 1}, timeout=20.0, key="leg")
        if kind == "never_finishes":
            server.wait_for("executing", count=time_)
            future.cancel()
        outcome = future.outcome(20)
        assert server.count("goal_received") == time_
        assert outcome.ok == (kind == "flaky" and time_ == 2)
    assert Ledger(path).keys() == {"leg": "succeeded" if kind == "flaky" else "stopped"}


def test_a_goal_that_failed_after_its_program_was_killed_is_sent_again(
    action_server, make_client, run_script, path
):
    server = action_server("flaky", fails=1, how="aborts", period=0.3)
    killed(run_script, server, order=5)
    server.wait_for("aborted")
    outcome = make_client().call_async({"order": 5}, timeout=20.0, key="leg").outcome(20)
    assert outcome.ok
    assert outcome.attempts == 1
    assert [goal.fate for goal in outcome.goals] == [ak.GoalFate.ENDED] * 2
    assert server.count("goal_received") == 2


def test_a_goal_that_may_have_finished_is_an_error_until_the_key_is_forgotten(
    action_server, make_client, run_script, path
):
    server = action_server("never_finishes")
    killed(run_script, server)
    server.kill()
    server.restart()
    retry = RetryPolicy(attempts=3, initial=0, jitter=0)
    client = make_client(retry=retry, classify=lambda _: Verdict.TRANSIENT)
    with pytest.raises(ak.GoalUnknownError, match=r"ledger\.forget\('leg'\)` lets it be sent"):
        client.call({"order": 100}, timeout=20.0, key="leg")
    ledger = Ledger(path)
    assert ledger.keys() == {"leg": "unknown"}
    assert server.count("goal_received") == 1
    assert ledger.forget("leg")
    assert not ledger.forget("leg")
    client.call_async({"order": 100}, key="leg")
    server.wait_for("executing", count=2)


def test_a_retry_is_followed(action_server, make_client, run_script, path):
    server = action_server("fibonacci", period=0.01)
    killed(run_script, server, order=50, count=2, verdict="Verdict.TRANSIENT")
    outcome = make_client().call_async({"order": 50}, timeout=20.0, key="leg").outcome(30)
    assert outcome.ok
    assert server.count("goal_received") == 2


def test_a_key_in_flight_is_not_used_a_second_time(action_server, make_client, run_script, path):
    server = action_server("never_finishes")
    client = make_client()
    future = client.call_async({"order": 1}, key="mine")
    with pytest.raises(ak.LedgerError, match="in the hands of another call of this process"):
        make_client().call_async({"order": 1}, key="mine")
    with pytest.raises(ak.LedgerError, match="in the hands of another call of this process"):
        Ledger(path).forget("mine")
    program = run_script(PROGRAM.format(order=100, verdict=None))
    goal_id = program.line()
    with pytest.raises(ak.LedgerError, match=f"process {program.process.pid} on .*{goal_id}"):
        client.call_async({"order": 100}, key="leg")
    server.wait_for("executing", count=2)
    with pytest.raises(ak.LedgerError, match="may still run"):
        Ledger(path).forget("leg")
    future.cancel()
    assert server.count("goal_received") == 2


def test_a_goal_that_its_call_has_left_is_followed_by_the_next_one(
    action_server, make_client, path
):
    server = action_server("slow_cancel", gate=1)
    client = make_client(timeouts=Timeouts(cancel=0.1))
    assert client.wait_for_server(20)
    with pytest.raises(ak.DeadlineExceededError):
        client.call({"order": 1}, timeout=0.5, key="leg")
    assert Ledger(path).keys() == {"leg": "running"}
    future = client.call_async({"order": 1}, timeout=20.0, key="leg")
    until(lambda: future.state is ak.GoalState.CANCELING)  # else it had ended before the call
    server.release()
    assert future.outcome(20).status is ak.GoalState.CANCELED
    assert server.count("goal_received") == 1
    until(lambda: Ledger(path).keys() == {"leg": "stopped"})


def test_a_key_is_for_one_goal_of_one_action(action_server, make_client, path):
    action_server("fibonacci")
    client = make_client()
    client.call({"order": 3}, timeout=20.0, key="leg")
    with pytest.raises(ValueError, match="another goal: order was 3, and not 4"):
        client.call({"order": 4}, key="leg")
    with pytest.raises(ValueError, match="another action: /fibonacci, and not /other"):
        make_client(name="other").call({"order": 3}, key="leg")
    nested = make_client(NestedMessage, "nested")
    nested._session.action_name = "/fibonacci"
    with pytest.raises(ValueError, match="another action type: test_msgs/action/Fibonacci"):
        nested.call({}, key="leg")
    with closing(sqlite3.connect(path)) as file, file:
        file.execute("UPDATE keys SET layout = 'that of an older package'")
    with pytest.raises(ValueError, match="another version of test_msgs/action/Fibonacci"):
        client.call({"order": 3}, key="leg")


@pytest.mark.parametrize(
    ("more", "text"),
    [
        ({"key": 3}, "key=3 must be a str"),
        ({"key": ""}, "must have 1 to 200 characters"),
        ({"key": "leg", "retry": RetryPolicy(resend="always")}, "does not go with RetryPolicy"),
    ],
)
def test_what_does_not_go_with_a_key_is_refused(more, text, make_client, path):
    with pytest.raises((TypeError, ValueError), match=text):
        make_client().call({"order": 1}, **more)


def test_a_key_needs_a_ledger(make_client):
    with pytest.raises(ValueError, match="needs a ledger"):
        make_client().call({"order": 1}, key="leg")


def test_what_the_guard_has_cancelled_is_sent_again(action_server, make_client, run_script, path):
    server = action_server("never_finishes")
    killed(run_script, server)
    ledger = Ledger(path)
    assert list(ledger.cancel(20).values()) == [ak.CancelReport.CONFIRMED]
    assert ledger.keys() == {"leg": "stopped"}
    make_client().call_async({"order": 100}, key="leg")
    server.wait_for("executing", count=2)


def test_what_had_ended_when_the_guard_cancelled_is_not_sent_again(
    action_server, make_client, run_script, path
):
    server = action_server("fibonacci", gate=1)
    killed(run_script, server, order=3)
    server.release()
    server.wait_for("succeeded")
    ledger = Ledger(path)
    assert list(ledger.cancel(20).values()) == [ak.CancelReport.NOT_NEEDED]
    assert ledger.keys() == {"leg": "unknown"}
    assert make_client().call({"order": 3}, timeout=20.0, key="leg").sequence
    assert ledger.keys() == {"leg": "succeeded"}
    assert server.count("goal_received") == 1


def test_nothing_is_sent_if_the_disk_is_full(action_server, make_client, path):
    server = action_server("fibonacci")
    client = make_client()
    db = client._session.ledger._store._db
    db.execute("PRAGMA max_page_count=1")
    with suppress(ak.LedgerError):
        for i in range(1000):
            client.call({"order": 1}, timeout=20.0, key=f"leg {i}")
    sent = server.count("goal_received")
    with pytest.raises(ak.LedgerError, match="is full"):
        client.call_async({"order": 1}, key="another")
    server.sync()
    assert server.count("goal_received") == sent


def test_a_result_that_cannot_be_written_is_a_success_and_is_asked_for_again(
    action_server, make_client, path, caplog
):
    server = action_server("fibonacci", gate=1)
    client = make_client()
    future = client.call_async({"order": 1}, timeout=20.0, key="leg")
    server.wait_for("executing")
    store = client._session.ledger._store
    store._db.execute("PRAGMA query_only=1")
    server.release()
    assert future.outcome(20).ok
    until(lambda: "the end of the call with key 'leg' could not be written down" in caplog.text)
    store._db.execute("PRAGMA query_only=0")
    assert client.call({"order": 1}, timeout=20.0, key="leg").sequence
    assert server.count("goal_received") == 1


WAITS = """
import sys
from actionkit import Client, Timeouts
from test_msgs.action import Fibonacci
client = Client(Fibonacci, "fibonacci", timeouts=Timeouts(server=None))
future = client.call_async({"order": 1}, key="leg")
client._session.connection.runtime.run(lambda: None)
print("waits", flush=True)
sys.stdin.read()
"""
PAUSES = """
import sys
from actionkit import Client, GoalState, RetryPolicy, Verdict
from test_msgs.action import Fibonacci
client = Client(Fibonacci, "fibonacci", retry=RetryPolicy(attempts=2, initial=60, max_pause=60))
passes = lambda _: Verdict.TRANSIENT
future = client.call_async({"order": 1}, key="leg", classify=passes)
while future.state is not GoalState.RETRYING:
    pass
print("pauses", flush=True)
sys.stdin.read()
"""


@pytest.mark.parametrize("source", [WAITS, PAUSES])
def test_what_was_not_sent_when_its_program_was_killed_is_sent(
    source, action_server, make_client, run_script, path
):
    server = None if source == WAITS else action_server("flaky", fails=1, how="rejects")
    program = run_script(source)
    program.line()
    until(lambda: Ledger(path).keys() == {"leg": "stopped"})
    program.process.kill()
    program.process.wait(20)
    server = server or action_server("fibonacci")
    outcome = make_client().call_async({"order": 1}, timeout=20.0, key="leg").outcome(20)
    assert outcome.ok


def test_a_goal_that_is_sent_anew_is_found_by_the_guard(
    action_server, make_client, run_script, path
):
    server = action_server("flaky", fails=1, how="aborts", period=0.1)
    client = make_client(retry=RetryPolicy.none())
    assert not client.call_async({"order": 40}, timeout=60.0, key="leg").outcome(60).ok
    with closing(sqlite3.connect(path)) as file, file:
        file.execute("UPDATE keys SET state = 0")  # as if it had been killed before that
    future = client.call_async({"order": 40}, timeout=60.0, key="leg")
    server.wait_for("executing", count=2)
    with closing(sqlite3.connect(path)) as file:
        assert file.execute("SELECT attempts FROM goals").fetchone() == (2,)
    future.cancel()
    assert future.outcome(20).status is ak.GoalState.CANCELED


def test_a_success_by_classify_is_not_sent_again_after_a_kill(action_server, make_client, path):
    server = action_server("aborts")
    client = make_client(classify=lambda _: Verdict.SUCCESS)
    assert client.call_async({"order": 1}, timeout=20.0, key="leg").outcome(20).ok
    with closing(sqlite3.connect(path)) as file, file:
        file.execute("UPDATE keys SET state = 0, result = NULL")  # as if it had been killed
    assert client.call_async({"order": 1}, timeout=20.0, key="leg").outcome(20).ok
    assert Ledger(path).keys() == {"leg": "succeeded"}
    assert server.count("goal_received") == 1


def test_an_abort_that_nobody_has_judged_may_be_a_success(action_server, make_client, path):
    script = ["refuse_cancel", "accept", "gate", {"abort": [7]}]
    server = action_server("scripted", script=script)
    client = make_client(
        classify=lambda outcome: Verdict.SUCCESS if outcome.result else None,
        timeouts=Timeouts(cancel=20.0),
    )
    future = client.call_async({"order": 1}, timeout=1.0, key="leg")
    until(lambda: cancels(server))
    server.release()
    assert isinstance(future.outcome(30).error, ak.DeadlineExceededError)
    until(lambda: Ledger(path).keys() == {"leg": "unknown"})
    assert list(client.call({"order": 1}, timeout=20.0, key="leg").sequence) == [7]
    assert server.count("goal_received") == 1


def test_the_result_is_kept_as_the_server_sent_it(action_server, make_client, path):
    def spoils(outcome):
        outcome.result._sequence = ["x"]

    action_server("fibonacci")
    client = make_client(classify=spoils)
    assert client.call_async({"order": 3}, timeout=20.0, key="leg").outcome(20).ok
    assert list(client.call({"order": 3}, key="leg").sequence) == [0, 1, 1, 2]


def test_a_goal_that_was_left_running_on_purpose_is_not_forgotten(action_server, make_client, path):
    server = action_server("never_finishes")
    client = make_client(on_close="abandon")
    client.call_async({"order": 1}, key="leg")
    server.wait_for("executing")
    client.close()
    ledger = Ledger(path)
    assert ledger.keys() == {"leg": "running"}
    assert ledger.leftovers() == []
    with pytest.raises(ak.LedgerError, match="may still run"):
        ledger.forget("leg")
    future = make_client().call_async({"order": 1}, key="leg")
    future.wait_accepted(20)
    future.cancel()
    assert future.outcome(20).status is ak.GoalState.CANCELED
    assert ledger.keys() == {"leg": "stopped"}
    assert server.count("goal_received") == 1


ASKED = Asked("/a", "b/action/C", "fields", 0, b"goal")


def hold(path, key="leg"):
    return Ledger(path)._take(key, ASKED, lambda _: None, attempts=1, judged=False)


def write(step, *args, **how):
    done = threading.Event()
    step(*args, lambda _: done.set(), **how)
    assert done.wait(10)


def test_nothing_is_sent_if_the_file_was_removed(tmp_path):
    path = tmp_path / "goals.db"
    one = hold(path)
    for each in tmp_path.iterdir():
        each.unlink()
    problems: list[Exception | None] = []
    one.sends(1, problems.append)
    until(lambda: problems)
    assert isinstance(problems[0], ak.LedgerError)


def test_what_a_second_server_does_later_does_not_change_a_success(tmp_path):
    path = tmp_path / "goals.db"
    one = hold(path)
    write(one.sends, 1)
    write(one.end, KeyState.SUCCEEDED, b"result", runs=True)
    one.over = True
    write(one.end, KeyState.STOPPED, None, runs=False)
    assert hold(path).result == b"result"


def test_news_of_the_goal_count_as_long_as_no_later_call_has_the_key(tmp_path):
    path = tmp_path / "goals.db"
    one = hold(path)
    write(one.sends, 1)
    write(one.end, KeyState.SENT, None, runs=True)
    one.over = True
    two = hold(path)
    write(one.end, KeyState.STOPPED, None, runs=False)
    assert Ledger(path).keys() == {"leg": "running"}
    del two
    write(one.end, KeyState.STOPPED, None, runs=False)
    assert Ledger(path).keys() == {"leg": "stopped"}
    three = hold(path)
    write(three.sends, 1)
    write(one.end, KeyState.STOPPED, None, runs=False)
    assert Ledger(path).keys() == {"leg": "running"}


def test_a_call_that_does_not_begin_has_not_sent_its_goal(action_server, make_client, path):
    server = action_server("fibonacci")
    client = make_client()
    call = client._prepare({"order": 1}, None, 20.0, None, None, key="leg")
    client.close()
    with pytest.raises(ak.ClientClosedError):
        client._session.begin(call)
    client = make_client()
    assert client.call({"order": 1}, timeout=20.0, key="leg").sequence
    assert server.count("goal_received") == 1


def test_each_write_waits_for_the_disk_if_the_ledger_is_durable(tmp_path):
    path = tmp_path / "goals.db"

    def level(ledger):
        return ledger._store._db.execute("PRAGMA synchronous").fetchone()[0]

    assert level(Ledger(path)) == 1
    assert level(Ledger(path, durable=True)) == 2
    with pytest.raises(TypeError, match="durable='yes' must be a bool"):
        Ledger(path, durable="yes")
