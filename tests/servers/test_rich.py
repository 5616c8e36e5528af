"""Reference servers with rich messages, error codes and floods of feedback."""

from __future__ import annotations

from typing import Any

import pytest
from test_msgs.action import NestedMessage

from actionkit import servers
from tests.rclpy_client import ABORTED, CANCELED, OK, RAN, SUCCEEDED, Driver, story


def test_navigate(action_server: Any, nested: Driver) -> None:
    server = action_server("navigate", rate=100, speed=2)
    nested.connect()
    goal = NestedMessage.Goal()
    goal.nested_field.float64_value = 0.1  # metres, at the option's 2 metres per second
    goal_id, handle = nested.accepted(goal=goal)
    answer = nested.wait(handle.get_result_async())
    assert answer.status == SUCCEEDED
    assert answer.result.nested_field.float64_value == 0
    assert answer.result.nested_field.float32_value == 100
    assert answer.result.nested_field.uint8_value == 2
    assert answer.result.nested_field_no_pkg.duration_value.nanosec == 0
    server.wait_for("succeeded", goal_id=goal_id)
    assert story(server, goal_id) == [*RAN, *["feedback"] * 6, "succeeded"]
    expected = {
        n: (0.1 * (1 - n / 5), 20 * n, round(0.05 * (1 - n / 5), 6), 0 if n == 0 else 1 + (n == 5))
        for n in range(6)
    }
    for feedback in nested.feedback[goal_id]:
        duration = feedback.nested_field_no_pkg.duration_value
        assert (
            feedback.nested_field.float64_value,
            feedback.nested_field.float32_value,
            round(duration.sec + duration.nanosec * 1e-9, 6),
            feedback.nested_field.uint8_value,
        ) == pytest.approx(expected[feedback.nested_field.uint32_value])


@pytest.mark.long
def test_navigate_is_stopped_and_rejects(action_server: Any, nested: Driver) -> None:
    server = action_server("navigate", distance=1e6)
    nested.connect()
    goal_id, handle = nested.accepted()
    server.wait_for("feedback", goal_id=goal_id)
    assert nested.cancel(goal_id) == (OK, [goal_id])
    answer = nested.wait(handle.get_result_async())
    assert answer.status == CANCELED
    assert answer.result.nested_field.uint8_value == 3
    assert 0 < answer.result.nested_field.float64_value <= 1e6
    for field, value in (("float64_value", -1.0), ("float32_value", float("inf"))):
        goal = NestedMessage.Goal()
        setattr(goal.nested_field, field, value)
        nested.rejected(goal=goal)
    with pytest.raises(RuntimeError, match=r"rate=0\.0 is not a positive number"):
        action_server("navigate", rate=0)


@pytest.mark.long
@pytest.mark.parametrize("ends", ["aborted", "succeeded"])
def test_error_code_of_the_goals_choice(action_server: Any, nested: Driver, ends: str) -> None:
    action_server("error_code", ends=ends)
    nested.connect()
    for code in (102, 0, -7):
        goal = NestedMessage.Goal()
        goal.nested_field.int32_value = code
        _, handle = nested.accepted(goal=goal)
        answer = nested.wait(handle.get_result_async())
        assert answer.status == (ABORTED if code and ends == "aborted" else SUCCEEDED)
        assert answer.result.nested_field.int32_value == code
        assert answer.result.nested_field.bool_value == (code == 0)


@pytest.mark.long
def test_error_codes_of_the_servers_choice(action_server: Any, nested: Driver) -> None:
    server = action_server("error_code", codes="102,103,0")
    nested.connect()
    seen = []
    for _ in range(4):
        answer = nested.wait(nested.accepted()[1].get_result_async())
        seen.append((answer.status, answer.result.nested_field.int32_value))
    assert seen == [(ABORTED, 102), (ABORTED, 103), (SUCCEEDED, 0), (SUCCEEDED, 0)]
    server.wait_for("succeeded", count=2)
    assert server.count("aborted") == 2
    with pytest.raises(ValueError, match="codes='1,two' is not a list of numbers"):
        servers.start("error_code", codes="1,two")
    with pytest.raises(ValueError, match="2147483648 does not fit"):
        servers.start("error_code", codes=str(2**31))


@pytest.mark.long
@pytest.mark.parametrize("rate", [0, 2000])
def test_floods(action_server: Any, driver: Driver, rate: int) -> None:
    server = action_server("floods", rate=rate, size=3)
    driver.connect()
    goal_id, status, sequence = driver.call(order=100)
    assert (status, sequence) == (SUCCEEDED, [100])
    flooded = server.wait_for("flooded", goal_id=goal_id)[0]
    assert flooded.details["n"] == 100
    assert flooded.details["seconds"] >= (99 / rate if rate else 0)
    server.wait_for("succeeded", goal_id=goal_id)
    assert story(server, goal_id) == [*RAN, "feedback", "flooded", "succeeded"]
    assert all(len(one) == 3 and one[1:] == [0, 0] for one in driver.feedback[goal_id])


@pytest.mark.long
def test_floods_starve_no_cancel(action_server: Any, driver: Driver) -> None:
    server = action_server("floods")
    driver.connect()
    goals = [driver.accepted(order=2_000_000_000) for _ in range(2)]
    server.wait_for("feedback", count=2)
    for goal_id, handle in goals:
        assert driver.cancel(goal_id) == (OK, [goal_id])
        assert driver.outcome(handle)[0] == CANCELED
        # On the server, by its own clock; whatever of the flood the client is still busy with.
        asked = server.wait_for("cancel_requested", goal_id=goal_id)[0].monotonic
        assert server.wait_for("canceled", goal_id=goal_id)[0].monotonic - asked < 5
    assert server.count("feedback") == 2
