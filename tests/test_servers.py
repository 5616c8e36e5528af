"""The reference servers, driven by plain rclpy, and the helpers for tests. Contract C8."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from rclpy.action import get_action_names_and_types
from test_msgs.action import NestedMessage

from actionkit import servers
from actionkit.testing import EventLog, isolated_domain
from tests.conftest import Script
from tests.rclpy_client import (
    ABORTED,
    CANCELED,
    OK,
    PATIENCE,
    RAN,
    SUCCEEDED,
    UNKNOWN,
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
def action_server(action_server: Any) -> Iterator[Any]:
    """As the plugin's, and it checks that every server leaves in good order."""
    with checked(action_server) as start:
        yield start


# -- servers that work -------------------------------------------------------------------------


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


@pytest.mark.heavy
def test_five_hundred_goals_run_at_once(action_server: Any, driver: Driver) -> None:
    server = action_server("fibonacci", gate=1, feedback=0, journal="goals")
    driver.connect()
    for _ in range(100):
        # Not more at a time: the server's queue of requests is 10 deep.
        sent = [driver.send(1)[1] for _ in range(5)]
        assert all(driver.wait(future).accepted for future in sent)
    server.wait_for("executing", count=500, timeout=PATIENCE)
    server.release()
    server.wait_for("succeeded", count=500, timeout=PATIENCE)
    assert server.max_running == 500
    assert server.running() == set()


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


# -- servers that fail -------------------------------------------------------------------------


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
    assert driver.cancel(goal_id) == (OK, [])
    server.wait_for("cancel_refused", goal_id=goal_id)
    server.release()
    assert driver.outcome(handle) == (SUCCEEDED, [0])


def test_a_goal_that_succeeds_while_its_server_thinks_about_the_cancel(
    action_server: Any, driver: Driver
) -> None:
    """rclpy answers that as it answers a refusal: nothing tells the two apart."""
    server = action_server("fibonacci", period=0.3, cancel_takes=1.5)
    driver.connect()
    goal_id, handle = driver.accepted(2)
    assert driver.cancel(goal_id) == (OK, [])
    assert driver.outcome(handle) == (SUCCEEDED, [0, 1, 1])
    assert server.count("cancel_accepted") == 1


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
    # In vain does rclpy try to send None; later requests are answered all the same.
    server.wait_for("error")
    assert driver.cancel(str(uuid.uuid4())) == (UNKNOWN_GOAL, [])
    assert not result.done()
    assert driver.accepted()


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


# -- processes ---------------------------------------------------------------------------------


def test_kill_and_restart(action_server: Any, driver: Driver) -> None:
    server = action_server("never_finishes")
    driver.connect()
    goal_id, _ = driver.accepted()
    server.wait_for("executing", goal_id=goal_id)
    first = server.pid
    assert server.kill() == -signal.SIGKILL
    assert not server.alive
    assert server.running() == set()
    with pytest.raises(RuntimeError, match="not running"):
        server.release()
    with pytest.raises(AssertionError, match="process ended"):
        server.wait_for("canceled")

    server.restart()
    assert server.pid != first
    assert [event.incarnation for event in server.wait_for("ready", count=2)] == [0, 1]
    # The dead server is in the graph for as long as its lease lasts, and it took no answer
    # with it: a new goal goes to the new one.
    while True:
        goal_id, future = driver.send()
        driver.executor.spin_until_future_complete(future, 1.0)
        if future.done():
            break
    server.wait_for("accepted", goal_id=goal_id)


@pytest.mark.parametrize("end", ["terminate", "interrupt"])
@pytest.mark.parametrize("name", ["never_finishes", "blocking", "silent"])
def test_a_clean_end_while_goals_run(
    action_server: Any, driver: Driver, name: str, end: str
) -> None:
    options = {"gate": 1} if name == "blocking" else {}
    server = action_server(name, **options)
    driver.connect()
    goal_id, _ = driver.send()
    driver.executor.spin_once(timeout_sec=0)
    server.wait_for("goal_received" if name == "silent" else "executing", goal_id=goal_id)
    assert getattr(server, end)() == 0
    assert "Traceback" not in server.stderr
    assert not {"succeeded", "canceled", "aborted"} & set(story(server, goal_id))
    # It has said goodbye to the graph: its lease of 20 s need not run out.
    bound = time.monotonic() + 10.0
    while driver.client.server_is_ready():
        assert time.monotonic() < bound
        driver.executor.spin_once(timeout_sec=0.02)


def test_pause_and_resume(action_server: Any, driver: Driver) -> None:
    server = action_server("fibonacci")
    driver.connect()
    server.pause()
    assert server.alive
    _, future = driver.send()
    driver.executor.spin_once(timeout_sec=0)
    assert driver.client.server_is_ready()
    assert server.count("goal_received") == 0
    server.resume()
    assert driver.wait(future).accepted
    server.pause()
    assert server.terminate() == 0


def test_the_end_of_stdin_ends_the_child(action_server: Any) -> None:
    server = action_server("fibonacci")
    watch = os.pidfd_open(server.pid)
    server._process.stdin.close()
    assert _gone(watch)
    assert server.terminate() == 0


def test_the_death_of_the_parent_ends_the_child(ros_domain: int) -> None:
    script = (
        "from actionkit import servers; import os, signal; "
        "print(servers.start('fibonacci').pid, flush=True); "
        "os.kill(os.getpid(), signal.SIGKILL)"
    )
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE) as parent:
        assert parent.stdout is not None
        watch = os.pidfd_open(int(parent.stdout.readline()))
        assert _gone(watch)


def _gone(pidfd: int) -> bool:
    """Waits for the end of a process; readable is what its descriptor becomes then."""
    try:
        return bool(select.select([pidfd], [], [], PATIENCE)[0])
    finally:
        os.close(pidfd)


def test_wrong_usage_is_refused_before_anything_is_started() -> None:
    with pytest.raises(ValueError, match=r"no reference server 'nonsense'.*fibonacci"):
        servers.start("nonsense")
    with pytest.raises(ValueError, match=r"no option 'color'.*period"):
        servers.start("fibonacci", color="red")
    with pytest.raises(ValueError, match="period='soon' is not of type float"):
        servers.start("fibonacci", period="soon")


def test_a_server_that_does_not_come_up_says_why(ros_domain: int) -> None:
    with pytest.raises(RuntimeError, match=r"exit code 2.*\n.*(\n.*)*point='never'"):
        servers.start("crashes", point="never")
    with pytest.raises(RuntimeError, match=r"ended while starting.*\n(.*\n)*.*not a name"):
        servers.start("fibonacci", action_name="not a name")


def test_the_journal_is_in_the_error(action_server: Any) -> None:
    server = action_server("fibonacci")
    with pytest.raises(TimeoutError, match=r"saw 0 of 2 'accepted'.*0 s; (.|\n)*ready"):
        server.wait_for("accepted", count=2, timeout=0)
    server.command("dance")
    server.wait_for("error")


def test_the_shell() -> None:
    command = [sys.executable, "-m", "actionkit.servers"]
    listed = subprocess.run([*command, "--list"], capture_output=True, text=True, check=True)
    for name, description in servers.names().items():
        assert f"{name} " in listed.stdout
        assert description in listed.stdout
    wrong = subprocess.run([*command, "nonsense"], capture_output=True, text=True, check=False)
    assert wrong.returncode == 2
    assert "Traceback" not in wrong.stderr


def test_a_person_reads_lines_and_ends_it_with_ctrl_c(ros_domain: int) -> None:
    command = [sys.executable, "-m", "actionkit.servers", "fibonacci", "--human"]
    with subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        person = Script(process)
        assert "ready" in person.line()
        process.send_signal(signal.SIGINT)
        assert person.finish(PATIENCE)[::2] == (0, "")


@pytest.mark.parametrize("module", ["actionkit.servers", "actionkit.testing.plugin"])
def test_importing_does_not_import_rclpy(module: str) -> None:
    script = f"import {module}, sys; sys.exit('rclpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0


def test_public_names() -> None:
    assert servers.__all__ == sorted(servers.__all__)
    assert set(servers.__all__) == {"Server", "ServerEvent", "names", "start"}


# -- helpers for tests -------------------------------------------------------------------------


def test_domains_do_not_meet_and_rest() -> None:
    with isolated_domain() as first, isolated_domain() as second:
        assert len({first, second}) == 2
        assert 1 <= first <= 101
    with isolated_domain() as third:
        assert third not in (first, second)


def test_the_domain_is_in_the_environment(ros_domain: int) -> None:
    assert os.environ["ROS_DOMAIN_ID"] == str(ros_domain)
    assert os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"


def test_event_log() -> None:
    log: EventLog[int] = EventLog()
    thread = threading.Thread(target=lambda: [log(n) for n in range(5)])
    thread.start()
    assert log.wait_for(lambda n: n == 3) == 3
    assert log.wait_for(5) == [0, 1, 2, 3, 4] == list(log)
    thread.join()
    log.append(7)
    assert len(log) == 6
    wanted: list[int | Callable[[int], bool]] = [7, lambda n: n == 8]
    for one in wanted:
        with pytest.raises(TimeoutError, match="7"):
            log.wait_for(one, timeout=0)
