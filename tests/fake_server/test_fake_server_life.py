"""A fake server stops, starts again, and leaves nothing behind."""

from __future__ import annotations

import os
import threading
import warnings
from collections.abc import Callable
from typing import Any

import pytest
from test_msgs.action import Fibonacci, NestedMessage

from actionkit import (
    ServerLostError,
)
from actionkit.servers._serving.executors import ThreadPerGoalExecutor
from actionkit.servers._serving.harness import Harness, JournalledServer
from actionkit.testing import FakeServer, isolated_domain
from tests.fake_server.conftest import FIELDS, NOT_RETRIED
from tests.rclpy_client import Driver


def test_a_server_that_comes_back(ros_domain: int, make_client: Any) -> None:
    server = FakeServer(Fibonacci, "fibonacci", end="never")
    assert "stopped" in repr(server)
    server.stop()
    with server:
        assert "running" in repr(server)
        with pytest.raises(RuntimeError, match="was started already"):
            server.start()
        client = make_client(retry=NOT_RETRIED)
        lost = client.call_async({"order": 1}, timeout=60.0)
        server.wait_for("executing")
    assert server.running() == set()
    with pytest.raises(ServerLostError):
        lost.result(60)
    server.script([{"result": FIELDS, "end": "succeeded"}])
    with server:
        assert list(client.call({"order": 2}, timeout=30.0).sequence) == [3, 1]
    assert [goal.order for goal in server.goals] == [1, 2]
    assert [event.incarnation for event in server.events if event.event == "received"] == [0, 1]


def test_many_in_a_row_leave_nothing(ros_domain: int, driver: Driver) -> None:
    with FakeServer(NestedMessage, "warm_up"):
        pass
    threads, files = set(threading.enumerate()), len(os.listdir("/proc/self/fd"))
    for number in range(20):
        with FakeServer(Fibonacci, "fibonacci", end="never") as server:
            if number % 10 == 0:
                driver.connect().accepted()
                server.wait_for("executing")
    # Where a server was slow to answer, the client's node is kept for up to 4 s (`keep_until`).
    for thread in set(threading.enumerate()) - threads:
        assert thread.name == "actionkit"
        thread.join(5)
        assert not thread.is_alive()
    # A few are of the client, which keeps something of each server that it met.
    assert len(os.listdir("/proc/self/fd")) <= files + 5


def test_a_stop_or_start_that_is_interrupted_leaves_nothing(
    ros_domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C while it waits for the functions of the test, or for its thread to begin."""

    class Interrupted(BaseException):
        """As KeyboardInterrupt, which pytest would take for its own."""

    def interrupted(executor: object, seconds: float) -> bool:
        raise Interrupted

    server = FakeServer(Fibonacci, "fibonacci").start()
    harness = server._harness
    assert harness is not None
    with monkeypatch.context() as patch:
        patch.setattr(ThreadPerGoalExecutor, "join_goals", interrupted)
        with pytest.raises(Interrupted):
            server.stop()
    assert not harness._context.ok()
    server.stop()

    # So does a start, before its `with` statement has begun.
    contexts: list[Any] = []
    start = Harness.start

    def started(harness: Harness) -> None:
        start(harness)
        contexts.append(harness._context)
        raise Interrupted

    with monkeypatch.context() as patch:
        patch.setattr(Harness, "start", started)
        with pytest.raises(Interrupted), server:
            pass
    assert not contexts[0].ok()
    with server:
        assert server.running() == set()


def test_rclpys_signal_handler_is_no_failure_of_the_server(ros_domain: int) -> None:
    """It shuts down every context of the process, this one between two steps of its executor."""
    with FakeServer(Fibonacci, "fibonacci") as server:
        harness = server._harness
        assert harness is not None
        harness._context.shutdown()
        harness._spinner.join(30)
        assert not harness._spinner.is_alive()


def test_two_on_one_name_and_other_domains(fake_server: Any, make_client: Any) -> None:
    servers = [fake_server(Fibonacci, "fibonacci", result=FIELDS) for _ in range(2)]
    with (
        isolated_domain() as other,
        FakeServer(Fibonacci, "fibonacci", domain_id=other) as elsewhere,
    ):
        assert list(make_client().call({}, timeout=30.0).sequence) == [3, 1]
        assert sum(len(server.goals) for server in servers) in (1, 2)
        assert elsewhere.goals == []


class Unread:
    """rclpy's handle of a server, which warns as if no client had read the answer."""

    def __init__(self, handle: Any) -> None:
        self._handle = handle

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._handle, name)
        if not name.startswith("send_"):
            return found

        def send(*arguments: Any) -> None:
            found(*arguments)
            warnings.warn("failed to send response (timeout): nobody", RuntimeWarning, stacklevel=2)

        return send

    def __enter__(self) -> Any:
        return self._handle.__enter__()

    def __exit__(self, *error: Any) -> Any:
        return self._handle.__exit__(*error)


def test_an_answer_that_nobody_reads_ends_no_work(
    ros_domain: int, make_client: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In pytest with `-W error`, as here, the warning is an exception."""
    made = JournalledServer.__init__

    def make(self: Any, *arguments: Any) -> None:
        made(self, *arguments)
        self._handle = Unread(self._handle)

    monkeypatch.setattr(JournalledServer, "__init__", make)
    with FakeServer(Fibonacci, "fibonacci", result=FIELDS) as server:
        assert list(make_client().call({"order": 1}, timeout=30.0).sequence) == [3, 1]
        server.wait_for("succeeded")


EXIT = """
import os, signal, sys
from test_msgs.action import Fibonacci
from actionkit import Client
from actionkit.testing import FakeServer
server = FakeServer(Fibonacci, "fibonacci", end="never").start()
client = Client(Fibonacci, "fibonacci")
future = client.call_async({}, timeout=60)
server.wait_for("executing", timeout=60)
if sys.argv[1] == "rclpy":
    import rclpy
    rclpy.init()
    try:
        signal.raise_signal(signal.SIGINT)   # rclpy's handler shuts down every context
    except KeyboardInterrupt:
        server.stop()
    # Else rclpy's thread for signals now and then aborts the process at its exit.
    rclpy.signals.uninstall_signal_handlers()
elif sys.argv[1] == "fork":
    child = os.fork()
    if child == 0:
        server.stop()
        os._exit(9)  # as multiprocessing does; rclpy itself crashes in a forked child's sys.exit
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 9
    assert server.running()
else:
    server._harness._context.on_shutdown(lambda: print("left the graph", flush=True))
print("end", flush=True)
"""


@pytest.mark.long
@pytest.mark.parametrize("how", ["plain", "rclpy", "fork"])
def test_exit_without_stop(run_script: Callable[..., Any], how: str) -> None:
    script = run_script(EXIT, how, fresh=True)
    code, out, err = script.finish(60)
    said = "end\nleft the graph" if how == "plain" else "end"
    assert (code, out.strip()) == (0, said)
    # Its server was stopped, and nobody has said that the goal ended with it (C2.8).
    assert ("1 goal MAY STILL BE RUNNING" in err) == (how == "rclpy")
