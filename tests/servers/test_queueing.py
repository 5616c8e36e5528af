"""Reference servers that consider their other goals."""

from __future__ import annotations

from typing import Any

import pytest

from actionkit import servers
from tests.rclpy_client import ABORTED, CANCELED, OK, RAN, SUCCEEDED, Driver, story


def events(server: servers.Server, *wanted: str) -> list[tuple[str, str | None]]:
    """What of these happened, and to which goal."""
    return [(e.event, e.goal_id) for e in server.events if e.event in wanted]


@pytest.mark.long
def test_guarded_by_rule(action_server: Any, driver: Driver) -> None:
    server = action_server("guarded", max_order=6)
    driver.connect()
    for order, reason in ((-2, "negative"), (3, "odd"), (8, "too large")):
        goal_id = driver.rejected(order)
        rejected = server.wait_for("rejected", goal_id=goal_id)[0]
        assert rejected.details["reason"] == reason
    assert driver.call(order=6)[1:] == (SUCCEEDED, [0, 1, 1, 2, 3, 5, 8])
    assert driver.call(order=0)[1:] == (SUCCEEDED, [0, 1])


@pytest.mark.long
def test_guarded_while_busy(action_server: Any, driver: Driver) -> None:
    server = action_server("guarded", busy=1, gate=1)
    driver.connect()
    first, handle = driver.accepted(2)
    second = driver.rejected(2)
    assert server.wait_for("rejected", goal_id=second)[0].details["reason"] == "busy"
    server.release(1)
    assert driver.outcome(handle)[0] == SUCCEEDED
    # It is free as soon as a client can know that the goal has ended.
    third, handle = driver.accepted(2)
    assert driver.cancel(third) == (OK, [third])
    assert driver.outcome(handle)[0] == CANCELED
    fourth, _ = driver.accepted(2)
    server.wait_for("executing", goal_id=fourth)
    assert server.max_running == 1
    assert story(server, first) == [*RAN, "feedback", "succeeded"]


def test_queued(action_server: Any, driver: Driver) -> None:
    server = action_server("queued", gate=1, period=0)
    driver.connect()
    goals = [driver.accepted(order) for order in (1, 2, 3, 4)]
    ids = [goal_id for goal_id, _ in goals]
    server.wait_for("accepted", count=4)
    assert server.running() == set(ids)
    assert [goal for _, goal in events(server, "executing")] in ([], ids[:1])

    # One that waits is cancelled and never executes; the one that runs hears nothing of it.
    assert driver.cancel(ids[2]) == (OK, [ids[2]])
    assert driver.outcome(goals[2][1]) == (CANCELED, [])
    server.wait_for("canceled", goal_id=ids[2])
    assert story(server, ids[2])[-4:] == [
        "accepted",
        "cancel_requested",
        "cancel_accepted",
        "canceled",
    ]
    assert server.running() == {ids[0], ids[1], ids[3]}

    # The one that runs is cancelled, and the next has its turn.
    assert driver.cancel(ids[0]) == (OK, [ids[0]])
    assert driver.outcome(goals[0][1]) == (CANCELED, [0, 1])
    server.release()
    assert driver.outcome(goals[1][1]) == (SUCCEEDED, [0, 1, 1])
    assert driver.outcome(goals[3][1]) == (SUCCEEDED, [0, 1, 1, 2, 3])
    server.wait_for("succeeded", count=2)
    assert server.max_running == 1
    assert [goal for _, goal in events(server, "executing")] == [ids[0], ids[1], ids[3]]
    assert driver.call(order=2)[1] == SUCCEEDED


@pytest.mark.long
@pytest.mark.parametrize("threads", [1, 4])
def test_queued_on_other_executors(action_server: Any, driver: Driver, threads: int) -> None:
    server = action_server("queued", period=0.01, threads=threads)
    driver.connect()
    handles = [driver.wait(driver.send(3)[1]) for _ in range(4)]
    assert [driver.outcome(handle)[0] for handle in handles] == [SUCCEEDED] * 4
    server.wait_for("succeeded", count=4)
    assert server.max_running == 1


@pytest.mark.long
@pytest.mark.parametrize(("ends", "status"), [("aborted", ABORTED), ("canceled", CANCELED)])
def test_preemptive(action_server: Any, driver: Driver, ends: str, status: int) -> None:
    server = action_server("preemptive", gate=1, period=0, ends=ends)
    driver.connect()
    older, older_handle = driver.accepted(3)
    server.wait_for("feedback", goal_id=older, count=2)
    newer, newer_handle = driver.accepted(4)
    assert driver.outcome(older_handle) == (status, [0, 1, 1, 2])
    server.wait_for("executing", goal_id=newer)
    assert server.wait_for("preempted", goal_id=older)[0].details["by"] == newer
    assert events(server, "executing", ends) == [
        ("executing", older),
        (ends, older),
        ("executing", newer),
    ]
    assert ("cancel_requested" in story(server, older)) == (ends == "canceled")
    server.release()
    assert driver.outcome(newer_handle) == (SUCCEEDED, [0, 1, 1, 2, 3])
    assert server.max_running == 1


@pytest.mark.long
@pytest.mark.parametrize(("ends", "status"), [("aborted", ABORTED), ("canceled", CANCELED)])
def test_preemptive_in_a_burst(action_server: Any, driver: Driver, ends: str, status: int) -> None:
    server = action_server("preemptive", gate=1, ends=ends)
    driver.connect()
    sent = [driver.send(order) for order in (5, 5, 5, 5, 1)]
    handles = [driver.wait(future) for _, future in sent]
    assert [driver.outcome(handle)[0] for handle in handles[:-1]] == [status] * 4
    last, _ = sent[-1]
    server.wait_for("executing", goal_id=last)
    # The last can still be cancelled by its client.
    assert driver.cancel(last) == (OK, [last])
    assert driver.outcome(handles[-1])[0] == CANCELED
    assert server.max_running == 1
    assert driver.accepted()
