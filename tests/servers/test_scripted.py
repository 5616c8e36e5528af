"""The server that follows a script, and the check of scripts."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from typing import Any

import pytest

from actionkit import servers
from tests import forked
from tests.conftest import Script
from tests.rclpy_client import (
    ABORTED,
    CANCELED,
    OK,
    PATIENCE,
    SUCCEEDED,
    UNKNOWN_GOAL,
    Driver,
    story,
)


def test_a_script(action_server: Any, driver: Driver) -> None:
    script = [
        {"accept_after": 0.1},
        {"feedback": [7, 8]},
        {"feedback": 3, "period": 0.01},
        "gate",
        {"wait": 0.1},
        {"abort": [102]},
    ]
    server = action_server("scripted", script=script)
    driver.connect()
    goal_id, handle = driver.accepted()
    server.release(1)
    assert driver.outcome(handle) == (ABORTED, [102])
    server.wait_for("aborted", goal_id=goal_id)
    steps = [e for e in server.events if e.event == "step"]
    assert [step.details["index"] for step in steps] == list(range(6))
    assert [step.details["word"] for step in steps] == [
        "accept_after", "feedback", "feedback", "gate", "wait", "abort",
    ]  # fmt: skip
    assert story(server, goal_id) == [
        "goal_received", "step", "accepted", "executing", "step", "feedback",
        "step", *["feedback"] * 3, "step", "step", "step", "aborted",
    ]  # fmt: skip
    known = [[7, 8], [0, 1, 1], [0, 1, 1, 2], [0, 1, 1, 2, 3]]
    assert driver.feedback[goal_id] == [s for s in known if s in driver.feedback[goal_id]]
    times = {step.details["index"]: step.monotonic for step in steps}
    assert times[5] - times[4] >= 0.1
    assert server.wait_for("accepted")[0].monotonic - times[0] >= 0.1


@pytest.mark.long
def test_one_script_for_each_goal_in_turn(action_server: Any, driver: Driver) -> None:
    server = action_server(
        "scripted",
        script=[
            ["reject"],
            [],
            [{"feedback": [3]}],
            [{"wait": 0.01}, "reject"],
            [{"restart": "clean"}, "accept"],
            [{"restart": "kill"}],
            ["raise"],
            [{"succeed": [5]}],
        ],
    )
    driver.connect()
    driver.rejected()
    assert driver.call()[1:] == (SUCCEEDED, [0, 1])
    assert driver.call()[1:] == (SUCCEEDED, [3])
    driver.rejected()
    for incarnation in (1, 2):
        goal_id, _ = driver.send()
        ready = server.wait_for("ready", count=incarnation + 1, timeout=PATIENCE)
        assert ready[-1].incarnation == incarnation
        assert ("accepted" in story(server, goal_id)) == (incarnation == 2)
        driver.connect()
    assert driver.call()[1:] == (ABORTED, [])
    assert driver.call()[1:] == driver.call()[1:] == (SUCCEEDED, [5])


@pytest.mark.long
@pytest.mark.parametrize(("how", "code"), [("kill", -signal.SIGKILL), ("clean", 0)])
@pytest.mark.parametrize("accepted", [True, False])
def test_a_script_with_a_crash(
    action_server: Any, driver: Driver, how: str, code: int, accepted: bool
) -> None:
    crash = {"crash": how}
    server = action_server(
        "scripted", script=[[crash] if accepted else [crash, "accept"], ["succeed"]]
    )
    driver.connect()
    watch = os.pidfd_open(server.pid)
    goal_id, _ = driver.send()
    os.waitid(os.P_PIDFD, watch, os.WEXITED | os.WNOWAIT)
    os.close(watch)
    assert server.terminate() == server.returncode == code
    assert ("accepted" in story(server, goal_id)) == accepted
    server.restart()
    driver.connect()
    assert driver.call()[1] == SUCCEEDED


@pytest.mark.long
@pytest.mark.parametrize("gate", ["gate", "never"])
def test_scripts_heed_cancels(action_server: Any, driver: Driver, gate: str) -> None:
    server = action_server("scripted", script=[{"feedback": [4]}, gate])
    driver.connect()
    goal_id, handle = driver.accepted()
    server.wait_for("feedback", goal_id=goal_id)
    assert driver.cancel(goal_id) == (OK, [goal_id])
    assert driver.outcome(handle) == (CANCELED, [4])


@pytest.mark.long
@pytest.mark.parametrize("accept", [["accept"], []])
def test_scripts_about_cancels(action_server: Any, driver: Driver, accept: list[str]) -> None:
    server = action_server(
        "scripted",
        script=[
            ["refuse_cancel", *accept, "gate", {"succeed": [1]}],
            ["ignore_cancel", *accept, "gate", {"succeed": [2]}],
            ["ignore_cancel", *accept, "gate", "heed_cancel", {"succeed": [3]}],
            [{"cancel_after": 0.2}, *accept, "never"],
            [*accept, "cancel_itself", "never"],
        ],
    )
    driver.connect()
    for ends in ((SUCCEEDED, [1]), (SUCCEEDED, [2]), (CANCELED, [0, 1])):
        goal_id, handle = driver.accepted()
        refused = ends[1] == [1]
        assert driver.cancel(goal_id) == (OK, [] if refused else [goal_id])
        server.wait_for("cancel_refused" if refused else "cancel_accepted", goal_id=goal_id)
        server.release(1)
        assert driver.outcome(handle) == ends
    goal_id, handle = driver.accepted()
    assert driver.cancel(goal_id) == (OK, [goal_id])
    assert driver.outcome(handle)[0] == CANCELED
    asked = server.wait_for("cancel_accepted", goal_id=goal_id)[0].monotonic
    assert server.wait_for("canceled", goal_id=goal_id)[0].monotonic - asked >= 0.2
    assert driver.call()[1] == CANCELED


def test_scripts_that_keep_silent(action_server: Any, driver: Driver) -> None:
    server = action_server("scripted", script=[["no_answer"], ["gate", "accept"], ["no_result"]])
    driver.connect()
    silent, unanswered = driver.send()
    server.wait_for("step", goal_id=silent)
    goal_id, future = driver.send()
    server.wait_for("step", goal_id=goal_id)
    assert driver.cancel(goal_id) == (UNKNOWN_GOAL, [])
    server.release()
    assert driver.outcome(driver.wait(future))[0] == SUCCEEDED
    goal_id, handle = driver.accepted()
    result = handle.get_result_async()
    server.wait_for("succeeded", goal_id=goal_id)
    assert driver.cancel(silent) == (UNKNOWN_GOAL, [])
    assert not result.done()
    assert not unanswered.done()


@pytest.mark.parametrize(
    ("script", "message"),
    [
        (["accept", {"feedbak": 3}], r'script\[1\] is {"feedbak": 3}, which is no step; (.|\n)*'
         r'the steps are:\n(.|\n)*{"accept_after": 0.5}(.|\n)*"feedback": 5, "period"'),
        (["accept", 3], r"script\[1\] is 3, which is no step"),
        ([{}], r"script\[0\] is {}, which is no step"),
        ([["reject"], [{"wait": 1, "gate": 2}]], r"script\[1\]\[0\] is .*more than one word"),
        ([["reject"], "accept"], r'script\[1\] is "accept" beside lists'),
        ([{"wait": -1}], r'script\[0\] is {"wait": -1}; it is written {"wait": 0.2}'),
        ([{"wait": "long"}], r'it is written {"wait": 0.2}'),
        ([{"wait": True}], r'it is written {"wait": 0.2}'),
        (["wait"], r'script\[0\] is "wait"; it is written {"wait": 0.2}'),
        ([{"gate": 1}], r'it is written "gate"'),
        ([{"wait": 1, "period": 1}], r'it is written {"wait": 0.2}'),
        ([{"feedback": 0}], r'it is written {"feedback": \[1, 2, 3\]} or'),
        ([{"feedback": [1.5]}], r'it is written {"feedback": \[1, 2, 3\]} or'),
        ([{"succeed": [2**31]}], r'it is written "succeed" or {"succeed": \[0, 1\]}'),
        ([{"crash": "loud"}], r'it is written {"crash": "kill"} or {"crash": "clean"}'),
        (["accept", "reject"], r'script\[1\] is "reject", but the goal was decided about by '
         r"script\[0\]"),
        ([{"feedback": 3}, "accept"], r"script\[0\] is .*not accepted before script\[1\]"),
        (["reject", "gate"], r'script\[1\] is "gate", but script\[0\] is the end'),
        (["succeed", "abort"], r'script\[1\] is "abort", but script\[0\] is the end'),
        ([[], ["accept", "never", "gate"]], r"script\[1\]\[2\] .* script\[1\]\[1\] is the end"),
        ({"abort": 1}, "not a list of steps"),
        ("[", "not JSON"),
    ],
)  # fmt: skip
def test_wrong_scripts_are_refused_before_anything_is_started(script: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        servers.start("scripted", script=script)


@pytest.mark.long
def test_scripts_in_the_shell(ros_domain: int) -> None:
    command = [sys.executable, "-m", "actionkit.servers", "scripted", "--human", "--option"]
    wrong = forked.run([*command, 'script=["jump"]'], capture_output=True, text=True, check=False)
    assert wrong.returncode == 2
    assert 'script[0] is "jump", which is no step' in wrong.stderr
    assert "Traceback" not in wrong.stderr
    with forked.Popen(
        [*command, 'script=[["reject"], [{"feedback": 3}]]'],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert "ready" in Script(process).line()
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE) == 0
