"""What a process that was killed leaves is known, and can be cancelled or followed (C12)."""

from __future__ import annotations

import fcntl
import os
import signal
import sqlite3
import threading
import time
import uuid
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from rclpy.context import Context
from rclpy.node import Node

import actionkit as ak
from actionkit import Ledger, RetryPolicy
from actionkit._calls.ledger.file import _writer, flush
from actionkit._calls.ledger.store import _transaction, attempt_id
from actionkit._leftovers import cancelling, finding
from actionkit._leftovers.cancelling import CancellingCalls
from actionkit._model.cancel_answer import CancelAnswer
from actionkit._ros.cancelling.cancel import CancelSaid
from actionkit._ros.others_goals.goal_board import Board
from actionkit._ros.others_goals.watch import GoalSeen
from actionkit.agents._mcp import process
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
    with closing(sqlite3.connect(path)) as file:
        return int(file.execute("SELECT count(*) FROM goals").fetchone()[0])


def attempts(path: Path) -> list[int]:
    """Return how many goals each call may have sent, when all is written that has to be."""
    flush()
    with closing(sqlite3.connect(path)) as file:
        return [number for (number,) in file.execute("SELECT attempts FROM goals")]


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


def killed(run_script, server, source=PROGRAM, count=1):
    """Start a program, and kill it when its goal executes; return the id of its first goal."""
    program = run_script(source)
    goal_id = program.line()
    server.wait_for("executing", count=count)
    program.process.kill()
    program.process.wait(20)
    return goal_id


def test_a_mission_goes_on_with_the_goal_that_runs(
    action_server, make_client, run_script, path, caplog
):
    server = action_server("fibonacci", period=0.05)
    goal_id = killed(run_script, server)
    ledger = Ledger(path)
    client = make_client()
    (future,) = ledger.attach(client, timeout=0.1)
    looks = f"looking for at most 10 s for goal {goal_id} of /fibonacci, left by"
    assert looks in caplog.text
    assert ledger.attach(client) == []
    assert ledger.cancel() == {}, "each goal is in the hands of one"
    assert str(future.goal_id) == goal_id
    assert isinstance(future.exception(20), ak.DeadlineExceededError)
    (goal,) = until(ledger.leftovers, bound=10)  # it was given up on, and is left over again
    assert goal.attempts == 1, "its process is dead, so no other goal is looked for"
    (future,) = ledger.attach(client)
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
        why = "cannot be used .*No such file" if what == "read-only" else "cannot be used"
        with pytest.raises(ak.LedgerError, match=why):
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


GOES_ON = """
import os, shutil, sys, uuid
from actionkit import Ledger
path = os.environ["ACTIONKIT_LEDGER"]
ledger = Ledger(path)
ledger._add(uuid.uuid4(), "/a", "b/action/C", 0)
if sys.argv[1] == "copies its folder":
    shutil.copytree(os.path.dirname(path), sys.argv[2])
else:
    os.remove(path + "-alive")
print(flush=True)
sys.stdin.readline()
ledger._add(uuid.uuid4(), "/a", "b/action/C", 0)
print(flush=True)
sys.stdin.read()
"""


@pytest.mark.parametrize("what", ["copies its folder", "removes -alive"])
def test_a_process_counts_as_alive_until_it_ends(what, run_script, path, tmp_path_factory):
    program = run_script(GOES_ON, what, str(tmp_path_factory.mktemp("copies") / "copy"))
    program.line()
    with open(f"{path}-shm", "r+b") as shared, pytest.raises(BlockingIOError):
        fcntl.lockf(shared, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, 128)  # or SQLite would empty it
    assert rows(path) == 1  # and closes the file: then SQLite tidies up
    ledger = Ledger(path)
    assert ledger.leftovers() == []
    print(file=program.process.stdin, flush=True)
    program.line()
    program.process.kill()
    program.process.wait(20)
    assert len(ledger.leftovers()) == 2


FORK_GOES_ON = """
import os, sys, uuid
from actionkit import Ledger
Ledger(os.environ["ACTIONKIT_LEDGER"])._add(uuid.uuid4(), "/a", "b/action/C", 0)
if os.fork() == 0:
    print(flush=True)
sys.stdin.read()
"""


def test_a_forked_child_does_not_keep_its_parent_alive(run_script, path):
    program = run_script(FORK_GOES_ON)
    program.line()
    program.process.kill()
    program.process.wait(20)
    assert [goal.pid for goal in Ledger(path).leftovers()] == [program.process.pid]


FORKS_LATER = """
import os
from actionkit import Ledger, LedgerError
path = os.environ["ACTIONKIT_LEDGER"]
ledger = Ledger(path)
folder = os.path.dirname(path)
os.rename(folder, folder + "-old")
os.mkdir(folder)
if os.fork() == 0:
    os._exit(len(Ledger(path).leftovers()))  # this makes it
print(os.wait()[1])
try:
    ledger.leftovers()
except LedgerError as error:
    print("was removed" in str(error))
"""


def test_another_file_is_not_taken_for_the_ledger_after_a_fork(run_script, path):
    assert run_script(FORKS_LATER).finish() == (0, "0\nTrue\n", "")


VERSION_1_0 = """
import fcntl, os, sqlite3, struct, sys
path = os.environ["ACTIONKIT_LEDGER"]
file = sqlite3.connect(path, isolation_level=None)
number = file.execute("INSERT INTO processes (pid, host) VALUES (7, 'h')").lastrowid
file.execute("INSERT INTO goals VALUES ('%s', '/a', 'b/C', 0, 1, 0, 0, 0, %d, NULL, 0)"
             % (sys.argv[1], number))
alive = open(path + "-alive", "r+")
fcntl.lockf(alive, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, number)
wanted = struct.pack("hhqqi", fcntl.F_WRLCK, os.SEEK_SET, 1, 1, 0)
found = struct.unpack("hhqqi", fcntl.fcntl(alive, fcntl.F_GETLK, wanted))[0]
print(found != fcntl.F_UNLCK, flush=True)
sys.stdin.read()
"""


def test_version_1_0_and_this_one_see_each_other_alive(run_script, path):
    ledger = Ledger(path)
    ledger._add(uuid.uuid4(), "/a", "b/action/C", 0)
    other = run_script(VERSION_1_0, str(uuid.uuid4()))
    assert other.line() == "True"
    assert ledger.leftovers() == []
    other.process.kill()
    other.process.wait(20)
    assert [goal.pid for goal in ledger.leftovers()] == [7]


def test_nothing_is_sent_while_the_file_is_gone(action_server, make_client, path):
    server = action_server("fibonacci")
    client = make_client()
    client.call({"order": 1})
    away = path.with_suffix(".away")

    def sends_nothing():
        with pytest.raises(ak.LedgerError, match=r"goals\.db was removed, renamed, replaced"):
            client.call({"order": 1})

    path.rename(away)
    sends_nothing()
    path.mkdir()
    sends_nothing()
    path.rmdir()
    path.touch()
    sends_nothing()
    away.replace(path)
    client.call({"order": 1})
    os.truncate(path, 0)
    sends_nothing()
    for end in ("", "-wal", "-shm"):
        Path(f"{path}{end}").unlink()
    sends_nothing()
    client.close()
    make_client().call({"order": 1})  # with a new file, beside the old `-alive`
    server.sync()
    assert server.count("goal_received") == 3


def test_a_goal_that_is_refused_or_lost_is_told_and_stays(action_server, run_script, path):
    server = action_server("refuses_cancel")
    killed(run_script, server)
    ledger = Ledger(path)
    (goal,) = ledger.leftovers()
    assert ledger.cancel(8.0) == {goal: ak.CancelReport.REFUSED}
    server.kill()
    assert ledger.cancel(8.0) == {goal: ak.CancelReport.UNKNOWN}
    assert ledger.leftovers() == [goal]


STALLS = """
from actionkit import Client, RetryPolicy, Timeouts
from test_msgs.action import Fibonacci
stalls, again = Timeouts(feedback=1.0), RetryPolicy(initial=0)
future = Client(Fibonacci, "fibonacci", timeouts=stalls, retry=again).call_async({"order": 100})
print(future.goal_id, flush=True)
future.exception()
"""


def test_a_retry_after_a_goal_that_was_cancelled_before_is_cancelled(
    action_server, run_script, path
):
    server = action_server("never_finishes")
    killed(run_script, server, STALLS, count=2)
    ledger = Ledger(path)
    (goal,) = ledger.leftovers()
    assert ledger.cancel(30) == {goal: ak.CancelReport.CONFIRMED}
    assert runs_nothing(server)
    assert rows(path) == 0


SENDS = """
import os
from actionkit import Client
from test_msgs.action import Fibonacci
client = Client(Fibonacci, "fibonacci")
client.wait_for_server(20)
print(client.call_async({"order": 90}).goal_id, flush=True)
client.pending and os.read(0, 1)
"""


@pytest.mark.long
@pytest.mark.parametrize("age", [0, 600])
def test_a_goal_that_is_accepted_while_it_is_asked_for_is_cancelled(
    age, action_server, run_script, path
):
    """It is written down before the wait for a server, so it may be sent much later."""
    server = action_server("slow_accept", gate=1, period=60)
    program = run_script(SENDS)
    goal_id = program.line()
    server.wait_for("goal_received")
    program.process.kill()
    program.process.wait(20)
    with closing(sqlite3.connect(path, isolation_level=None)) as file:
        file.execute("UPDATE goals SET sent = sent - ?", (age,))
    with ThreadPoolExecutor(1) as threads:
        told = threads.submit(Ledger(path).cancel, 9)
        server.wait_for(
            "cancel_requested", goal_id=goal_id, count=2
        )  # no server knows it, and it is asked again
        server.release()
        reports = list(told.result(30).values())
        assert reports == [ak.CancelReport.CONFIRMED]
    assert runs_nothing(server)
    assert rows(path) == 0


HOLDS = """
import os, sys
from actionkit import Ledger
store = Ledger(os.environ["ACTIONKIT_LEDGER"])._store
claimed = []
store.claim(lambda goal: True, claimed, follows=False)
print(len(claimed), flush=True)
sys.stdin.read()
"""


def test_nothing_is_told_to_be_over_while_another_process_cancels_it(
    action_server, make_client, run_script, path, monkeypatch, caplog
):
    server = action_server("never_finishes")
    killed(run_script, server)
    ledger = Ledger(path)
    (goal,) = ledger.leftovers()
    other = run_script(HOLDS)
    assert other.line() == "1"
    assert ledger.leftovers() == []
    monkeypatch.setattr("actionkit._leftovers.ledger._LOOK", 0.5)
    with pytest.raises(
        ak.LedgerError, match=f"another process cancels or follows goal {goal.goal_id}"
    ):
        ledger.attach(make_client())
    assert "waiting for at most 0.5 s for another process that cancels or follows" in caplog.text
    assert ledger.cancel(0.5) == {goal: ak.CancelReport.UNKNOWN}
    look = ledger._store.in_other_hands

    def look_and_kill():
        found = look()
        other.process.kill()  # not before it was seen
        return found

    monkeypatch.setattr(ledger._store, "in_other_hands", look_and_kill)
    assert ledger.cancel(30) == {goal: ak.CancelReport.CONFIRMED}
    assert runs_nothing(server)


INTERRUPTED = """
import os, sys, uuid
from actionkit import Ledger
ledger = Ledger(os.environ["ACTIONKIT_LEDGER"])
ledger._add(uuid.uuid4(), "/fibonacci", "test_msgs/action/Fibonacci", 0)
print("ready", flush=True)
sys.stdin.readline()
try:
    print("waiting", flush=True)
    ledger._store.claim(lambda goal: True, [], follows=True)
except KeyboardInterrupt:
    print("interrupted", flush=True)
ledger._add(uuid.uuid4(), "/fibonacci", "test_msgs/action/Fibonacci", 0)
print("written down", flush=True)
sys.stdin.read()
"""


def test_ctrl_c_in_the_wait_for_another_process_loses_no_goal(run_script, path):
    """SQLite does not hear signals, so the error comes when its transaction has begun."""
    Ledger(path)
    with closing(sqlite3.connect(path, isolation_level=None)) as other:
        program = run_script(INTERRUPTED)
        assert program.line() == "ready"
        other.execute("BEGIN IMMEDIATE")
        print(file=program.process.stdin, flush=True)
        assert program.line() == "waiting"
        program.process.send_signal(signal.SIGINT)
        other.execute("COMMIT")
    assert program.line() == "interrupted"
    assert program.line() == "written down"
    assert rows(path) == 2


def test_nothing_of_what_ctrl_c_interrupts_is_written():
    with closing(sqlite3.connect(":memory:", isolation_level=None)) as file:
        file.execute("CREATE TABLE goals (goal_id TEXT)")

        def interrupted():
            with _transaction(file):
                file.execute("INSERT INTO goals VALUES ('a')")
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            interrupted()
        assert not file.in_transaction, "the next goal would be written into it"
        assert file.execute("SELECT * FROM goals").fetchall() == []


ENDS = """
from actionkit import Client
from test_msgs.action import Fibonacci
future = Client(Fibonacci, "fibonacci").call_async({"order": 1})
future.wait_accepted(20)
"""


def test_a_goal_that_is_cancelled_at_the_end_of_its_program_is_removed(
    action_server, run_script, path
):
    server = action_server("never_finishes")
    assert run_script(ENDS, fresh=True).finish()[0] == 0
    assert runs_nothing(server)
    assert rows(path) == 0


TOLD_TO_END = """
import os, signal, sys
from actionkit import Client, Ledger, cancel_on_signals
from test_msgs.action import Fibonacci
cancel_on_signals()
client = Client(Fibonacci, "fibonacci")
if sys.argv[1] == "own":
    future = client.call_async({"order": 1})
else:
    (future,) = Ledger(os.environ["ACTIONKIT_LEDGER"]).attach(client, on_give_up=sys.argv[1])
print(future.wait_accepted(20), flush=True)
while True:
    signal.pause()  # who asks how it ended is told that it runs, and then no warning names it
"""


@pytest.mark.parametrize("whose", ["own", "cancel"])
def test_a_goal_that_a_signal_has_cancelled_is_removed(whose, action_server, run_script, path):
    server = action_server("never_finishes")
    if whose == "cancel":
        killed(run_script, server)
    program = run_script(TOLD_TO_END, whose)
    program.line()
    program.process.send_signal(signal.SIGTERM)
    assert program.finish()[0] == -signal.SIGTERM
    assert runs_nothing(server)
    assert rows(path) == 0


def test_a_goal_that_was_taken_over_and_is_left_is_named(action_server, run_script, path):
    server = action_server("never_finishes")
    goal_id = killed(run_script, server)
    program = run_script(TOLD_TO_END, "leave")
    program.line()
    program.process.send_signal(signal.SIGTERM)
    code, _, err = program.finish()
    assert code == -signal.SIGTERM
    assert f"1 goal MAY STILL BE RUNNING: no server has confirmed that /fibonacci {goal_id}" in err
    assert [str(goal.goal_id) for goal in Ledger(path).leftovers()] == [goal_id]
    assert server.running() == {goal_id}


def test_a_call_that_is_over_is_not_looked_for_beyond_its_last_goal(
    action_server, make_client, path
):
    server = action_server("never_finishes")
    client = make_client(retry=RetryPolicy(attempts=3), timeouts=ak.Timeouts(cancel=0.2))
    future = client.call_async({"order": 1})
    server.wait_for("executing", goal_id=str(future.goal_id))
    server.pause()
    future.cancel()
    assert isinstance(future.exception(20), ak.DeadlineExceededError)
    assert attempts(path) == [1], "the goal may run"
    server.resume()
    until(lambda: rows(path) == 0)


LEAVES_BAD = """
import os, uuid
from actionkit import Ledger
Ledger(os.environ["ACTIONKIT_LEDGER"])._add(uuid.uuid4(), "/fibonacci", "no_such/action/Type", 0)
"""


def test_a_row_that_cannot_be_understood_does_not_hide_the_others(action_server, run_script, path):
    server = action_server("never_finishes")
    killed(run_script, server)
    assert run_script(LEAVES_BAD).finish() == (0, "", "")
    told = {goal.type_name: report for goal, report in Ledger(path).cancel(30).items()}
    assert told == {
        "no_such/action/Type": ak.CancelReport.UNKNOWN,
        "test_msgs/action/Fibonacci": ak.CancelReport.CONFIRMED,
    }
    assert runs_nothing(server)


def test_the_package_of_the_action_is_not_needed(action_server, run_script, path):
    server = action_server("never_finishes")
    killed(run_script, server)
    with closing(sqlite3.connect(path, isolation_level=None)) as file:
        file.execute("UPDATE goals SET type = 'no_such/action/Type'")
    assert list(Ledger(path).cancel(30).values()) == [ak.CancelReport.CONFIRMED]
    assert runs_nothing(server)


MANY = """
import os, sys, uuid
from actionkit import Ledger
ledger = Ledger(os.environ["ACTIONKIT_LEDGER"])
for _ in range(500):
    ledger._add(uuid.uuid4(), "/fibonacci", "test_msgs/action/Fibonacci", int(sys.argv[1]))
"""


@pytest.mark.long
def test_many_goals_that_no_server_knows_are_removed_in_time(
    action_server, run_script, path, ros_domain
):
    server = action_server("never_finishes")
    goal_id = killed(run_script, server)
    assert run_script(MANY, str(ros_domain)).finish() == (0, "", "")
    began = time.monotonic()
    told = {str(goal.goal_id): report for goal, report in Ledger(path).cancel(8).items()}
    assert time.monotonic() - began < 9
    assert told.pop(goal_id) is ak.CancelReport.CONFIRMED
    assert list(told.values()) == [ak.CancelReport.NOT_NEEDED] * 500
    assert runs_nothing(server)
    assert rows(path) == 0


INTERRUPTS_CANCEL = """
import atexit, os, signal, threading
atexit.register(lambda: print([t.name for t in threading.enumerate() if t.name == "actionkit"]))
from actionkit import Ledger
from actionkit._ros.others_goals.survey import Survey
look = Survey.actions

def look_after_ctrl_c(self):
    Survey.actions = look
    os.kill(os.getpid(), signal.SIGINT)
    return look(self)

Survey.actions = look_after_ctrl_c
try:
    Ledger(os.environ["ACTIONKIT_LEDGER"]).cancel(30)
except KeyboardInterrupt:
    print("interrupted")
"""


def test_a_program_ends_in_order_after_ctrl_c_in_cancel(run_script, path, ros_domain):
    """rclpy aborts the process if the communication thread runs when the interpreter ends."""
    assert run_script(MANY, str(ros_domain)).finish() == (0, "", "")
    assert run_script(INTERRUPTS_CANCEL, fresh=True).finish() == (0, "interrupted\n[]\n", "")
    assert len(Ledger(path).leftovers()) == 500


def test_mcp_goes_on_cancelling_what_does_not_stop_at_once(
    action_server, run_script, path, monkeypatch
):
    server = action_server("never_finishes")
    killed(run_script, server)
    monkeypatch.setattr(process, "_FIRST", 0.3)
    monkeypatch.setattr(process, "_PAUSE", 0.1)
    server.pause()
    process.cancel_leftovers(Ledger(path))
    assert rows(path) == 1
    server.resume()
    assert runs_nothing(server)
    until(lambda: rows(path) == 0)
    # Else it would go on in the domain of a test that has ended.
    until(lambda: not any("_go_on" in thread.name for thread in threading.enumerate()))


def test_a_look_for_goals_ends_if_the_context_was_shut_down(make_client, ros_domain):
    context = Context()
    context.init(domain_id=ros_domain)
    client = make_client(node=Node("mine", context=context))
    context.shutdown()
    with pytest.raises(ak.ClientClosedError, match="the ROS context of its client's node was shut"):
        finding._known(client, time.monotonic() + 10)


def test_a_client_waits_at_its_end_until_its_goals_are_removed():
    disk, removed = threading.Event(), []
    _writer.soon(lambda: removed.append(disk.wait(20)))
    threading.Timer(0.1, disk.set).start()
    flush()
    assert removed == [True]


def test_all_ledgers_of_a_process_have_one_thread(tmp_path):
    ledgers = [Ledger(tmp_path / f"{number}.db") for number in range(3)]
    assert len({ledger.path for ledger in ledgers}) == 3
    assert [thread.name for thread in threading.enumerate()].count("actionkit-ledger") == 1


FIRST = uuid.uuid4()
SECOND = attempt_id(FIRST, 2)
KIND = "test_msgs/action/Fibonacci"


@pytest.mark.parametrize(
    ("how", "state", "finds"),
    [
        ({}, "CANCELED", [SECOND]),  # its process had cancelled it, and has sent the next one
        ({}, "ABORTED", [SECOND]),
        ({}, "SUCCEEDED", [FIRST]),
        ({}, "EXECUTING", [FIRST]),
        ({"judged": True}, "SUCCEEDED", [SECOND]),
        ({"parallel": True}, "EXECUTING", [FIRST, SECOND]),
        ({"parallel": True}, "SUCCEEDED", [SECOND]),
        ({"attempts": 1}, "CANCELED", [FIRST]),
    ],
)
@pytest.mark.every
def test_a_goal_that_is_accepted_late_is_found(how, state, finds, monkeypatch):
    """Pure: what the servers say is given, first without the second goal, then with it."""
    board = Board()
    board.take([GoalSeen(str(FIRST), state, 0), GoalSeen(str(SECOND), "EXECUTING", 0)], 0.0)
    first, second = (board.goals[str(goal_id)] for goal_id in (FIRST, SECOND))
    looks = iter([{}, {FIRST: first}])
    later = {FIRST: first, SECOND: second}
    monkeypatch.setattr(finding, "_known", lambda *_: next(looks, later))
    monkeypatch.setattr(finding, "_AGAIN", 0.01)
    usual = {"attempts": 3, "judged": False, "parallel": False}
    call = ak.Leftover(FIRST, "/a", "b/action/C", 0, **(usual | how), sent=0.0, pid=1, host="h")
    until = time.monotonic() + (0.3 if "parallel" in how else 30)
    assert list(finding.find(None, [call], until)) == [(call, one) for one in finds]


UNKNOWN, ACCEPTED = CancelAnswer.UNKNOWN_GOAL, CancelAnswer.ACCEPTED


def call_is(**how):
    usual = {"attempts": 3, "judged": False, "parallel": False, "sent": 0.0}
    return ak.Leftover(FIRST, "/a", KIND, 0, **(usual | how), pid=1, host="h")


def begun(*calls, servers=1):
    """Return calls whose goals are being cancelled, a second after the servers were seen."""
    action = CancellingCalls("/a", calls)
    action.seen([f"/server_{number}" for number in range(servers)])
    action.to_ask_singly(0.0)
    return action


def shows(action, goal_id, state, stamp=0):
    action.take_news([GoalSeen(str(goal_id), state, stamp)], 0.0)


def answers(action, goal_id, answer, now, request=1):
    action.take(CancelSaid(str(goal_id), answer, request), now)


@pytest.mark.parametrize(
    ("how", "state", "asks", "waits"),
    [
        ({}, "CANCELED", [SECOND], True),  # its process may have sent the next one
        ({}, "ABORTED", [SECOND], True),
        ({}, "SUCCEEDED", [], False),
        ({}, "EXECUTING", [FIRST], True),
        ({"judged": True}, "SUCCEEDED", [SECOND], True),
        ({"parallel": True}, "EXECUTING", [FIRST, SECOND], True),
        ({"parallel": True}, "SUCCEEDED", [SECOND], True),
        ({"attempts": 1}, "CANCELED", [], False),
        ({"attempts": 1, "parallel": True}, "EXECUTING", [FIRST], True),
    ],
)
@pytest.mark.every
def test_the_next_goal_is_cancelled_before_it_is_seen(how, state, asks, waits):
    """On a clock of the test; the first goal is in this state."""
    action = begun(call_is(**how))
    shows(action, FIRST, state)
    assert action.to_ask_singly(1.0) == [str(goal_id) for goal_id in asks]
    action.settle(1.0, over=False)
    assert action.done is not waits
    for goal_id in asks:
        answers(action, goal_id, UNKNOWN, 1.1)
    action.settle(9.0, over=False)
    assert action.done is not waits, "it may be accepted later"


def test_a_retry_that_is_seen_is_cancelled_and_the_goals_before_it_need_not_come():
    action = begun(call := call_is())
    assert action.to_ask_singly(1.0) == [str(FIRST)]
    answers(action, FIRST, UNKNOWN, 1.1)
    action.settle(9.0, over=False)
    assert not action.done
    shows(action, SECOND, "EXECUTING")
    assert action.to_ask_singly(9.0) == [str(SECOND)]
    answers(action, SECOND, ACCEPTED, 9.1)
    shows(action, SECOND, "CANCELED")
    action.settle(9.2, over=False)
    assert action.reports == {call: ak.CancelReport.CONFIRMED}
    assert action.done, "the process was dead when it ran, so there is no third one"


def test_no_retry_comes_after_a_goal_that_ran_when_it_was_asked_for():
    """Its status came late: only when it had been canceled."""
    action = begun(call := call_is())
    assert action.to_ask_singly(1.0) == [str(FIRST)]
    shows(action, FIRST, "CANCELED")
    assert action.to_ask_singly(1.1) == [str(SECOND)]
    answers(action, SECOND, UNKNOWN, 1.2)
    action.settle(9.0, over=False)
    assert not action.done
    answers(action, FIRST, ACCEPTED, 9.0)
    action.settle(9.1, over=False)
    assert action.done
    assert action.reports == {call: ak.CancelReport.CONFIRMED}


@pytest.mark.parametrize(
    ("sent", "servers", "told", "knows"),
    [
        (0.0, 1, [(1, UNKNOWN)], False),
        (None, 1, [(1, UNKNOWN), (2, ACCEPTED)], True),
        (0.0, 2, [(1, UNKNOWN), (1, ACCEPTED)], True),
        (0.0, 2, [(1, UNKNOWN), (1, UNKNOWN)], False),
        (0.0, 2, [(1, UNKNOWN), (2, UNKNOWN)], None),
        (None, 1, [(1, UNKNOWN)], None),
    ],
    ids=[
        "no server knows it",
        "it comes late",
        "the other server has it",
        "neither has it",
        "the other server is silent",
        "it may come yet",
    ],
)
@pytest.mark.every
def test_a_goal_that_may_be_accepted_yet_or_elsewhere_is_asked_for_until_then(
    sent, servers, told, knows
):
    """Pure. There are many, so one that was sent long ago does not come any more."""
    call = call_is(sent=time.time() if sent is None else sent)
    others = [replace(call, goal_id=uuid.uuid4()) for _ in range(cancelling._MANY)]
    action = begun(call, *others, servers=servers)
    assert str(FIRST) in action.to_ask_singly(1.0)
    for request, answer in told:
        answers(action, FIRST, answer, 1.1, request)
    action.settle(9.0, over=False)
    if knows:
        assert call not in action.reports, "it is cancelled, and has not ended"
        shows(action, FIRST, "CANCELED", 0)
        action.settle(9.1, over=False)
        assert action.reports[call] is ak.CancelReport.CONFIRMED
    else:
        wanted = None if knows is None else ak.CancelReport.NOT_NEEDED
        assert action.reports.get(call) is wanted


@pytest.mark.parametrize(
    ("state", "answer", "told"),
    [
        ("CANCELED", ACCEPTED, ak.CancelReport.CONFIRMED),
        ("SUCCEEDED", ACCEPTED, ak.CancelReport.NOT_NEEDED),
        ("SUCCEEDED", CancelAnswer.REFUSED, ak.CancelReport.NOT_NEEDED),
        ("EXECUTING", CancelAnswer.REFUSED, ak.CancelReport.REFUSED),
        ("CANCELING", ACCEPTED, ak.CancelReport.UNKNOWN),
        ("EXECUTING", CancelAnswer.TERMINATED, ak.CancelReport.UNKNOWN),
        ("LOST", ACCEPTED, ak.CancelReport.UNKNOWN),
        ("", UNKNOWN, ak.CancelReport.NOT_NEEDED),
        ("", None, ak.CancelReport.UNKNOWN),
    ],
)
@pytest.mark.every
def test_only_a_goal_that_is_known_to_have_stopped_is_told_so(state, answer, told):
    action = begun(call := call_is(attempts=1))
    if state:
        shows(action, FIRST, "EXECUTING")
    assert action.to_ask_singly(1.0) == [str(FIRST)]
    if answer is not None:
        answers(action, FIRST, answer, 1.1)
    if state == "LOST":
        action.take_news((), 0.0)
    elif state:
        shows(action, FIRST, state)
    action.settle(9.0, over=True)
    assert action.reports == {call: told}


def test_of_two_servers_both_have_to_stop_a_goal():
    action = begun(call := call_is(attempts=1), servers=2)
    shows(action, FIRST, "EXECUTING", 1)
    shows(action, FIRST, "EXECUTING", 2)
    assert action.to_ask_singly(1.0) == [str(FIRST)]
    shows(action, FIRST, "CANCELED", 1)
    action.settle(9.0, over=True)
    assert action.reports == {call: ak.CancelReport.UNKNOWN}


def test_a_goal_that_is_refused_is_waited_for_because_it_may_end():
    action = begun(call := call_is(attempts=1))
    shows(action, FIRST, "EXECUTING")
    action.to_ask_singly(1.0)
    answers(action, FIRST, CancelAnswer.REFUSED, 1.1)
    action.settle(5.0, over=False)
    assert action.reports == {call: ak.CancelReport.REFUSED}
    assert not action.done
    shows(action, FIRST, "SUCCEEDED")
    action.settle(9.0, over=True)
    assert action.reports == {call: ak.CancelReport.NOT_NEEDED}


def test_a_call_has_stopped_when_all_its_goals_have():
    for also, report in ((True, ak.CancelReport.REFUSED), (False, ak.CancelReport.CONFIRMED)):
        action = begun(call := call_is(attempts=2, parallel=True))
        for goal_id in (FIRST, SECOND)[: 1 + also]:
            shows(action, goal_id, "EXECUTING")
        action.to_ask_singly(1.0)
        answers(action, FIRST, ACCEPTED, 1.1)
        shows(action, FIRST, "CANCELED")
        answers(action, SECOND, CancelAnswer.REFUSED if also else UNKNOWN, 1.1)
        action.settle(9.0, over=True)
        assert action.reports == {call: report}


def test_a_goal_of_a_server_that_comes_into_sight_again_is_waited_for():
    action = begun(call := call_is(attempts=1))
    shows(action, FIRST, "EXECUTING")
    assert action.to_ask_singly(1.0) == [str(FIRST)]
    answers(action, FIRST, ACCEPTED, 1.1)
    action.take_news((), 0.0)
    action.settle(5.0, over=False)
    assert not action.done
    shows(action, FIRST, "EXECUTING")
    assert action.to_ask_singly(5.1) == [str(FIRST)]
    shows(action, FIRST, "CANCELED")
    action.settle(5.2, over=False)
    assert action.done
    assert action.reports == {call: ak.CancelReport.CONFIRMED}


@pytest.mark.parametrize("first", ["", "CANCELED"])
def test_a_goal_that_is_seen_to_run_is_not_settled_any_more(first):
    """There are many, sent long ago. A second server comes into sight late, and has it, too."""
    call = call_is(attempts=1)
    others = [replace(call, goal_id=uuid.uuid4()) for _ in range(cancelling._MANY)]
    action = begun(call, *others)
    for goal_id in action.to_ask_singly(1.0):
        answers(action, goal_id, UNKNOWN, 1.1)
    if first:
        shows(action, FIRST, first, 1)
    action.settle(3.4, over=False)
    assert not action.done, "a second server may not be in sight yet"
    action.settle(3.6, over=False)
    assert action.done
    action.seen(["/server_0", "/server_1"])
    shows(action, FIRST, "EXECUTING", 2)
    assert not action.done
    assert action.to_ask_singly(4.0) == [str(FIRST)]
    action.settle(9.0, over=True)
    assert action.reports[call] is ak.CancelReport.UNKNOWN


def test_a_goal_that_was_refused_and_ends_by_itself_is_not_waited_for():
    action = begun(call := call_is(attempts=1))
    shows(action, FIRST, "EXECUTING")
    action.to_ask_singly(1.0)
    answers(action, FIRST, CancelAnswer.REFUSED, 1.1)
    action.settle(5.0, over=False)
    action.take_news((), 0.0)
    assert not action.done, "its server may come into sight again"
    shows(action, FIRST, "SUCCEEDED")
    assert action.done
    action.settle(5.1, over=True)
    assert action.reports == {call: ak.CancelReport.NOT_NEEDED}


def test_a_retry_may_come_after_a_goal_whose_server_keeps_several_statuses():
    action = begun(call_is())
    kept = [GoalSeen(str(FIRST), state, 0) for state in ("EXECUTING", "CANCELED")]
    action.take_news(kept, 0.0)
    assert action.to_ask_singly(1.0) == [str(SECOND)]


@pytest.mark.parametrize(
    ("state", "judged", "failed"),
    [
        ("CANCELED", True, True),
        ("ABORTED", False, True),
        ("ABORTED", True, False),  # `classify=` might take it for a success
        ("SUCCEEDED", False, False),
        ("EXECUTING", False, False),  # its server agrees to cancel it, and forgets it
    ],
)
def test_only_what_was_seen_to_fail_has_failed(state, judged, failed):
    action = begun(call := call_is(attempts=1, judged=judged))
    assert action.failed == []
    shows(action, FIRST, state)
    assert action.failed == [call] * failed


@pytest.mark.parametrize("looks", [False, True])
def test_what_is_known_at_the_end_is_told_before_the_subscriptions_are_closed(looks, monkeypatch):
    """Pure. With `looks`, a server has come into sight so late that it is looked on after that."""
    call, closed = call_is(), threading.Event()
    survey = SimpleNamespace(on_look=[])

    def cancels(_, actions, *, over, **__):
        (action,) = actions
        action.seen(["/server"])
        shows(action, FIRST, "SUCCEEDED")
        if looks:
            until(lambda: [look({}) for look in survey.on_look] and closed.wait(0.01), bound=20)
        until(lambda: over(time.monotonic()), bound=20)
        closed.wait(20)

    monkeypatch.setattr(cancelling, "Survey", lambda _: nullcontext(survey))
    monkeypatch.setattr(cancelling, "cancel_goals", cancels)
    try:
        told = cancelling.cancel_all([call], 0.5, 5.0, set(), set())
        assert told == {call: ak.CancelReport.NOT_NEEDED}
    finally:
        closed.set()
