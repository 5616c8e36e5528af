"""Reference servers that fail, each in one way, driven by plain rclpy."""

from __future__ import annotations

import signal
import uuid
from typing import Any

import pytest
from rclpy.action import get_action_names_and_types
from test_msgs.action import NestedMessage

from tests.rclpy_client import (
    ABORTED,
    CANCELED,
    OK,
    RAN,
    SUCCEEDED,
    UNKNOWN,
    UNKNOWN_GOAL,
    Driver,
    story,
)


def test_silent(action_server: Any, driver: Driver) -> None:
    server = action_server("silent")
    driver.connect()
    goal_id, future = driver.send()
    server.wait_for("goal_received", goal_id=goal_id)
    assert driver.cancel(goal_id) == (UNKNOWN_GOAL, [])
    assert not future.done()
    assert server.terminate() == 0
    assert story(server, goal_id) == ["goal_received", "cancel_requested"]


def test_never_finishes(action_server: Any, driver: Driver) -> None:
    server = action_server("never_finishes")
    driver.connect()
    goal_id, handle = driver.accepted()
    server.wait_for("feedback", goal_id=goal_id)
    assert driver.cancel(goal_id) == (OK, [goal_id])
    assert driver.outcome(handle)[0] == CANCELED


def test_refuses_cancel(action_server: Any, driver: Driver) -> None:
    server = action_server("refuses_cancel", gate=1, period=0)
    driver.connect()
    goal_id, handle = driver.accepted()
    # A server of another test that got the goal, too, would have cancelled it.
    assert driver.cancel(goal_id) == (OK, []), driver.servers()
    server.wait_for("cancel_refused", goal_id=goal_id)
    server.release()
    assert driver.outcome(handle) == (SUCCEEDED, [0])


@pytest.mark.long
def test_a_goal_that_succeeds_while_its_server_thinks_about_the_cancel(
    action_server: Any, driver: Driver
) -> None:
    """rclpy answers that as it answers a refusal: nothing tells the two apart."""
    server = action_server("fibonacci", period=0.3, cancel_takes=1.5)
    driver.connect()
    goal_id, handle = driver.accepted(2)
    assert driver.cancel(goal_id) == (OK, [])
    assert driver.outcome(handle) == (SUCCEEDED, [0, 1, 1])
    server.wait_for("cancel_accepted", goal_id=goal_id)


def test_ignores_cancel(action_server: Any, driver: Driver) -> None:
    server = action_server("ignores_cancel", gate=1, period=0)
    driver.connect()
    goal_id, handle = driver.accepted()
    assert driver.cancel(goal_id) == (OK, [goal_id])
    server.wait_for("cancel_accepted", goal_id=goal_id)
    server.release()
    assert driver.outcome(handle) == (SUCCEEDED, [0])


@pytest.mark.parametrize("gate", [True, False])
def test_slow_cancel(action_server: Any, driver: Driver, gate: bool) -> None:
    server = action_server("slow_cancel", gate=gate, delay=0.2)
    driver.connect()
    goal_id, handle = driver.accepted()
    assert driver.cancel(goal_id) == (OK, [goal_id])
    if gate:
        server.wait_for("cancel_accepted", goal_id=goal_id)
        assert server.running() == {goal_id}
        server.release()
    assert driver.outcome(handle)[0] == CANCELED
    ended = server.wait_for("canceled", goal_id=goal_id)[0].monotonic
    asked = server.wait_for("cancel_accepted", goal_id=goal_id)[0].monotonic
    assert gate or ended - asked >= 0.2


def test_aborts(action_server: Any, driver: Driver) -> None:
    server = action_server("aborts")
    driver.connect()
    goal_id, status, sequence = driver.call(order=3)
    assert (status, sequence) == (ABORTED, [0, 1, 1, 2, 3])
    server.wait_for("aborted", goal_id=goal_id)
    assert story(server, goal_id) == [*RAN, *["feedback"] * 3, "aborted"]


def test_raises(action_server: Any, driver: Driver) -> None:
    server = action_server("raises")
    driver.connect()
    goal_id, status, sequence = driver.call()
    assert (status, sequence) == (ABORTED, [])
    server.wait_for("aborted", goal_id=goal_id)
    assert "on purpose" in server.stderr
    assert driver.call()[1] == ABORTED  # it goes on serving


def test_no_result(action_server: Any, driver: Driver) -> None:
    server = action_server("no_result")
    driver.connect()
    goal_id, handle = driver.accepted()
    result = handle.get_result_async()
    server.wait_for("succeeded", goal_id=goal_id)
    # rclpy cannot send None; later requests are answered all the same.
    server.wait_for("error")
    assert driver.cancel(str(uuid.uuid4())) == (UNKNOWN_GOAL, [])
    assert not result.done()
    assert driver.accepted()


@pytest.mark.long
def test_cancels_itself(action_server: Any, driver: Driver) -> None:
    server = action_server("cancels_itself")
    driver.connect()
    goal_id, status, _ = driver.call()
    assert status == CANCELED
    server.wait_for("canceled", goal_id=goal_id)
    assert sorted(story(server, goal_id)) == sorted(
        [*RAN, "feedback", "cancel_requested", "cancel_accepted", "canceled"]
    )


def test_blocking(action_server: Any, driver: Driver) -> None:
    server = action_server("blocking", gate=1)
    driver.connect()
    goal_id, handle = driver.accepted()
    server.wait_for("executing", goal_id=goal_id)
    probe = driver.result_of(uuid.uuid4())
    server.release()
    assert driver.wait(probe).status == UNKNOWN
    assert driver.outcome(handle)[0] == SUCCEEDED
    # The question was there before the end, and was not looked at before it.
    server.wait_for("succeeded", goal_id=goal_id)
    events = [e.event for e in server.events]
    assert "result_requested" not in events[events.index("executing") : events.index("succeeded")]


@pytest.mark.long
def test_wrong_type(action_server: Any, ros_domain: int) -> None:
    server = action_server("wrong_type")
    # One after the other: with both types on the name in one process, sending fails in the
    # middleware ("Not enough memory in the buffer stream") and destroying is a segfault.
    right = Driver(ros_domain, NestedMessage)
    try:
        right.connect()
        goal_id, future = right.send()
        assert right.wait(right.wait(future).get_result_async()).status == SUCCEEDED
        server.wait_for("succeeded", goal_id=goal_id)
    finally:
        right.close()
    wrong = Driver(ros_domain)
    try:
        served: list[str] = []
        while "test_msgs/action/NestedMessage" not in served:
            wrong.executor.spin_once(timeout_sec=0.02)
            served = dict(get_action_names_and_types(wrong.node)).get("/fibonacci", [])
        assert not wrong.client.server_is_ready()
    finally:
        wrong.close()


@pytest.mark.long
@pytest.mark.parametrize(
    ("point", "expected"),
    [
        ("before_accept", ["goal_received"]),
        ("after_accept", ["goal_received", "accepted"]),
        ("feedback", [*RAN, "feedback"]),
        ("before_result", [*RAN, "succeeded"]),
    ],
)
def test_crashes(action_server: Any, driver: Driver, point: str, expected: list[str]) -> None:
    server = action_server("crashes", point=point)
    driver.connect()
    goal_id, future = driver.send(order=0)
    server.wait_for("crashing", goal_id=goal_id)
    assert server.kill() == -signal.SIGKILL
    assert story(server, goal_id) == [*expected, "crashing"]
    if point != "before_accept":
        assert driver.wait(future).accepted
    assert not server.alive
    server.restart()
    assert server.alive


def test_expires(action_server: Any, driver: Driver) -> None:
    server = action_server("expires")
    driver.connect()
    goal_id, _ = driver.accepted(2)
    server.wait_for("succeeded", goal_id=goal_id)
    status = SUCCEEDED
    while status != UNKNOWN:  # it asks; the waiting is the server's
        status = driver.wait(driver.result_of(uuid.UUID(goal_id))).status
        assert status in (SUCCEEDED, UNKNOWN)


def test_vanishes(action_server: Any, driver: Driver) -> None:
    server = action_server("vanishes")
    driver.connect()
    matched = driver.client.server_is_ready()
    goal_id, handle = driver.accepted()
    result = handle.get_result_async()
    server.wait_for("vanished", goal_id=goal_id)
    while matched:
        driver.executor.spin_once(timeout_sec=0.02)
        matched = driver.client.server_is_ready()
    assert not result.done()
    assert server.alive


def test_twins(action_server: Any, driver: Driver) -> None:
    server = action_server("twins")
    driver.connect()
    while driver.node.count_publishers("fibonacci/_action/status") < 2:
        driver.executor.spin_once(timeout_sec=0.02)
    goal_id, status, _ = driver.call()
    assert status == SUCCEEDED
    ended = server.wait_for("succeeded", goal_id=goal_id, count=2)
    assert {event.details.get("server", 0) for event in ended} == {0, 1}
    assert server.running() == set()
