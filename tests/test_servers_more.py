"""Reference servers that queue, choose, flood, come back and follow scripts. Contract C8."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest
from test_msgs.action import NestedMessage

from actionkit import servers
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
    checked,
    story,
)

# rclpy's parser of type descriptions, lark, imports it; nothing that we could help.
pytestmark = pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")


@pytest.fixture
def driver(ros_domain: int) -> Iterator[Driver]:
    driver = Driver(ros_domain)
    yield driver
    driver.close()


@pytest.fixture
def nested(ros_domain: int) -> Iterator[Driver]:
    """A client of NestedMessage."""
    driver = Driver(ros_domain, NestedMessage)
    yield driver
    driver.close()


@pytest.fixture
def action_server(action_server: Any) -> Iterator[Any]:
    """As the plugin's, and it checks that every server leaves in good order."""
    with checked(action_server) as start:
        yield start


def events(server: servers.Server, *wanted: str) -> list[tuple[str, str | None]]:
    """What of these happened, and to which goal."""
    return [(e.event, e.goal_id) for e in server.events if e.event in wanted]


def publishers(driver: Driver) -> set[bytes]:
    """Who publishes the goals' status."""
    found = driver.node.get_publishers_info_by_topic("fibonacci/_action/status")
    return {bytes(one.endpoint_gid) for one in found}


# -- servers that look at their other goals ----------------------------------------------------


def test_guarded_by_rule(action_server: Any, driver: Driver) -> None:
    server = action_server("guarded", max_order=6)
    driver.connect()
    for order, reason in ((-2, "negative"), (3, "odd"), (8, "too large")):
        goal_id = driver.rejected(order)
        rejected = server.wait_for("rejected", goal_id=goal_id)[0]
        assert rejected.details["reason"] == reason
    assert driver.call(order=6)[1:] == (SUCCEEDED, [0, 1, 1, 2, 3, 5, 8])
    assert driver.call(order=0)[1:] == (SUCCEEDED, [0, 1])


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


@pytest.mark.parametrize("threads", [1, 4])
def test_queued_on_other_executors(action_server: Any, driver: Driver, threads: int) -> None:
    server = action_server("queued", period=0.01, threads=threads)
    driver.connect()
    handles = [driver.wait(driver.send(3)[1]) for _ in range(4)]
    assert [driver.outcome(handle)[0] for handle in handles] == [SUCCEEDED] * 4
    server.wait_for("succeeded", count=4)
    assert server.max_running == 1


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


# -- servers with much to say ------------------------------------------------------------------


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


# -- servers that fail at first ----------------------------------------------------------------


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
def test_a_person_sees_the_restart(ros_domain: int, driver: Driver, how: str) -> None:
    command = [sys.executable, "-m", "actionkit.servers", "restarts", "--human"]
    with subprocess.Popen(
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


# -- scripts -----------------------------------------------------------------------------------


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


@pytest.mark.parametrize("gate", ["gate", "never"])
def test_scripts_heed_cancels(action_server: Any, driver: Driver, gate: str) -> None:
    server = action_server("scripted", script=[{"feedback": [4]}, gate])
    driver.connect()
    goal_id, handle = driver.accepted()
    server.wait_for("feedback", goal_id=goal_id)
    assert driver.cancel(goal_id) == (OK, [goal_id])
    assert driver.outcome(handle) == (CANCELED, [4])


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


def test_scripts_in_the_shell(ros_domain: int) -> None:
    command = [sys.executable, "-m", "actionkit.servers", "scripted", "--human", "--option"]
    wrong = subprocess.run(
        [*command, 'script=["jump"]'], capture_output=True, text=True, check=False
    )
    assert wrong.returncode == 2
    assert 'script[0] is "jump", which is no step' in wrong.stderr
    assert "Traceback" not in wrong.stderr
    with subprocess.Popen(
        [*command, 'script=[["reject"], [{"feedback": 3}]]'],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert "ready" in Script(process).line()
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE) == 0


@pytest.mark.parametrize(
    ("name", "option"), [("flaky", "how"), ("restarts", "point"), ("preemptive", "ends")]
)
def test_choices_are_checked_before_anything_is_started(name: str, option: str) -> None:
    with pytest.raises(ValueError, match=f"option {option}='oddly' is not one of"):
        servers.start(name, **{option: "oddly"})
