"""The page on MoveIt and joint_trajectory_controller is right, on a server that treats goals alike.

The server is C++, with ros2_control's own RealtimeServerGoalHandle. What it does is in its own log.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from actionkit import (
    Client,
    DeadlineExceededError,
    GoalAbortedError,
    GoalNotReplacedError,
    GoalRejectedError,
)
from tests.docs.snippets import run_page
from tests.docs.test_pages import DOCS
from tests.field import follow_joint_trajectory
from tests.field.conftest import start
from tests.field.kind import Server


@contextmanager
def _controller(monitor_period: float = 0.05) -> Iterator[Server]:
    server = start(follow_joint_trajectory.kind(monitor_period))
    try:
        server.wait_for("ready")
        yield server
    finally:
        server.close()


@contextmanager
def _called(monitor_period: float = 0.05) -> Iterator[tuple[Server, Client[Any]]]:
    with (
        _controller(monitor_period) as server,
        Client(server.kind.type, server.kind.action_name) as arm,
    ):
        assert arm.wait_for_server(30.0)
        yield server, arm


def _move(shoulder: float, seconds: int = 1) -> dict[str, Any]:
    point = {"positions": [shoulder, 0.0], "time_from_start": {"sec": seconds}}
    return {"trajectory": {"joint_names": ["shoulder", "elbow"], "points": [point]}}


def test_the_page(ros_domain: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with _controller() as server:
        monkeypatch.setenv("PYTHONPATH", str(follow_joint_trajectory.folder()))
        run_page(DOCS / "guides" / "moveit.md", tmp_path)
        wanted = ["succeeded", "goal", "succeeded", "path", "cancel_requested"]
        assert server.order(*dict.fromkeys(wanted)) == wanted


def test_a_deadline_stops_the_arm(ros_domain: int) -> None:
    with _called() as (server, arm):
        with pytest.raises(DeadlineExceededError) as late:
            arm.call(_move(0.5, 60), timeout=1.0)
        assert "MAY STILL BE RUNNING" not in str(late.value)
        server.wait_for("cancel_requested")
        assert server.order("executing", "cancel_requested") == ["executing", "cancel_requested"]


def test_a_new_goal_replaces_that_of_another_program(ros_domain: int) -> None:
    with _called() as (server, arm):
        first = arm.call_async(_move(0.5, 60), timeout=20.0)
        server.wait_for("executing")
        with Client(server.kind.type, server.kind.action_name) as other:
            assert other.call(_move(0.1), timeout=20.0).error_code == 0
        with pytest.raises(GoalAbortedError) as preempted:
            first.result(5)
        assert preempted.value.result.error_code == server.kind.type.Result.INVALID_GOAL
        assert server.count("preempted") == 1


def test_what_the_controller_cannot_follow_is_rejected(ros_domain: int) -> None:
    with _called() as (server, arm):
        with pytest.raises(GoalRejectedError):
            arm.call({"trajectory": {"joint_names": ["shoulder"]}}, timeout=20.0)
        server.wait_for("rejected")


@pytest.mark.parametrize("preempt", [False, True])
def test_a_cancel_after_the_success(ros_domain: int, preempt: bool) -> None:
    # In place of 50 ms, so that the cancel always comes in between.
    with _called(monitor_period=3.0) as (server, arm):
        first = arm.call_async(_move(0.1), timeout=20.0)
        server.wait_for("succeeded")
        first.cancel()
        server.wait_for("cancel_too_late")
        with pytest.raises(DeadlineExceededError, match="MAY STILL BE RUNNING"):
            first.result(20)
        assert first.known_to_run
        if not preempt:
            with pytest.raises(GoalNotReplacedError):
                arm.call(_move(0.2), timeout=20.0, replaces=first)
            assert first.known_to_run
            assert server.count("executing") == 1
        replaced: dict[str, Any] = {"replaces": first, "preempt": True} if preempt else {}
        assert arm.call(_move(0.2), timeout=20.0, **replaced).error_code == 0
        assert first.known_to_run is False
