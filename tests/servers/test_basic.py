"""Reference servers that work, driven by plain rclpy."""

from __future__ import annotations

from typing import Any

import pytest

from tests.rclpy_client import CANCELED, OK, RAN, SUCCEEDED, UNKNOWN_GOAL, Driver, story


@pytest.mark.parametrize("threads", [0, 1, 4])
def test_fibonacci(action_server: Any, driver: Driver, threads: int) -> None:
    server = action_server("fibonacci", threads=threads)
    driver.connect()
    goal_id, status, sequence = driver.call(order=6)
    assert (status, sequence) == (SUCCEEDED, [0, 1, 1, 2, 3, 5, 8])
    server.wait_for("succeeded", goal_id=goal_id)
    assert story(server, goal_id) == [*RAN, *["feedback"] * 5, "succeeded"]
    assert server.events[0].event == "ready"
    assert server.wait_for("goal_received", goal_id=goal_id)[0].details["order"] == 6
    assert server.running() == set()
    # Those feedbacks that came, came in order and were of this goal.
    steps = [[0, 1, 1, 2, 3, 5, 8][: n + 3] for n in range(5)]
    assert driver.feedback[goal_id] == [s for s in steps if s in driver.feedback[goal_id]]


@pytest.mark.long
def test_fibonacci_rejects_and_survives_large_orders(action_server: Any, driver: Driver) -> None:
    server = action_server("fibonacci")
    driver.connect()
    for order in (-1, 101):
        goal_id, future = driver.send(order)
        assert not driver.wait(future).accepted
        server.wait_for("rejected", goal_id=goal_id)
    _, status, sequence = driver.call(order=100)
    assert status == SUCCEEDED
    assert len(sequence) == 101
    assert sequence[50] == 12586269025 % 2**31


def test_goals_run_beside_each_other_and_one_is_cancelled(
    action_server: Any, driver: Driver
) -> None:
    server = action_server("fibonacci", gate=1)
    driver.connect()
    goals = [driver.accepted(order) for order in (3, 4, 5)]
    server.wait_for("feedback", count=2 + 3 + 4)
    assert server.max_running == 3
    assert server.running() == {goal_id for goal_id, _ in goals}

    cancelled, handle = goals.pop(1)
    assert driver.cancel(cancelled) == (OK, [cancelled])
    assert driver.outcome(handle) == (CANCELED, [0, 1, 1, 2, 3])
    server.wait_for("canceled", goal_id=cancelled)
    assert story(server, cancelled)[-3:] == ["cancel_requested", "cancel_accepted", "canceled"]
    assert server.running() == {goal_id for goal_id, _ in goals}

    server.release()
    assert [driver.outcome(handle)[0] for _, handle in goals] == [SUCCEEDED] * 2
    server.wait_for("succeeded", count=2)
    assert server.count("canceled") == 1


def test_the_gate_lets_through_in_order_and_can_be_closed(
    action_server: Any, driver: Driver
) -> None:
    server = action_server("countdown", gate=1, period=0)
    driver.connect()
    ids = []
    for _ in range(3):
        goal_id, _ = driver.accepted(1)
        server.wait_for("feedback", goal_id=goal_id)
        ids.append(goal_id)
    # A feedback is journalled just before the goal gets to the gate: tickets are kept, so it
    # does not matter whether it is there yet.
    server.release(2)
    server.wait_for("succeeded", count=2)
    assert len(server.running()) == 1
    server.release()
    server.wait_for("succeeded", count=3)
    server.command("hold")
    server.wait_for("held")
    goal_id, _ = driver.accepted(1)
    assert driver.cancel(goal_id) == (OK, [goal_id])
    server.wait_for("canceled", goal_id=goal_id)


def test_countdown(action_server: Any, driver: Driver) -> None:
    server = action_server("countdown", period=0.01)
    driver.connect()
    goal_id, status, sequence = driver.call(order=3)
    assert (status, sequence) == (SUCCEEDED, [0])
    server.wait_for("succeeded", goal_id=goal_id)
    assert story(server, goal_id) == [*RAN, *["feedback"] * 3, "succeeded"]
    goal_id, handle = driver.accepted(10_000)
    server.wait_for("feedback", goal_id=goal_id)
    assert driver.cancel(goal_id) == (OK, [goal_id])
    status, sequence = driver.outcome(handle)
    assert status == CANCELED
    assert sequence[-1] == 0
    assert sequence[0] < 10_000


@pytest.mark.long
def test_another_name_and_two_servers(action_server: Any, ros_domain: int) -> None:
    action_server("fibonacci", action_name="arm/fib")
    action_server("countdown", action_name="/count", period=0)
    for name, expected in (("/arm/fib", [0, 1, 1]), ("count", [0])):
        driver = Driver(ros_domain, name=name)
        try:
            assert driver.connect().call(order=2)[1:] == (SUCCEEDED, expected)
        finally:
            driver.close()


@pytest.mark.parametrize("threads", [0, 4])
def test_slow_accept(action_server: Any, driver: Driver, threads: int) -> None:
    server = action_server("slow_accept", gate=1, threads=threads)
    driver.connect()
    goal_id, future = driver.send(4)
    server.wait_for("goal_received", goal_id=goal_id)
    # Cancel requests are answered meanwhile, and do not know the goal.
    assert driver.cancel(goal_id) == (UNKNOWN_GOAL, [])
    assert not future.done()
    server.wait_for("cancel_requested", goal_id=goal_id)
    assert story(server, goal_id) == ["goal_received", "cancel_requested"]
    server.release(1)
    handle = driver.wait(future)
    assert handle.accepted
    assert driver.outcome(handle) == (SUCCEEDED, [0, 1, 1, 2, 3])


def test_slow_accept_by_time(action_server: Any, driver: Driver) -> None:
    server = action_server("slow_accept", delay=0.2)
    driver.connect()
    goal_id, status, _ = driver.call()
    assert status == SUCCEEDED
    received = server.wait_for("goal_received", goal_id=goal_id)[0].monotonic
    assert server.wait_for("accepted", goal_id=goal_id)[0].monotonic - received >= 0.2
