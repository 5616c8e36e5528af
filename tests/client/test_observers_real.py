"""The log and the observers of real calls: whole, in order, and in nobody's way (C6.1, C6.2)."""

from __future__ import annotations

import logging
import os
import shutil
import signal
import threading
from pathlib import Path

import pytest

import actionkit as ak
from actionkit import (
    GoalState,
    JsonLines,
    RetryPolicy,
    Rosout,
    Timeline,
    Timeouts,
    Verdict,
    read_json_lines,
)
from actionkit.testing import EventLog
from tests.conftest import FORMS, ask

PICTURES = Path(__file__).resolve().parent.parent.parent / "docs" / "pictures"
QUICK = RetryPolicy(initial=0.05, jitter=0.0)


class Observer:
    """Notes all that it is told."""

    def __init__(self):
        self.events = EventLog()
        self.outcomes = EventLog()
        self.calls = EventLog()

    def on_event(self, event, call):
        self.calls.append(call)
        self.events.append(event)

    def on_outcome(self, outcome, call):
        self.outcomes.append(outcome)


@pytest.fixture
def records():
    """The records of the goals' log, at every level."""
    kept = EventLog()
    handler = logging.Handler(logging.DEBUG)
    handler.emit = kept.append
    logger = logging.getLogger("actionkit.goal")
    logger.addHandler(handler)
    logger.setLevel(logging.DEBUG)
    yield kept
    logger.removeHandler(handler)
    logger.setLevel(logging.NOTSET)


# --- one story, told everywhere ----------------------------------------------------------------


@pytest.mark.parametrize("form", FORMS)
def test_the_log_and_observers_are_told_what_the_timeline_tells(
    form, action_server, make_client, records
):
    action_server("fibonacci", period=0.02)
    observer = Observer()
    client = make_client(observers=[observer])
    answer = ask(form, client, {"order": 2}, timeout=20)
    assert list(answer.result.sequence) == [0, 1, 1]
    client.close()  # nothing is told any more
    (outcome,) = observer.outcomes
    assert outcome.ok
    events = observer.events.items
    feedback = [e for e in events if e.state is GoalState.FEEDBACK]
    kept = [e for e in events if e not in feedback[1:-1]]
    assert outcome.timeline == tuple(kept)
    assert [e.detail for e in feedback] == [f"no. {n}" for n in range(1, len(feedback) + 1)]
    assert [e.state for e in kept][:3] == [
        GoalState.SENDING,
        GoalState.SENT,
        GoalState.ACCEPTED,
    ]
    assert kept[-1].state is GoalState.SUCCEEDED
    told = [(r.goal_id, r.attempt, r.state, r.detail) for r in records if r.kind == "event"]
    assert told == [(str(e.goal_id), e.attempt, e.state.value, e.detail) for e in events]
    assert [r.outcome for r in records if r.kind == "outcome"] == ["ok"]
    assert {c.call_id for c in observer.calls} == {outcome.goal_id}
    assert {(c.action_name, c.action_type, c.node_name) for c in observer.calls} == {
        ("/fibonacci", "test_msgs/action/Fibonacci", "")
    }
    assert observer.calls.items[0].goal.order == 2


@pytest.mark.long
@pytest.mark.parametrize("listener", ["observer", "log", "nobody"])
def test_each_message_of_a_quick_goal_is_told(listener, action_server, make_client, request):
    """They come by the handful, of which the timeline keeps the first and the last."""
    action_server("fibonacci")
    records = request.getfixturevalue("records") if listener == "log" else []
    observer = Observer()
    client = make_client(observers=[observer] if listener == "observer" else [])
    outcome = client.call_async({"order": 60}, timeout=20).outcome()
    client.close()
    told = [e.detail for e in observer.events if e.state is GoalState.FEEDBACK]
    told += [r.detail for r in records if r.kind == "event" and r.state == "FEEDBACK"]
    assert outcome.feedback_count > 20
    sent = [f"no. {n}" for n in range(1, outcome.feedback_count + 1)]
    assert told == ([] if listener == "nobody" else sent)
    kept = [e.detail for e in outcome.timeline if e.state is GoalState.FEEDBACK]
    assert kept == [sent[0], sent[-1]]


def test_retries_and_their_failure(action_server, make_client, records):
    action_server("aborts")
    observer = Observer()
    client = make_client(
        observers=[observer], retry=QUICK, classify=lambda outcome: Verdict.TRANSIENT
    )
    with pytest.raises(ak.GoalAbortedError) as caught:
        client.call({"order": 2}, timeout=20)
    client.close()
    ids = list(dict.fromkeys(e.goal_id for e in observer.events))
    assert len(ids) == 3
    assert {c.call_id for c in observer.calls} == {ids[0]}
    for number, goal_id in enumerate(ids, 1):
        assert {e.attempt for e in observer.events if e.goal_id == goal_id} == {number}
    levels = {(r.state, r.levelname) for r in records if r.kind == "event"}
    assert {("ABORTED", "WARNING"), ("RETRYING", "WARNING"), ("ACCEPTED", "INFO")} <= levels
    (error,) = [r for r in records if r.kind == "outcome"]
    assert (error.levelname, error.outcome, error.attempt) == ("WARNING", "GoalAbortedError", 3)
    assert error.detail == str(caught.value)
    text = str(caught.value.timeline)
    assert isinstance(caught.value.timeline, Timeline)
    assert len(text.splitlines()) == len(caught.value.timeline)
    assert [text.count(f"goal {each}") for each in ids] == [1, 1, 1]


def test_what_is_raised_to_its_caller_is_no_error_of_the_log(action_server, make_client, records):
    server = action_server("fibonacci", period=0.1)
    client = make_client(timeouts=Timeouts(server=0.1))
    nobody = make_client(name="nobody", timeouts=Timeouts(server=0.1))
    with pytest.raises(ak.ServerUnavailableError):
        nobody.call({"order": 1})
    nobody.close()
    assert client.wait_for_server(20)
    with pytest.raises(ak.GoalRejectedError):
        client.call({"order": -1}, timeout=20)
    with pytest.raises(ak.InvalidGoalError):
        client.call({"order": "x"})
    cancelled = client.call_async({"order": 40}, timeout=60)
    server.wait_for("executing")
    cancelled.cancel()
    assert not cancelled.outcome(20).ok
    client.close()
    ends = [(r.levelname, r.outcome) for r in records if r.kind == "outcome"]
    failed = ["ServerUnavailableError", "GoalRejectedError", "InvalidGoalError"]
    assert sorted(ends) == sorted([*(("WARNING", word) for word in failed), ("INFO", "cancelled")])
    assert [r for r in records if r.levelno > logging.WARNING] == []
    (told,) = [r.getMessage() for r in records if r.outcome == "cancelled"]
    assert "/fibonacci call cancelled: goal" in told


def test_what_was_never_sent_has_an_outcome_too(make_client, records):
    observer = Observer()
    client = make_client(observers=[observer], timeouts=Timeouts(server=0.1), retry=QUICK)
    futures = [client.call_async({"order": "x"}), client.call_async({"order": 1})]
    for future in futures:
        future.outcome(20)
    client.close()
    told = [type(outcome.error) for outcome in observer.outcomes]
    assert told == [ak.InvalidGoalError, ak.ServerUnavailableError]
    assert [r.outcome for r in records if r.kind == "outcome"] == [
        "InvalidGoalError",
        "ServerUnavailableError",
    ]


@pytest.mark.long
def test_a_late_end_is_told_with_the_attempt_that_it_was_of(action_server, make_client):
    """The first goal ends while the second attempt is under way (C2.4)."""
    server = action_server(
        "scripted",
        script=[[{"accept_after": 1.5}, {"feedback": 200, "period": 0.05}], [{"feedback": 3}]],
    )
    events = EventLog()
    client = make_client(
        observers=[events],
        timeouts=Timeouts(accept=0.3, cancel=0.2),
        retry=RetryPolicy(initial=0.05, jitter=0.0, resend="always"),
    )
    assert client.wait_for_server(10)
    future = client.call_async({"order": 3}, timeout=20)
    future.outcome(20)
    first = next(e.goal_id for e in events.wait_for(1))
    server.wait_for("canceled", goal_id=str(first))
    late = events.wait_for(lambda e: e.goal_id == first and e.state is GoalState.CANCELED, 10)
    assert late.attempt == 1


@pytest.mark.long
def test_a_node_of_the_users_is_named(action_server, make_client, records):
    import rclpy
    from rclpy.node import Node

    rclpy.init()
    try:
        node = Node("planner", namespace="robot")
        action_server("fibonacci", action_name="/robot/fibonacci")
        client = make_client(node=node)
        client.call({"order": 1}, timeout=20)
        client.close()
        assert {r.node_name for r in records} == {"/robot/planner"}
        assert records.items[0].getMessage().startswith("[/robot/planner] /robot/fibonacci goal ")
        node.destroy_node()
    finally:
        rclpy.shutdown()


@pytest.mark.long
def test_a_refused_cancel_is_a_warning(action_server, make_client, records):
    server = action_server("refuses_cancel", period=0.05)
    client = make_client()
    future = client.call_async({"order": 20}, timeout=20)
    server.wait_for("executing")
    future.cancel()
    assert future.outcome(20).ok
    client.close()
    (warning,) = [r for r in records if r.levelno == logging.WARNING]
    assert warning.detail == "the server refused to cancel; the goal runs on"


# --- in nobody's way ---------------------------------------------------------------------------


@pytest.mark.long
def test_a_slow_observer_and_a_slow_handler_delay_no_result(action_server, make_client, records):
    action_server("fibonacci")
    leave = threading.Event()

    class Slow(Observer):
        def on_event(self, event, call):
            assert threading.current_thread().name == "actionkit-observers"
            leave.wait(30)
            super().on_event(event, call)

    observer = Slow()
    slow_handler = logging.Handler()
    slow_handler.emit = lambda record: leave.wait(30) and None
    logging.getLogger("actionkit.goal").addHandler(slow_handler)
    try:
        client = make_client(observers=[observer])
        for _ in range(20):
            assert client.call({"order": 1}, timeout=20)
        assert len(observer.events) == 0
        leave.set()
        client.close()
        assert len(observer.outcomes) == 20
    finally:
        leave.set()
        logging.getLogger("actionkit.goal").removeHandler(slow_handler)


def test_a_raising_observer_is_dropped_and_others_go_on(action_server, make_client, caplog):
    action_server("fibonacci")

    class Raising(Observer):
        def on_event(self, event, call):
            super().on_event(event, call)
            raise ValueError("mine")

    raising, good = Raising(), Observer()
    client = make_client(observers=[raising, good])
    for _ in range(3):
        client.call({"order": 1}, timeout=20)
    client.close()
    assert len(raising.events) == 1
    assert len(good.outcomes) == 3
    (warning,) = [r for r in caplog.records if r.name == "actionkit"]
    assert "is told nothing more" in warning.getMessage()
    assert warning.exc_info[0] is ValueError


def test_blocking_calls_are_refused_in_an_observer(action_server, make_client):
    action_server("fibonacci")
    refused = EventLog()

    class Calling:
        def on_event(self, event, call):
            try:
                client.call({"order": 1})
            except RuntimeError as error:
                refused.append(error)

    client = make_client(observers=[Calling()])
    client.call({"order": 1}, timeout=20)
    assert "use call_async" in str(refused.wait_for(1)[0])


def test_observers_are_checked_when_the_client_is_made(make_client):
    with pytest.raises(TypeError, match="it has no on_event"):
        make_client(observers=[print])
    with pytest.raises(TypeError, match=r"observers=\[\.\.\.\]"):
        make_client(observers=Observer())
    one = Observer()
    with pytest.raises(ValueError, match="twice"):
        make_client(observers=[one, one])


# --- JSON lines --------------------------------------------------------------------------------


@pytest.mark.long
def test_several_clients_share_a_file(action_server, make_client, tmp_path):
    from test_msgs.action import NestedMessage

    action_server("fibonacci", period=0.01)
    action_server("navigate", action_name="navigate", distance=1.0, speed=20.0, rate=100.0)
    path = tmp_path / "goals.jsonl"
    with JsonLines(path, max_bytes=20_000, backups=100) as log:
        clients = [
            make_client(observers=[log]),
            make_client(observers=[log]),
            make_client(NestedMessage, "navigate", observers=[log]),
        ]
        outcomes = []
        for _ in range(10):
            futures = [
                client.call_async({} if number == 2 else {"order": 5}, timeout=30)
                for number, client in enumerate(clients)
            ]
            outcomes += [future.outcome(60) for future in futures]
        for client in clients:
            client.close()
    assert len(list(tmp_path.iterdir())) > 1
    read = read_json_lines(path)
    assert read.problems == ()
    assert len(read.calls()) == 30
    for outcome in outcomes:
        assert outcome.ok, outcome
        lines = read.calls()[outcome.goal_id]
        assert read.timelines()[outcome.goal_id] == outcome.timeline
        assert lines[-1].data["outcome"] == "ok"
        assert lines[-1].data["feedback_count"] == outcome.feedback_count
        assert "goal" in lines[0].data
    fibonacci = read.calls()[outcomes[0].goal_id]
    assert fibonacci[0].data["goal"] == {"order": 5}
    assert fibonacci[-1].data["result"] == {"sequence": [0, 1, 1, 2, 3, 5]}
    feedback = [line.data["feedback"] for line in fibonacci if "feedback" in line.data]
    assert len(feedback) == outcomes[0].feedback_count


KILLED = """
import os, sys
from actionkit import Client, JsonLines
from test_msgs.action import Fibonacci
log = JsonLines(sys.argv[1])
client = Client(Fibonacci, "fibonacci", observers=[log])
client.call({"order": 3}, 20)
futures = [client.call_async({"order": 90}, timeout=60) for _ in range(3)]
print("running", flush=True)
sys.stdin.readline()
"""


@pytest.mark.long
def test_a_process_killed_half_way_leaves_its_log(action_server, run_script, tmp_path):
    """Shown as docs/pictures/killed.jsonl; ACTIONKIT_WRITE_PICTURES=1 writes it again."""
    server = action_server("fibonacci", period=0.1)
    path = tmp_path / "killed.jsonl"
    script = run_script(KILLED, str(path))
    assert script.line() == "running"
    server.wait_for("feedback", count=2 + 3 * 4)  # goals of three are running
    os.kill(script.process.pid, signal.SIGKILL)
    script.process.wait(10)
    assert len(read_json_lines(path).problems) <= 1
    # Here the kernel was asked for whole lines; where it was in the middle of one, this is left.
    data = path.read_bytes()
    path.write_bytes(data[:-20])
    read = read_json_lines(path)
    assert len(read.problems) == 1
    assert read.problems[0].endswith("cut off, or no JSON")
    assert len(read.lines) == data.count(b"\n") - 1
    first, *others = read.calls().values()
    assert first[-1].data["outcome"] == "ok"
    assert len(others) == 3
    for lines in others:
        states = [line.event.state for line in lines if line.event is not None]
        assert states[:3] == [GoalState.SENDING, GoalState.SENT, GoalState.ACCEPTED]
        assert GoalState.EXECUTING in states
        assert {line.kind for line in lines} == {"event"}
    if os.environ.get("ACTIONKIT_WRITE_PICTURES"):
        shutil.copy(path, PICTURES / "killed.jsonl")


def test_the_log_of_a_killed_process_in_the_documentation():
    read = read_json_lines(PICTURES / "killed.jsonl")
    assert len(read.problems) == 1
    assert [lines[-1].kind for lines in read.calls().values()] == ["outcome", *["event"] * 3]


EXITS = """
import sys
from actionkit import Client, JsonLines
from test_msgs.action import Fibonacci
client = Client(Fibonacci, "fibonacci", observers=[JsonLines(sys.argv[1])])
future = client.call_async({"order": 90}, timeout=60)
next(iter(future.feedback()))
"""


@pytest.mark.long
def test_nothing_is_lost_at_the_interpreters_exit(action_server, run_script, tmp_path):
    action_server("fibonacci", period=0.05)
    path = tmp_path / "goals.jsonl"
    assert run_script(EXITS, str(path)).finish() == (0, "", "")
    read = read_json_lines(path)
    (lines,) = read.calls().values()
    assert read.problems == ()
    states = [line.data["state"] for line in lines]
    assert states[-2:] == ["CANCELED", "CANCELED"]
    assert (lines[-1].kind, lines[-1].data["outcome"]) == ("outcome", "ClientClosedError")


BLOCKS = """
import sys, threading
from actionkit import Client
from test_msgs.action import Fibonacci

class Blocking:
    def on_event(self, event, call):
        threading.Event().wait()

client = Client(Fibonacci, "fibonacci", observers=[Blocking()])
client.call({"order": 2}, 20)
if sys.argv[1] == "close":
    client.close()
print("done", flush=True)
"""


@pytest.mark.long
@pytest.mark.parametrize("how", ["close", "exit"])
def test_an_observer_that_never_returns_holds_up_no_end(how, action_server, run_script):
    action_server("fibonacci")
    code, out, err = run_script(BLOCKS, how).finish(timeout=20)
    assert (code, out) == (0, "done\n")
    told = err.splitlines()
    assert "had not been told everything" in told[-1]
    # On a busy machine there is also the warning that it has been at it for five seconds.
    assert len(told) == 1 or "was called at" in told[0]


# --- rosout ------------------------------------------------------------------------------------


@pytest.mark.long
def test_rosout_reaches_the_topic(action_server, make_client):
    import rclpy
    from rcl_interfaces.msg import Log
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node
    from rclpy.qos import QoSDurabilityPolicy, QoSProfile

    action_server("aborts", action_name="/robot/fibonacci")
    rclpy.init()
    executor = SingleThreadedExecutor()
    spinning = threading.Thread(target=executor.spin, daemon=True)
    try:
        node = Node("planner", namespace="robot")
        seen = EventLog()
        qos = QoSProfile(depth=100, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(Log, "/rosout", seen.append, qos)
        executor.add_node(node)
        spinning.start()
        client = make_client(node=node, observers=[Rosout(node)])
        with pytest.raises(ak.GoalAbortedError):
            client.call({"order": 1}, timeout=20)
        failed = seen.wait_for(lambda log: "call failed" in log.msg, 10)
        assert failed.name == "robot.planner"
        assert failed.level == 30
        levels = {log.msg.split()[3]: log.level for log in seen if " goal " in log.msg}
        assert levels["ACCEPTED"] == 20
        assert levels["ABORTED"] == 30
        client.close()
    finally:
        executor.shutdown()
        spinning.join(10)
        rclpy.shutdown()
