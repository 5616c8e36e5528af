"""`classify=` over real servers: without a verdict, nothing is a success (C3.3, C3.1)."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Iterator

import pytest
from test_msgs.action import NestedMessage

import actionkit as ak
from actionkit import GoalState, RetryPolicy, Timeouts, Verdict, classify_by_field
from actionkit.testing import EventLog

QUICK = RetryPolicy(initial=0.05, jitter=0.0)
LONG = 20.0


def fail(outcome):
    raise ValueError("from classify")


@pytest.fixture
def leave() -> Iterator[threading.Event]:
    """What blocked functions wait for; set at the test's end, so that their threads end."""
    event = threading.Event()
    yield event
    event.set()


def test_a_function_that_raises_makes_no_success(action_server, make_client):
    server = action_server("fibonacci")
    with pytest.raises(ak.ClassifyError, match="raised ValueError: from classify") as caught:
        make_client(retry=QUICK, classify=fail).call({"order": 2}, 10)
    assert list(caught.value.result.sequence) == [0, 1, 1]
    assert isinstance(caught.value.__cause__, ValueError)
    assert isinstance(caught.value, ak.PermanentError)
    assert caught.value.attempts == 1
    assert len(server.wait_for("succeeded")) == 1


@pytest.mark.parametrize("nonsense", [True, "SUCCESS", 1])
def test_a_function_that_returns_nonsense_makes_no_success(nonsense, action_server, make_client):
    action_server("fibonacci")
    with pytest.raises(ak.ClassifyError, match="neither a Verdict nor None"):
        make_client(classify=lambda outcome: nonsense).call({"order": 2}, 10)


def test_a_function_that_has_no_opinion_leaves_the_default(action_server, make_client):
    action_server("scripted", script=[["succeed"], [{"abort": [102]}]])
    client = make_client(classify=lambda outcome: None)
    assert client.call({"order": 2}, 10)
    with pytest.raises(ak.GoalAbortedError):
        client.call({"order": 2}, 10)


@pytest.mark.long
def test_a_function_that_does_not_answer_makes_no_success_by_the_deadline(
    action_server, make_client, leave
):
    action_server("fibonacci")
    client = make_client(classify=lambda outcome: leave.wait(60))
    assert client.wait_for_server(10)
    began = time.monotonic()
    with pytest.raises(ak.ClassifyError, match="call's deadline") as caught:
        client.call({"order": 2}, 1.5)
    assert 1.4 < time.monotonic() - began < 1.5 + LONG / 2
    assert list(caught.value.result.sequence) == [0, 1, 1]


def test_without_a_deadline_it_is_not_waited_for_for_ever(
    action_server, make_client, leave, monkeypatch
):
    monkeypatch.setattr("actionkit._threads.function_runner.LONGEST_ANSWER", 0.3)
    action_server("fibonacci")
    future = make_client(classify=lambda outcome: leave.wait(60)).call_async({"order": 2})
    with pytest.raises(ak.ClassifyError, match="did not answer within"):
        future.result(LONG)


@pytest.mark.long
def test_blocked_callbacks_do_not_make_a_success_of_a_judged_failure(
    action_server, make_client, leave
):
    """Judges have threads of their own: others' callbacks cannot keep a judge from being asked."""
    action_server("scripted", script=[{"feedback": 1}, "succeed"])
    blocked = make_client()
    futures = [
        blocked.call_async({"order": 1}, on_feedback=lambda feedback: leave.wait(60))
        for _ in range(12)
    ]
    for future in futures:  # feedback may be lost on the way, but not of so many
        future.outcome(LONG)
    asked: list[object] = []

    def judge(outcome):
        asked.append(outcome)
        return Verdict.PERMANENT

    outcome = make_client(classify=judge).call_async({"order": 1}, timeout=LONG).outcome(2 * LONG)
    assert not outcome.ok
    assert len(asked) == 1
    assert outcome.elapsed < LONG / 2


@pytest.mark.long
def test_the_blocked_judges_of_one_client_keep_no_other_from_being_asked(
    action_server, make_client, leave
):
    action_server("fibonacci", feedback=0)
    entered = threading.Semaphore(0)

    def block(outcome):
        entered.release()
        leave.wait(60)

    blocked = make_client(classify=block)
    futures = [blocked.call_async({"order": 1}, timeout=60) for _ in range(100)]
    for _ in range(64):  # as many as there may be
        assert entered.acquire(timeout=LONG)
    other = make_client(classify=lambda outcome: Verdict.SUCCESS)
    outcome = other.call_async({"order": 1}, timeout=LONG).outcome(2 * LONG)
    assert outcome.ok
    for future in futures:
        assert not future.outcome(2 * LONG).ok


@pytest.mark.long
@pytest.mark.parametrize("how", ["raises", "blocks", "nonsense"])
def test_a_goal_that_failed_keeps_its_own_error(how, action_server, make_client, caplog, leave):
    server = action_server("scripted", script=[{"abort": [1]}])
    judges = {
        "raises": fail,
        "blocks": lambda outcome: leave.wait(60),
        "nonsense": lambda outcome: "no",
    }
    client = make_client(retry=QUICK, classify=judges[how])
    assert client.wait_for_server(10)
    logged: EventLog[logging.LogRecord] = EventLog()
    handler = logging.Handler()
    handler.emit = logged.append  # type: ignore[method-assign]
    logging.getLogger("actionkit").addHandler(handler)
    try:
        with pytest.raises(ak.GoalAbortedError, match="`classify=") as caught:
            client.call({"order": 2}, 2.0 if how == "blocks" else 10.0)
        record = logged.wait_for(lambda record: record.name == "actionkit")
    finally:
        logging.getLogger("actionkit").removeHandler(handler)
    assert (record.exc_info is not None) == (how == "raises")
    assert list(caught.value.result.sequence) == [1]
    assert caught.value.attempts == 1  # never tried again
    assert len(server.wait_for("aborted")) == 1


@pytest.mark.parametrize("end", ["cancel", "close"])
def test_what_is_cut_short_while_it_is_judged_is_no_success(end, action_server, make_client, leave):
    action_server("fibonacci")
    asked = threading.Event()

    def judge(outcome):
        asked.set()
        leave.wait(60)
        return Verdict.PERMANENT

    client = make_client(classify=judge, timeouts=Timeouts(cancel=0.3))
    future = client.call_async({"order": 2}, timeout=60)
    assert asked.wait(LONG)
    if end == "cancel":
        assert future.cancel()
    else:
        client.close()
    with pytest.raises(ak.ClassifyError, match="cut short") as caught:
        future.result(LONG)
    assert list(caught.value.result.sequence) == [0, 1, 1]
    assert not future.outcome().ok


@pytest.mark.parametrize(
    ("script", "status", "cause"),
    [
        (["reject"], GoalState.REJECTED, ak.GoalRejectedError),
        (["raise"], GoalState.ABORTED, ak.GoalAbortedError),
        ([{"abort": []}], GoalState.ABORTED, ak.GoalAbortedError),
    ],
    ids=["rejected", "raised", "empty"],
)
def test_no_success_carries_an_empty_result(script, status, cause, action_server, make_client):
    action_server("scripted", script=script)
    future = make_client(classify=lambda outcome: Verdict.SUCCESS).call_async({"order": 2})
    with pytest.raises(ak.ClassifyError, match="SUCCESS") as caught:
        future.result(LONG)
    assert future.outcome().status is status
    assert isinstance(caught.value.__cause__, cause)
    assert caught.value.attempts == 1


def test_what_another_cancelled_is_no_success_and_not_tried_again(action_server, make_client):
    server = action_server("cancels_itself")
    with pytest.raises(ak.ClassifyError, match="SUCCESS, though it was canceled") as caught:
        make_client(classify=lambda outcome: Verdict.SUCCESS).call({"order": 2}, LONG)
    assert "was canceled by the server, and" in str(caught.value)
    assert isinstance(caught.value.__cause__, ak.GoalCanceledError)
    for verdict in (Verdict.TRANSIENT, Verdict.PERMANENT, None):
        with pytest.raises(ak.GoalCanceledError):
            make_client(classify=lambda outcome, it=verdict: it, retry=QUICK).call({}, LONG)
    assert len(server.wait_for("canceled", count=4)) == 4


def test_a_field_that_is_not_there_makes_no_success(action_server, make_client):
    action_server("scripted", script=[[{"succeed": []}], [{"abort": []}]])
    client = make_client(classify=classify_by_field("sequence[0]", ok={0}), retry=QUICK)
    with pytest.raises(ak.ClassifyError, match=r"sequence\[0\].*no element 0") as caught:
        client.call({"order": 2}, 10)
    assert caught.value.attempts == 1
    with pytest.raises(ak.GoalAbortedError):
        client.call({"order": 2}, 10)


RAISING_SERVER = """
import rclpy
from rclpy.action import ActionServer
from test_msgs.action import NestedMessage

def execute(handle):
    raise ValueError("from the server's callback")

rclpy.init()
node = rclpy.create_node("raising")
server = ActionServer(node, NestedMessage, "nested", execute)
print("ready")
rclpy.spin(node)
"""


def test_the_default_result_of_an_abort_is_not_ok_by_a_field(run_script, make_client):
    """What rclpy sends where the server's callback raised has 0 in every field."""
    assert run_script(RAISING_SERVER).line() == "ready"
    judge = classify_by_field("nested_field.int32_value", ok={0})
    with pytest.raises(ak.GoalAbortedError):
        make_client(NestedMessage, "nested", classify=judge).call({}, LONG)


@pytest.mark.long
def test_retry_aborted_tries_again_what_was_aborted_and_nothing_else(action_server, make_client):
    server = action_server(
        "scripted", script=[["raise"], [{"abort": [1]}], ["succeed"], ["reject"]]
    )
    client = make_client(classify=ak.retry_aborted(), retry=QUICK)
    future = client.call_async({"order": 2}, timeout=LONG)
    assert future.result(LONG)
    assert future.outcome().attempts == 3
    with pytest.raises(ak.GoalRejectedError) as caught:
        client.call({"order": 2}, LONG)
    assert caught.value.attempts == 1
    assert len(server.wait_for("rejected")) == 1
