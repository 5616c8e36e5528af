"""Feedback: in order, unwrapped, and never in the way of results (C1.8)."""

from __future__ import annotations

import asyncio
import logging
import threading

import pytest
from test_msgs.action import Fibonacci

from actionkit import GoalState
from actionkit.testing import EventLog
from tests.conftest import all_is_logged


def test_callbacks_get_it_unwrapped_and_in_order(action_server, make_client):
    action_server("fibonacci", period=0.01)
    client = make_client()
    for _ in range(5):
        seen: EventLog[Fibonacci.Feedback] = EventLog()
        result = client.call({"order": 8}, 10, on_feedback=seen)
        count = len(seen)
        assert all(isinstance(feedback, Fibonacci.Feedback) for feedback in seen)
        lengths = [len(feedback.sequence) for feedback in seen]
        assert lengths == list(range(lengths[0], 10))
        assert list(seen.items[-1].sequence) == list(result.sequence)
        client.call({"order": 1}, 10)
        assert len(seen) == count  # none after the result


@pytest.mark.long
def test_the_acceptance_is_visible_before_feedback(action_server, make_client):
    action_server("fibonacci")
    client = make_client()
    for _ in range(50):
        states: list[GoalState] = []
        gate = threading.Event()
        futures = []

        def note(_: object, gate=gate, futures=futures, states=states) -> None:
            gate.wait(5)
            states.append(futures[0].state)

        futures.append(client.call_async({"order": 3}, on_feedback=note))
        gate.set()
        assert futures[0].result(10)
        assert not {GoalState.SENDING, GoalState.SENT} & set(states)


def test_a_raising_callback_is_logged_and_counted(action_server, make_client, caplog):
    server = action_server("fibonacci", period=0.01, gate=1)
    client = make_client()
    called = EventLog()

    def fail(feedback):
        called(feedback)
        raise ValueError("from the user's callback")

    with caplog.at_level(logging.ERROR, "actionkit"):
        future = client.call_async({"order": 5}, on_feedback=fail)
        called.wait_for(4, 20)
        server.release()  # not earlier: the result waits only a moment for callbacks
        assert len(future.result(10).sequence) == 6
    outcome = future.outcome()
    assert outcome.ok
    assert outcome.callback_errors == outcome.feedback_count == 4
    assert all_is_logged()
    first, last = [record for record in caplog.records if "raised" in record.message]
    assert first.exc_info
    assert "raised. It is called with the Feedback message itself" in first.message
    assert "from the user's callback" in caplog.text
    assert caplog.text.count("Traceback") == 1
    assert f"raised {outcome.callback_errors} times" in last.message
    assert client.call({"order": 3}, 10)


def test_a_slow_callback_delays_nobody(action_server, make_client):
    action_server("fibonacci", period=0.01)
    client = make_client()
    began, release = threading.Event(), threading.Event()

    def slow(feedback):
        began.set()
        release.wait(30)

    blocked = [client.call_async({"order": 5}, on_feedback=slow) for _ in range(3)]
    assert began.wait(10)
    # All of these while the callbacks above still stand in the way.
    assert len(blocked[0].result(10).sequence) == 6
    seen: EventLog[Fibonacci.Feedback] = EventLog()
    for _ in range(20):
        assert client.call({"order": 5}, 10, on_feedback=seen)
    assert seen.wait_for(1)
    assert all(len(f.result(10).sequence) == 6 for f in blocked)
    release.set()


def test_coroutines_run_on_the_callers_loop(action_server, make_client):
    action_server("fibonacci", period=0.01)
    client = make_client()
    seen = []

    async def note(feedback):
        await asyncio.sleep(0)
        seen.append((threading.get_ident(), len(feedback.sequence)))

    async def main():
        return await client.call_async({"order": 6}, on_feedback=note)

    assert len(asyncio.run(main()).sequence) == 7
    assert {ident for ident, _ in seen} == {threading.get_ident()}
    assert [length for _, length in seen] == list(range(3, 8))


def test_a_coroutine_without_a_loop_is_refused(make_client):
    async def note(feedback): ...

    client = make_client()
    for call in (client.call, client.call_async):
        with pytest.raises(TypeError, match="no event loop is running"):
            call({"order": 1}, on_feedback=note)
        with pytest.raises(TypeError, match="must be callable"):
            call({"order": 1}, on_feedback=3)


@pytest.mark.parametrize("asynchronous", [False, True])
def test_iterating_ends_when_the_goal_ends(asynchronous, action_server, make_client):
    action_server("fibonacci", period=0.02)
    client = make_client()

    async def iterate(future):
        return [len(feedback.sequence) async for feedback in future.feedback()]

    async def main():
        return await iterate(client.call_async({"order": 6}))

    if asynchronous:
        lengths = asyncio.run(main())
    else:
        future = client.call_async({"order": 6})
        lengths = [len(feedback.sequence) for feedback in future.feedback()]
        assert list(future.feedback()) == [future.latest_feedback]
    assert lengths == list(range(3, 8))


@pytest.mark.long
def test_feedback_of_others_is_not_ours(action_server, make_client):
    server = action_server("fibonacci", period=0.01, gate=1)
    mine, other = make_client(), make_client()
    logs = [EventLog() for _ in range(4)]
    futures = [
        client.call_async({"order": order}, on_feedback=log)
        for client, order, log in zip((mine, mine, other, other), (3, 5, 7, 9), logs, strict=True)
    ]
    server.wait_for("feedback", count=2 + 4 + 6 + 8)
    server.release()
    for future, log, order in zip(futures, logs, (3, 5, 7, 9), strict=True):
        assert len(future.result(10).sequence) == order + 1
        assert [len(f.sequence) for f in log] == list(range(3, order + 2))


@pytest.mark.long
def test_feedback_that_the_result_has_overtaken_comes_before_it(action_server, make_client):
    action_server("fibonacci")  # which sends all its feedback within a millisecond
    client = make_client()
    assert client.wait_for_server(10)
    outcomes = [client.call_async({"order": 5}).outcome(10) for _ in range(50)]
    for outcome in outcomes:
        assert outcome.timeline[-1].state is GoalState.SUCCEEDED
    # Best effort, so one may be missing (R15).
    assert sum(outcome.feedback_count for outcome in outcomes) > 180
