"""Waiting until a server has accepted a goal (C1.14)."""

from __future__ import annotations

import asyncio
import concurrent.futures
from functools import partial

import anyio
import pytest

import actionkit as ak
from actionkit import GoalState, RetryPolicy, Timeouts, retry_aborted
from tests.awaiting.conftest import LONG, QUICK
from tests.awaiting.test_rclpy_forms import Answers, robot
from tests.conftest import runs_nothing
from tests.waiting import until, until_in_loop

UNLIMITED = Timeouts(server=None, accept=None, cancel=5.0)


def test_it_returns_while_the_goal_runs(client, server):
    future = client.call_async(LONG)
    event = future.wait_accepted()  # without a limit: it must be woken
    assert (event.state, event.attempt, event.goal_id) == (GoalState.ACCEPTED, 1, future.goal_id)
    assert not future.done()
    server.wait_for("accepted", goal_id=str(event.goal_id))
    future.cancel()
    assert future.outcome(20).status is GoalState.CANCELED
    assert event in future.timeline
    assert future.wait_accepted(0) is event


def test_a_rejected_goal_raises_what_the_result_raises(action_server, make_client):
    action_server("guarded", action_name="rejects", max_order=2)
    future = make_client(name="rejects").call_async({"order": 4})
    with pytest.raises(ak.GoalRejectedError) as caught:  # without a limit of its own
        asyncio.run(asyncio.wait_for(future.wait_accepted_async(), 10))
    assert caught.value is future.exception(0)
    with pytest.raises(ak.GoalRejectedError):
        future.wait_accepted()


def test_its_own_timeout_leaves_the_goal_alone(action_server, make_client):
    server = action_server("slow_accept", action_name="slow", gate=1)
    future = make_client(name="slow", timeouts=UNLIMITED).call_async(QUICK)
    server.wait_for("goal_received")

    async def waits():
        with pytest.raises(TimeoutError, match="no server accepted the goal within the local"):
            await future.wait_accepted_async(0.05)
        with pytest.raises(TimeoutError):
            await future.wait_accepted_async(timeout=0)

    asyncio.run(waits())
    with pytest.raises(TimeoutError):
        future.wait_accepted(0.05)
    with pytest.raises(ValueError, match=r"timeout=-1 must be zero or more seconds"):
        asyncio.run(future.wait_accepted_async(-1))
    server.release()
    assert future.wait_accepted(20).state is GoalState.ACCEPTED
    assert len(future.result(20).sequence) == 2
    server.sync()
    asked = {event.goal_id for event in server.events if event.event == "cancel_requested"}
    assert str(future.goal_id) not in asked


def test_a_call_that_ends_before_raises_its_own_error(make_client):
    future = make_client(timeouts=Timeouts(server=0.2)).call_async(QUICK)
    with pytest.raises(ak.ServerUnavailableError):
        asyncio.run(future.wait_accepted_async())
    future = make_client(timeouts=UNLIMITED, name="other").call_async(QUICK)
    future.cancel()
    with pytest.raises(concurrent.futures.CancelledError):
        future.wait_accepted(20)
    with pytest.raises(asyncio.CancelledError):
        asyncio.run(future.wait_accepted_async())


def test_a_server_that_is_killed_before_its_answer(action_server, make_client):
    action_server("crashes", action_name="crashes", point="before_accept")
    client = make_client(
        name="crashes", timeouts=Timeouts(accept=0.5, cancel=0.3), retry=RetryPolicy.none()
    )
    assert client.wait_for_server(20)
    future = client.call_async(QUICK)
    with pytest.raises((ak.AcceptanceTimeoutError, ak.ServerLostError)):
        future.wait_accepted(40)


@pytest.mark.parametrize("backend", ["asyncio", "trio"])
def test_under_asyncio_and_trio(backend, client):
    async def main():
        future = client.call_async(LONG)
        event = await future.wait_accepted_async(20)
        assert (event.state, future.done()) == (GoalState.ACCEPTED, False)
        future.cancel()
        return future

    future = anyio.run(main, backend=backend)
    assert future.outcome(20).status is GoalState.CANCELED


def test_under_rclpy(client, ros_domain):
    future, answers = client.call_async(LONG), Answers()
    with robot(ros_domain, "single") as made:
        made.call(lambda: answers.of(future.wait_accepted_async()))
        assert answers.one().goal_id == future.goal_id
    assert not future.done()
    future.cancel()
    future.outcome(20)


@pytest.mark.parametrize("backend", ["asyncio", "trio"])
def test_cancelling_the_wait_cancels_the_goal(backend, action_server, make_client):
    server = action_server("slow_accept", action_name="patient", gate=1, period=0.3)
    future = make_client(name="patient", timeouts=UNLIMITED).call_async(LONG)
    server.wait_for("goal_received")

    async def main():
        with anyio.move_on_after(0.05) as scope:
            await future.wait_accepted_async()
        assert scope.cancelled_caught

    # On asyncio, as in `await future`, the wait for the confirmation is shielded.
    wait = partial(anyio.run, main, backend=backend)
    with concurrent.futures.ThreadPoolExecutor(1) as thread:
        ended = thread.submit(wait)
        server.wait_for("cancel_requested", goal_id=str(future.goal_id))
        server.release()
        ended.result(20)
    assert future.cancelled()
    assert runs_nothing(server)


@pytest.mark.parametrize("first", ["accepted", "over"])
def test_waits_for_acceptance_and_for_the_end_leave_the_goal_to_each_other(
    first, action_server, make_client
):
    server = action_server("slow_accept", action_name="mixed", gate=1, period=0.3)
    client = make_client(name="mixed", timeouts=UNLIMITED)

    async def result(future):
        return await future

    async def main():
        future = client.call_async(LONG)
        tasks = {
            "accepted": asyncio.create_task(future.wait_accepted_async()),
            "over": asyncio.create_task(result(future)),
        }
        await until_in_loop(lambda: server.count("goal_received"))
        tasks.pop(first).cancel()
        server.release()
        if first == "accepted":
            await until_in_loop(lambda: future.state is GoalState.EXECUTING)
            tasks["over"].cancel()
            await asyncio.wait([tasks["over"]])
        else:
            assert (await tasks["accepted"]).goal_id == future.goal_id
            await until_in_loop(lambda: future.state is GoalState.EXECUTING)
            assert not future.done()
            future.cancel()
        return future

    future = asyncio.run(main())
    assert future.outcome(20).status is GoalState.CANCELED
    assert runs_nothing(server)


def test_the_acceptance_of_an_earlier_attempt_is_none_of_the_latest(action_server, make_client):
    server = action_server("slow_accept", action_name="again", gate=1)
    client = make_client(
        name="again",
        timeouts=Timeouts(accept=0.3),
        retry=RetryPolicy(attempts=2, initial=0, resend="always"),
    )
    assert client.wait_for_server(20)
    future = client.call_async(QUICK)
    until(lambda: any((e.attempt, e.state) == (2, GoalState.SENT) for e in future.timeline))
    server.release()
    event = future.wait_accepted(20)
    assert (event.attempt, event.goal_id) == (2, future.goal_id)


def test_a_retry_does_not_change_it(action_server, make_client):
    action_server("aborts", action_name="aborts")
    client = make_client(name="aborts", retry=RetryPolicy(initial=0), classify=retry_aborted())
    future = client.call_async(QUICK)
    event = future.wait_accepted(20)
    assert future.outcome(20).attempts == 3
    assert future.wait_accepted(0) is event
    assert (event.attempt, event.goal_id == future.goal_id) == (1, False)
