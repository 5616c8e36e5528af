"""What a process that was killed leaves is known, and can be cancelled or followed (C12)."""

from __future__ import annotations

import sqlite3
import uuid
from contextlib import suppress
from pathlib import Path

import pytest

import actionkit as ak
from actionkit import Ledger, RetryPolicy
from tests.conftest import runs_nothing
from tests.waiting import until

PROGRAM = """
import sys
from actionkit import Client, RetryPolicy, Verdict
from test_msgs.action import Fibonacci
retry = RetryPolicy(attempts=3, initial=0, jitter=0)
client = Client(Fibonacci, "fibonacci", retry=retry, classify=lambda _: Verdict.TRANSIENT)
future = client.call_async({"order": 100})
print(future.goal_id, flush=True)
sys.stdin.read()
"""


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ACTIONKIT_LEDGER", str(tmp_path / "goals.db"))
    return tmp_path / "goals.db"


def rows(path: Path) -> int:
    with sqlite3.connect(path) as file:
        return int(file.execute("SELECT count(*) FROM goals").fetchone()[0])


def test_goals_are_written_down_before_they_are_sent_and_removed_when_they_have_stopped(
    action_server, make_client, path
):
    server = action_server("fibonacci", gate=1)
    client = make_client()
    future = client.call_async({"order": 1})
    assert rows(path) == 1
    server.release()
    future.result(20)
    assert isinstance(client.call_async({"order": "no"}).exception(20), ak.InvalidGoalError)
    client.close()
    assert rows(path) == 0
    assert Ledger(path).leftovers() == []


def test_a_goal_that_is_left_on_purpose_is_removed(action_server, make_client, path):
    server = action_server("never_finishes")
    client = make_client(on_close="abandon")
    future = client.call_async({"order": 1})
    server.wait_for("executing", goal_id=str(future.goal_id))
    client.close()
    assert rows(path) == 0


def killed(run_script, server):
    """Start a program, and kill it when its goal executes; return the id of its first goal."""
    program = run_script(PROGRAM)
    goal_id = program.line()
    server.wait_for("executing")
    program.process.kill()
    program.process.wait(20)
    return goal_id


def test_a_mission_goes_on_with_the_goal_that_runs(action_server, make_client, run_script, path):
    server = action_server("fibonacci", period=0.05)
    goal_id = killed(run_script, server)
    ledger = Ledger(path)
    client = make_client()
    (future,) = ledger.attach(client, timeout=0.1)
    assert ledger.attach(client) == []
    assert ledger.cancel() == {}, "each goal is in the hands of one"
    assert str(future.goal_id) == goal_id
    assert isinstance(future.exception(20), ak.DeadlineExceededError)
    (future,) = until(lambda: ledger.attach(client))  # it was given up on, and is left over again
    assert len(future.result(30).sequence) == 101
    until(lambda: rows(path) == 0)
    assert server.count("goal_received") == 1


def test_a_retry_that_runs_is_cancelled(action_server, run_script, path):
    server = action_server("flaky", fails=1, how="rejects", period=0.3)
    killed(run_script, server)
    ledger = Ledger(path)
    (goal,) = ledger.leftovers()
    assert ledger.cancel(30) == {goal: ak.CancelReport.CONFIRMED}
    assert runs_nothing(server)
    assert rows(path) == 0


def test_a_retry_is_found_by_the_id_that_follows_from_the_first(action_server, make_client, path):
    action_server("aborts")
    transient = lambda outcome: ak.Verdict.TRANSIENT  # noqa: E731
    client = make_client(retry=RetryPolicy(attempts=3, initial=0), classify=transient)
    future = client.call_async({"order": 1})
    first = future.goal_id
    outcome = future.outcome(20)
    ids = [goal.goal_id for goal in outcome.goals]
    ledger = Ledger(path)
    assert ids == [ledger._attempt_id(first, number) for number in (1, 2, 3)]
    until(lambda: rows(path) == 0)


@pytest.mark.parametrize("what", ["broken", "a folder", "read-only", "full"])
def test_a_file_that_cannot_be_used_is_an_error_before_anything_is_sent(
    what, action_server, make_client, path, monkeypatch
):
    server = action_server("fibonacci")
    if what == "broken":
        path.write_bytes(b"no database" * 1000)
    elif what == "a folder":
        path.mkdir()
    elif what == "read-only":
        monkeypatch.setenv("ACTIONKIT_LEDGER", "/proc/goals.db")
    if what != "full":
        with pytest.raises(ak.LedgerError, match="cannot be used"):
            make_client()
        return
    client = make_client()
    ledger = client._session.ledger
    ledger._store._db.execute("PRAGMA max_page_count=1")
    with suppress(ak.LedgerError):
        while True:
            ledger._add(uuid.uuid4(), "/a", "b/action/C", 0)
    with pytest.raises(ak.LedgerError, match=r"is full\), so nothing was sent\. Make room"):
        client.call_async({"order": 1})
    server.sync()
    assert server.count("goal_received") == 0


FORKS = """
import os, sys, uuid
from actionkit import Client, Ledger
from test_msgs.action import Fibonacci
with Client(Fibonacci, "fibonacci") as client:
    client.call({"order": 1})
    ledger = Ledger(os.environ["ACTIONKIT_LEDGER"])
    if (child := os.fork()) == 0:
        ledger._add(uuid.uuid4(), "/a", "b/action/C", 0)
        os._exit(len(ledger.leftovers()))
    assert os.waitpid(child, 0) == (child, 0)
    assert [goal.pid for goal in ledger.leftovers()] == [child]
"""


def test_a_forked_child_and_its_parent_are_two_processes(action_server, run_script, path):
    action_server("fibonacci")
    assert run_script(FORKS).finish() == (0, "", "")


def test_a_goal_that_is_refused_or_lost_is_told_and_stays(action_server, run_script, path):
    server = action_server("refuses_cancel")
    killed(run_script, server)
    ledger = Ledger(path)
    (goal,) = ledger.leftovers()
    assert ledger.cancel(4.0) == {goal: ak.CancelReport.REFUSED}
    server.kill()
    assert ledger.cancel(4.0) == {goal: ak.CancelReport.UNKNOWN}
    assert ledger.leftovers() == [goal]
