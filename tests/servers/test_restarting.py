"""Reference servers that fail at first; some of them restart."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from typing import Any

import pytest

from tests import forked
from tests.conftest import Script
from tests.rclpy_client import (
    ABORTED,
    CANCELED,
    OK,
    PATIENCE,
    RAN,
    SUCCEEDED,
    UNKNOWN_GOAL,
    Driver,
    story,
)


def publishers(driver: Driver) -> set[bytes]:
    """Who publishes the goals' status."""
    found = driver.node.get_publishers_info_by_topic("fibonacci/_action/status")
    return {bytes(one.endpoint_gid) for one in found}


@pytest.mark.long
def test_flaky_aborts(action_server: Any, driver: Driver) -> None:
    server = action_server("flaky")
    driver.connect()
    outcomes = [driver.call(order=4)[1:] for _ in range(4)]
    assert outcomes == [(ABORTED, [0, 1, 1, 2])] * 2 + [(SUCCEEDED, [0, 1, 1, 2, 3])] * 2
    # It goes on counting in its next process.
    server.restart()
    driver.connect()
    assert driver.call()[1] == SUCCEEDED


def test_flaky_rejects(action_server: Any, driver: Driver) -> None:
    server = action_server("flaky", how="rejects", fails=1)
    driver.connect()
    goal_id = driver.rejected()
    assert server.wait_for("rejected", goal_id=goal_id)[0].details["reason"] == "flaky"
    assert driver.call()[1] == SUCCEEDED


def test_flaky_silent(action_server: Any, driver: Driver) -> None:
    server = action_server("flaky", how="silent", fails=1)
    driver.connect()
    goal_id, silent = driver.send()
    server.wait_for("goal_received", goal_id=goal_id)
    assert driver.call()[1] == SUCCEEDED
    assert driver.cancel(goal_id) == (UNKNOWN_GOAL, [])
    assert not silent.done()


@pytest.mark.long
def test_flaky_crashes(action_server: Any, driver: Driver) -> None:
    server = action_server("flaky", how="crashes", fails=2)
    for incarnation in range(2):
        driver.connect()
        goal_id, handle = driver.accepted(order=4)
        result = handle.get_result_async()
        ready = server.wait_for("ready", count=incarnation + 2, timeout=PATIENCE)[-1]
        assert ready.incarnation == incarnation + 1
        assert story(server, goal_id) == [*RAN, *["feedback"] * 2, "crashing"]
        assert not result.done()
        assert server.running() == set()
    driver.connect()
    assert driver.call(order=4)[1:] == (SUCCEEDED, [0, 1, 1, 2, 3])


@pytest.mark.parametrize("how", ["clean", "kill"])
@pytest.mark.parametrize("point", ["accepted", "feedback"])
@pytest.mark.long
def test_restarts(action_server: Any, driver: Driver, how: str, point: str) -> None:
    server = action_server("restarts", how=how, point=point)
    driver.connect()
    before, pid = publishers(driver), server.pid
    goal_id, handle = driver.accepted(order=2)
    result = handle.get_result_async()
    server.wait_for("ready", count=2, timeout=PATIENCE)
    assert [e.incarnation for e in server.wait_for("restarting")] == [0]
    until = ["goal_received", "accepted"] if point == "accepted" else [*RAN, "feedback"]
    assert story(server, goal_id) == [*until, "leaving"]
    assert server.running() == set()
    assert (server.alive, server.pid) == (True, pid)

    # A new server for all who look at it; the old one is gone, or has left a ghost (R1).
    driver.connect()
    while how == "clean" and publishers(driver) & before:
        driver.executor.spin_once(timeout_sec=0.02)
    assert len(publishers(driver) - before) == 1
    assert driver.cancel(goal_id) == (UNKNOWN_GOAL, [])
    assert not result.done()
    assert driver.call(order=2)[1:] == (SUCCEEDED, [0, 1, 1])
    assert server.count("restarting") == 1
    # Its pipes are those of before.
    server.command("hold")
    server.wait_for("held")


@pytest.mark.parametrize("point", ["accepted", "feedback"])
def test_restarts_can_be_cancelled_before(action_server: Any, driver: Driver, point: str) -> None:
    server = action_server("restarts", point=point)
    driver.connect()
    goal_id, handle = driver.accepted()
    assert driver.cancel(goal_id) == (OK, [goal_id])
    assert driver.outcome(handle)[0] == CANCELED
    assert server.count("restarting") == 0


@pytest.mark.parametrize("how", ["clean", "kill"])
@pytest.mark.long
def test_a_person_sees_the_restart(ros_domain: int, driver: Driver, how: str) -> None:
    command = [sys.executable, "-m", "actionkit.servers", "restarts", "--human"]
    with forked.Popen(
        [*command, "--option", f"how={how}"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        person = Script(process)
        assert "ready" in person.line()
        driver.connect()
        _, handle = driver.accepted()
        result = handle.get_result_async()
        seen = [person.line().split()[1]]
        while seen[-1] != "ready":
            seen.append(person.line().split()[1])
        assert seen[-3:] == ["leaving", "restarting", "ready"]
        assert not result.done()
        process.send_signal(signal.SIGINT)
        code, _, errors = person.finish(PATIENCE)
        # That rclpy could not answer who had asked the server before for the result.
        unanswered = r".*failed to send response \(timeout\)(?s:.*?)send_result_response\(.*\)\n"
        assert (code, re.sub(unanswered, "", errors)) == (0, "")
