"""A new goal replaces the running one, as in Nav2's servers (C9.1)."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest
from test_msgs.action import Fibonacci

from actionkit import GoalAbortedError, GoalRejectedError, GoalState
from tests.fake_server.conftest import ACCEPTED, FIELDS, NOT_RETRIED, names
from tests.rclpy_client import ABORTED, SUCCEEDED, Driver


def never_but_the_last(goal: Any) -> str:
    return "succeeded" if goal.order == 0 else "never"


def test_the_running_goal_ends_aborted_and_is_not_tried_again(
    fake_server: Any, make_client: Any
) -> None:
    server = fake_server(
        Fibonacci, "fibonacci", end=never_but_the_last, result=FIELDS, preempts=True
    )
    client = make_client()
    first = client.call_async({"order": 1}, timeout=60.0)
    server.wait_for("executing", goal_id=first.goal_id)
    second = client.call_async({"order": 0}, timeout=60.0)
    assert list(second.result(60).sequence) == [3, 1]
    with pytest.raises(GoalAbortedError) as raised:
        first.result(60)
    assert list(raised.value.result.sequence) == []  # as of Nav2: not that of the plan
    assert names(server, first.goal_id) == [*ACCEPTED, "aborted"]
    assert names(server, second.goal_id) == [*ACCEPTED, "succeeded"]
    assert len(server.goals) == 2


def test_a_plain_client_is_told_the_same(fake_server: Any, driver: Driver) -> None:
    server = fake_server(
        Fibonacci, "fibonacci", end=never_but_the_last, result=FIELDS, preempts=True
    )
    driver.connect()
    goal_id, first = driver.accepted(order=1)
    server.wait_for("executing", goal_id=goal_id)
    _, second = driver.accepted(order=0)
    assert driver.outcome(first) == (ABORTED, [])
    assert driver.outcome(second) == (SUCCEEDED, [3, 1])


def test_without_it_goals_run_side_by_side(fake_server: Any, make_client: Any) -> None:
    server = fake_server(Fibonacci, "fibonacci", end=never_but_the_last)
    client = make_client()
    first = client.call_async({"order": 1}, timeout=60.0)
    server.wait_for("executing", goal_id=first.goal_id)
    client.call({"order": 0}, timeout=60.0)
    assert server.running() == {str(first.goal_id)}


def test_a_goal_does_nothing_before_the_earlier_one_has_ended(
    fake_server: Any, make_client: Any
) -> None:
    """That one may be in a function of the test's. Who is preempted while it waits ends at once."""
    go_on = threading.Event()
    aborted = []

    def feedback(goal: Any) -> Iterator[Any]:
        aborted.append((goal.order, server.count("aborted")))
        yield {"sequence": [goal.order]}
        if goal.order == 1:
            go_on.wait(30)

    server = fake_server(Fibonacci, "fibonacci", feedback=feedback, preempts=True)
    client = make_client()
    first = client.call_async({"order": 1}, timeout=60.0)
    server.wait_for("feedback")
    second = client.call_async({"order": 2}, timeout=60.0)
    server.wait_for("executing", goal_id=second.goal_id)
    third = client.call_async({"order": 3}, timeout=60.0)
    server.wait_for("executing", goal_id=third.goal_id)
    assert second.outcome(60).status == "ABORTED"
    assert not first.done()
    go_on.set()
    assert first.outcome(60).status == "ABORTED"
    # Less than the 15 s after which the client asks for the result again, which wakes the goal.
    third.result(10)
    assert aborted == [(1, 0), (3, 2)]
    assert names(server, second.goal_id) == [*ACCEPTED, "aborted"]


def test_a_goal_that_waits_for_its_place_can_be_cancelled(
    fake_server: Any, make_client: Any
) -> None:
    go_on = threading.Event()
    server = fake_server(
        Fibonacci, "fibonacci", result=lambda goal: go_on.wait(30) and None, preempts=True
    )
    client = make_client()
    first = client.call_async({"order": 1}, timeout=60.0)
    server.wait_for("executing")
    second = client.call_async({"order": 2}, timeout=60.0)
    server.wait_for("executing", goal_id=second.goal_id)
    second.cancel()
    assert second.outcome(60).status == "CANCELED"
    go_on.set()
    assert first.outcome(60).status == "ABORTED"


@pytest.mark.parametrize("cancel", ["refuse", "ignore"])
def test_a_goal_that_cannot_be_cancelled_is_preempted(
    fake_server: Any, make_client: Any, cancel: str
) -> None:
    server = fake_server(
        Fibonacci, "fibonacci", end=never_but_the_last, cancel=cancel, preempts=True
    )
    client = make_client()
    first = client.call_async({"order": 1}, timeout=60.0)
    server.wait_for("executing")
    first.cancel()
    server.wait_for("cancel_refused" if cancel == "refuse" else "cancel_accepted")
    client.call({"order": 0}, timeout=60.0)
    server.wait_for("aborted", goal_id=first.goal_id)


def test_it_is_a_setting_of_each_goal(fake_server: Any, make_client: Any) -> None:
    server = fake_server(Fibonacci, "fibonacci", preempts=lambda goal: goal.order == 9)
    server.script([{"end": "never"}, {"accept": False, "preempts": True}, {}, {"end": "never"}])
    client = make_client(retry=NOT_RETRIED)
    first = client.call_async({"order": 9}, timeout=60.0)
    server.wait_for("executing", goal_id=first.goal_id)
    with pytest.raises(GoalRejectedError):  # it replaces none
        client.call({"order": 1}, timeout=60.0)
    client.call({"order": 1}, timeout=60.0)
    second = client.call_async({"order": 1}, timeout=60.0)
    server.wait_for("executing", goal_id=second.goal_id)
    assert server.running() == {str(first.goal_id), str(second.goal_id)}
    client.call({"order": 9}, timeout=60.0)
    assert [future.outcome(60).status for future in (first, second)] == ["ABORTED", "ABORTED"]


@pytest.mark.long
def test_a_burst_of_goals_leaves_the_last(fake_server: Any, make_client: Any) -> None:
    server = fake_server(Fibonacci, "fibonacci", end=never_but_the_last, preempts=True)
    client = make_client()
    futures = [client.call_async({"order": n}, timeout=60.0) for n in range(40, -1, -1)]
    statuses = [future.outcome(60).status for future in futures]
    assert statuses == [GoalState.ABORTED] * 40 + [GoalState.SUCCEEDED]
    assert server.running() == set()
