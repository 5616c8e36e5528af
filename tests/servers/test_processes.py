"""The processes of reference servers: start, end, commands, journal, shell, usage."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import time
from typing import Any

import pytest
from test_msgs.action import Fibonacci

from actionkit import Client, servers
from tests import forked
from tests.conftest import Script
from tests.rclpy_client import PATIENCE, Driver, story


@pytest.mark.long
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


@pytest.mark.long
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
    command = [sys.executable, "-c", script]
    with forked.Popen(command, stdout=subprocess.PIPE, text=True) as parent:
        watch = os.pidfd_open(int(Script(parent).line()))
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
    listed = forked.run([*command, "--list"], capture_output=True, text=True, check=True)
    for name, description in servers.names().items():
        assert f"{name} " in listed.stdout
        assert description in listed.stdout
    wrong = forked.run([*command, "nonsense"], capture_output=True, text=True, check=False)
    assert wrong.returncode == 2
    assert "Traceback" not in wrong.stderr


def test_a_person_reads_lines_and_ends_it_with_ctrl_c(ros_domain: int) -> None:
    command = [sys.executable, "-m", "actionkit.servers", "fibonacci", "--human"]
    with forked.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        person = Script(process)
        assert "ready" in person.line()
        with Client(Fibonacci, "fibonacci") as client:
            assert client.wait_for_server(10.0)
            client.call({"order": 1})
        # Not the client's question before that: it is a cancel request for an id of no goal.
        assert "goal_received" in person.line()
        process.send_signal(signal.SIGINT)
        assert person.finish(PATIENCE)[::2] == (0, "")


@pytest.mark.long
@pytest.mark.parametrize("module", ["actionkit.servers", "actionkit.testing.plugin"])
def test_importing_does_not_import_rclpy(module: str) -> None:
    script = f"import {module}, sys; sys.exit('rclpy' in sys.modules)"
    assert forked.run([sys.executable, "-c", script], check=False).returncode == 0


def test_public_names() -> None:
    assert servers.__all__ == sorted(servers.__all__)
    assert set(servers.__all__) == {"Server", "ServerEvent", "names", "start"}


@pytest.mark.parametrize(
    ("name", "option"), [("flaky", "how"), ("restarts", "point"), ("preemptive", "ends")]
)
def test_choices_are_checked_before_anything_is_started(name: str, option: str) -> None:
    with pytest.raises(ValueError, match=f"option {option}='oddly' is not one of"):
        servers.start(name, **{option: "oddly"})


@pytest.mark.parametrize("journal", ["all", "none"])
@pytest.mark.long
def test_sync_reads_all_that_was_written(action_server: Any, driver: Driver, journal: str) -> None:
    server = action_server("aborts", period=0, journal=journal)
    driver.connect()
    for number in range(1, 21):
        driver.call(order=1)
        server.sync()
        ended = (server.count("goal_received"), server.count("aborted"))
        assert ended == ((number, number) if journal == "all" else (0, 0))
    assert "synced" not in {event.event for event in server.events}
    server.pause()
    with pytest.raises(TimeoutError, match=r"did not answer within 0\.2 s"):
        server.sync(0.2)
    server.resume()
    server.sync()
    server.terminate()
    server.sync()  # nothing more can come
