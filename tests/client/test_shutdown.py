"""Calls end where the user's ROS is shut down or the process is told to end (C2.6).

What reaches the server in each kind of program is in `faults/test_ending.py`.
"""

from __future__ import annotations

import gc
import linecache
import signal
import sys
import threading
import time
from types import SimpleNamespace

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from test_msgs.action import Fibonacci

from actionkit import CancelReport, Client, ClientClosedError, GoalState, Rosout, cancel_on_signals
from actionkit._calls.on_signal import signals
from actionkit._calls.sending import session
from actionkit._ros.workarounds.listener_hang import stop_listening
from actionkit.testing import EventLog
from tests.client.test_node import spinning, user_node
from tests.conftest import NEVER, is_accepted, runs_nothing, without_noise

HEAD = r"""
import signal, sys, threading, time
import actionkit, rclpy
from functools import partial
from actionkit import Client, Timeouts, cancel_on_signals
from test_msgs.action import Fibonacci
Client = partial(Client, timeouts=Timeouts(server=30))  # seen late on a busy machine
def say(feedback):
    sys.stdout.write("running\n")
"""


def shut_down(node):
    node.context.shutdown()


def destroy(node):
    stop_listening(node)
    node.destroy_node()


@pytest.mark.parametrize("end", [shut_down, destroy])
def test_the_end_of_the_users_node_ends_its_calls(end, action_server, ros_domain):
    server = action_server("never_finishes")
    with user_node(ros_domain) as node, Client(Fibonacci, "fibonacci", node=node) as client:
        future = client.call_async({"order": 2})
        assert is_accepted(future)
        end(node)
        error = future.exception(10)
        assert isinstance(error, ClientClosedError)
        assert error.cancel is CancelReport.CONFIRMED
        assert ("was shut down" if end is shut_down else "was destroyed") in str(error)
        assert runs_nothing(server)
        with pytest.raises(ClientClosedError, match="takes no more calls"):
            client.call({"order": 1}, 10)
        with pytest.raises(ClientClosedError):
            client.wait_for_server(10)


def test_a_client_without_a_node_does_not_depend_on_the_users_context(make_client, action_server):
    server = action_server("fibonacci", gate=1)
    client = make_client()
    rclpy.init()
    future = client.call_async({"order": 2})
    server.wait_for("executing")
    rclpy.shutdown()
    server.release()
    assert future.result(10)


@pytest.mark.long
def test_goals_that_are_left_to_run_by_policy_are_left_to_run(action_server, ros_domain):
    server = action_server("never_finishes")
    with (
        user_node(ros_domain) as node,
        Client(Fibonacci, "fibonacci", node=node, on_close="abandon") as client,
    ):
        future = client.call_async({"order": 2})
        assert is_accepted(future)
        node.context.shutdown()
        assert isinstance(future.exception(10), ClientClosedError)
    server.wait_for("accepted")
    assert len(server.running()) == 1


@pytest.mark.long
def test_nothing_piles_up_in_a_node_that_has_many_clients(ros_domain):
    with user_node(ros_domain) as node, Client(Fibonacci, "keeper", node=node):
        before = len(node.context._callbacks)
        for _ in range(20):
            Client(Fibonacci, "fibonacci", node=node).close()
        gc.collect()
        assert len(node.context._callbacks) == before
        assert len(session.open_sessions) <= 2  # of an earlier test perhaps


@pytest.mark.long
def test_rosout_is_quiet_when_the_context_is_gone(action_server, ros_domain, capfd):
    action_server("never_finishes")
    with user_node(ros_domain) as node:
        rosout = Rosout(node)
        told: EventLog[GoalState] = EventLog()

        def on_event(event, call):
            rosout.on_event(event, call)
            told(event.state)

        observers = [SimpleNamespace(on_event=on_event, on_outcome=rosout.on_outcome)]
        with Client(Fibonacci, "fibonacci", observers=observers) as client:
            future = client.call_async({"order": 2})
            told.wait_for(lambda state: state is GoalState.EXECUTING)
            node.context.shutdown()
            future.cancel()
            assert future.outcome(10).cancel is CancelReport.CONFIRMED
    assert "Failed to publish" not in capfd.readouterr().err


@pytest.mark.long
def test_after_rclpys_signal_handler_only_a_new_client_calls(action_server, run_script):
    server = action_server("never_finishes")
    script = run_script(
        HEAD
        + """
rclpy.init()
client = Client(Fibonacci, "fibonacci")
for _ in range(3):
    try:
        client.call({"order": 1}, on_feedback=say)
    except actionkit.ClientClosedError as error:
        print("shut down ROS in this process: make a new client" in str(error), error.cancel)
    rclpy.try_shutdown()
    rclpy.init()
print(client.closed)
Client(Fibonacci, "fibonacci").call_async({"order": 1}, on_feedback=say).exception()
"""
    )
    assert script.line() == "running"
    script.process.send_signal(signal.SIGTERM)
    assert script.line() == "False CONFIRMED"
    assert [script.line() for _ in range(3)] == ["True None", "True None", "True"]
    assert script.line() == "running"
    script.process.kill()
    assert len(server.wait_for("executing", count=2)) == 2


def test_ctrl_c_cancels_what_else_would_be_left_to_run(action_server, run_script):
    """Though rclpy's handler shuts down the context at the same time."""
    server = action_server("never_finishes")
    script = run_script(
        HEAD
        + """
rclpy.init()
with Client(Fibonacci, "fibonacci", on_close="abandon") as client:
    client.call({"order": 1}, on_feedback=say)
"""
    )
    assert script.line() == "running"
    script.process.send_signal(signal.SIGINT)
    assert script.finish()[0] == -signal.SIGINT
    assert runs_nothing(server)


# --- cancel_on_signals ---------------------------------------------------------------------------

MANY_THREADS = (
    HEAD
    + """
def call_in_a_loop():
    while True:
        try:
            client.call({"order": 1}, on_feedback=say)
        except BaseException:
            pass
cancel_on_signals()
client = Client(Fibonacci, "fibonacci")
for _ in range(8):
    threading.Thread(target=call_in_a_loop, daemon=True).start()
MAIN
"""
)


@pytest.mark.parametrize("main", ["threading.Event().wait()", "client.call({'order': 1})"])
def test_nothing_begins_between_the_signal_and_the_end(main, action_server, run_script):
    server = action_server("never_finishes")
    script = run_script(MANY_THREADS.replace("MAIN", main))
    for _ in range(8):
        assert script.line() == "running"
    script.process.send_signal(signal.SIGTERM)
    code, _, err = script.finish(60)
    assert code == -signal.SIGTERM
    assert "MAY STILL" not in err
    assert runs_nothing(server)
    # And what was sent was at least cancelled.
    assert len(server.wait_for("executing", count=8)) >= 8


@pytest.mark.parametrize(
    "order", ["cancel_on_signals(); rclpy.init()", "rclpy.init(); cancel_on_signals()"]
)
@pytest.mark.long
def test_rclpys_handler_has_its_way(order, action_server, run_script):
    server = action_server("never_finishes")
    script = run_script(
        HEAD
        + f"""
client = Client(Fibonacci, "fibonacci")
{order}
node = rclpy.create_node("users")
future = client.call_async({{"order": 1}}, say)
try:
    rclpy.spin(node)
# The latter where the signal comes between two steps of the executor (R10)
except (rclpy.executors.ExternalShutdownException, rclpy._rclpy_pybind11.RCLError):
    print("shut down", future.done())
rclpy.try_shutdown()
signal.raise_signal(signal.SIGTERM)  # it is gone with rclpy.shutdown()
print("alive")
"""
    )
    assert script.line() == "running"
    script.process.send_signal(signal.SIGTERM)
    assert script.line() == "shut down True"
    code, out, err = script.finish()
    assert without_noise(err) == ""
    assert len(server.wait_for("canceled")) == 1
    assert (code, out) in ((-signal.SIGTERM, ""), (0, "alive\n"))


BLOCKED_IN_C = (
    HEAD
    + """
rclpy.init(signal_handler_options=rclpy.SignalHandlerOptions.NO)
cancel_on_signals()
client = Client(Fibonacci, "fibonacci")
node = rclpy.create_node("users", start_parameter_services=False)
client.call_async({"order": 1}, say)
rclpy.spin(node)  # which nothing wakes
"""
)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_goals_are_cancelled_while_the_main_thread_hears_nothing(number, action_server, run_script):
    server = action_server("never_finishes")
    script = run_script(BLOCKED_IN_C)
    assert script.line() == "running"
    script.process.send_signal(number)
    assert len(server.wait_for("canceled")) == 1
    assert script.finish()[0] == -number


@pytest.mark.parametrize("warnings", ["default", "error"])
@pytest.mark.long
def test_it_goes_with_trio(warnings, action_server, run_script):
    """Trio warns of a wakeup file descriptor that it finds, as one of `cancel_on_signals` is."""
    server = action_server("never_finishes")
    script = run_script(
        HEAD
        + f"""
import trio, warnings
warnings.simplefilter({warnings!r}, RuntimeWarning)
cancel_on_signals()
async def main():
    async with Client(Fibonacci, "fibonacci") as client:
        await client.call_async({{"order": 1}}, say)
trio.run(main)
"""
    )
    assert script.line() == "running"
    script.process.send_signal(signal.SIGTERM)
    code, _, err = script.finish(30)
    assert (code, err) == (-signal.SIGTERM, "")
    assert len(server.wait_for("canceled")) == 1


WAITING = (
    HEAD
    + """
if HANDLER:
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(5))
cancel_on_signals()
client = Client(Fibonacci, "fibonacci", timeouts=Timeouts(cancel=60.0))
MAIN
"""
)


IN_PYTHON = "client.call({'order': 1}, on_feedback=say)"
IN_C = """
client.call_async({'order': 1}, say)
rclpy.init(signal_handler_options=rclpy.SignalHandlerOptions.NO)
rclpy.spin(rclpy.create_node('users', start_parameter_services=False))
"""


@pytest.mark.long
@pytest.mark.parametrize(
    ("main", "handler", "second"),
    [
        # In C nothing wakes the main thread, where a handler of the user's is called.
        (IN_PYTHON, True, signal.SIGTERM),
        (IN_PYTHON, False, signal.SIGINT),
        (IN_C, False, signal.SIGHUP),
    ],
    ids=["python, handler", "python", "c"],
)
def test_a_second_signal_ends_the_wait(main, handler, second, action_server, run_script):
    server = action_server("slow_cancel", gate=1)
    script = run_script(WAITING.replace("HANDLER", str(handler)).replace("MAIN", main))
    assert script.line() == "running"
    script.process.send_signal(signal.SIGTERM)
    server.wait_for("cancel_accepted")
    script.process.send_signal(second)
    code, _, err = script.finish(30)
    assert code == (5 if handler else -signal.SIGTERM)
    assert err.count("MAY STILL BE RUNNING") == 1


@pytest.mark.long
def test_a_handler_that_was_there_is_called_and_the_program_goes_on(action_server, run_script):
    server = action_server("never_finishes")
    script = run_script(
        HEAD
        + """
told = threading.Event()
signal.signal(signal.SIGTERM, lambda number, frame: told.set())
cancel_on_signals()
with Client(Fibonacci, "fibonacci") as client:
    future = client.call_async({"order": 1}, say)
    told.wait()
    print(future.outcome(0).cancel)
    client.call_async({"order": 1}, say)
    sys.stdin.readline()
"""
    )
    for _ in range(2):
        if _:
            script.process.send_signal(signal.SIGTERM)
            assert script.line() == "CONFIRMED"
        assert script.line() == "running"
    server.sync()
    assert len(server.running()) == 1
    code, _, err = script.finish()
    assert (code, err) == (0, "")
    assert runs_nothing(server)


@pytest.mark.long
def test_signals_that_are_ignored_stay_so_unless_they_are_named(action_server, run_script):
    server = action_server("never_finishes")
    script = run_script(
        HEAD
        + """
signal.signal(signal.SIGHUP, signal.SIG_IGN)
signal.signal(signal.SIGUSR1, signal.SIG_IGN)
cancel_on_signals()
cancel_on_signals(signal.SIGUSR1)
with Client(Fibonacci, "fibonacci") as client:
    client.call({"order": 1}, on_feedback=say)
"""
    )
    assert script.line() == "running"
    script.process.send_signal(signal.SIGHUP)
    script.process.send_signal(signal.SIGUSR1)
    assert script.finish()[0] == -signal.SIGUSR1
    assert runs_nothing(server)


@pytest.mark.long
def test_a_forked_child_leaves_the_goals_of_its_parent_alone(action_server, run_script):
    server = action_server("never_finishes")
    script = run_script(
        HEAD
        + """
import concurrent.futures, os
cancel_on_signals()
client = Client(Fibonacci, "fibonacci")
future = client.call_async({"order": 1})
next(iter(future.feedback()))
if not (child := os.fork()):
    os.write(1, b"child\\n")  # not print: a thread may have held its lock
    threading.Event().wait()
sys.stdin.readline()
os.kill(child, signal.SIGTERM)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
concurrent.futures.wait([future], 1)
print(future.running())
"""
    )
    assert script.process.stdin is not None
    assert script.line() == "child"
    server.sync()
    assert len(server.running()) == 1
    script.process.stdin.write("\n")
    script.process.stdin.flush()
    assert script.finish()[1].splitlines() == [str(-signal.SIGTERM), "True"]
    assert runs_nothing(server)


@pytest.fixture
def _signals_as_they_were():
    kept = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    yield
    assert {number: signal.getsignal(number) for number in kept} == kept


@pytest.mark.usefixtures("_signals_as_they_were")
def test_at_the_end_of_the_block_all_is_as_it_was():
    with cancel_on_signals() as outer:
        assert isinstance(outer, cancel_on_signals)
        assert signal.getsignal(signal.SIGTERM) is signals._on_signal
        with cancel_on_signals(signal.SIGTERM, signal.SIGTERM):
            assert signal.getsignal(signal.SIGTERM) is signals._on_signal
        assert signal.getsignal(signal.SIGTERM) is signals._on_signal
    with cancel_on_signals(signal.SIGTERM):
        before = signal.signal(signal.SIGTERM, signal.SIG_IGN)  # what is set later stays
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_IGN
    assert before is signals._on_signal
    with cancel_on_signals(signal.SIGTERM):  # also where it was ignored
        assert signal.getsignal(signal.SIGTERM) is signals._on_signal
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_IGN
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    assert signal.set_wakeup_fd(-1) == -1


@pytest.mark.parametrize(
    "given",
    ["SIGTERM", 15.0, True, None, [signal.SIGTERM], 0, 1000, signal.SIGKILL, signal.SIGCHLD],
)
@pytest.mark.usefixtures("_signals_as_they_were")
def test_what_is_no_such_signal_is_refused(given):
    error = ValueError if type(given) in (int, signal.Signals) else TypeError
    with pytest.raises(error, match="cancel_on_signals"):
        cancel_on_signals(given)


@pytest.mark.usefixtures("_signals_as_they_were")
def test_it_is_for_the_main_thread():
    errors = []

    def call() -> None:
        try:
            cancel_on_signals()
        except RuntimeError as error:
            errors.append(str(error))

    thread = threading.Thread(target=call)
    thread.start()
    thread.join()
    assert "main thread" in errors[0]


# --- spin, where rclpy woke it too early ----------------------------------------------------------

# At a signal rclpy wakes executors first, then shuts down contexts. A quick one misses the latter.


def shut_down_unheard(context: Context) -> None:
    with context.handle:
        context.handle.shutdown()  # which wakes nobody


def is_in_wait(thread: threading.Thread) -> bool:
    """Wait until an executor's thread is, and stays, where only an event of ROS wakes it.

    After each callback, and each change of its node, the executor wakes itself once more.
    """
    until, looks = time.monotonic() + 20, 0
    while time.monotonic() < until and looks < 100:
        frame = sys._current_frames()[thread.ident]
        line = linecache.getline(frame.f_code.co_filename, frame.f_lineno)
        looks = looks + 1 if "wait_set.wait(" in line else 0
        NEVER.wait(0.002)
    return looks == 100


@pytest.mark.long
@pytest.mark.parametrize("spin", ["single", "multi", "rclpy.spin"])
def test_spin_ends_where_rclpy_woke_it_too_early(spin, action_server, ros_domain):
    server = action_server("never_finishes")
    with (
        user_node(ros_domain) as node,
        Client(Fibonacci, "fibonacci", node=node) as client,
        spinning(node, spin) as thread,
    ):
        future = client.call_async({"order": 1})
        server.wait_for("executing")
        assert is_in_wait(thread)
        shut_down_unheard(node.context)
        assert isinstance(future.exception(10), ClientClosedError)
        thread.join(10)
        assert not thread.is_alive()


@pytest.mark.parametrize("how", ["told", "closed"])
def test_so_it_does_beside_a_client_without_a_node(how, make_client, ros_domain):
    client = make_client()
    runtime = client._session.connection.runtime
    rclpy.init(domain_id=ros_domain, signal_handler_options=rclpy.SignalHandlerOptions.NO)
    node = Node("users")
    try:
        with spinning(node, "single") as thread:
            assert is_in_wait(thread)
            shut_down_unheard(node.context)
            if how == "told":
                shut_down_unheard(runtime.context)
                runtime.run(runtime._look_at_context)
            else:
                client.close()
            thread.join(10)
            assert not thread.is_alive()
    finally:
        stop_listening(node)
        node.destroy_node()
        rclpy.try_shutdown()


@pytest.mark.long
@pytest.mark.parametrize("how", ["raises", "blocks"])
def test_an_executor_of_the_users_holds_up_no_end(how, action_server, ros_domain):
    server = action_server("never_finishes")
    is_bad = threading.Event()
    over = threading.Event()

    class Executor(SingleThreadedExecutor):
        def wake(self) -> None:
            if not is_bad.is_set():
                super().wake()
            elif how == "raises":
                raise OSError("a defect of the user's")
            else:
                over.wait(60)

    with user_node(ros_domain) as node, Client(Fibonacci, "fibonacci", node=node) as client:
        executor = Executor(context=node.context)
        executor.add_node(node)
        future = client.call_async({"order": 1})
        server.wait_for("executing")
        is_bad.set()
        shut_down_unheard(node.context)
        try:
            error = future.exception(10)
        finally:
            is_bad.clear()
            over.set()
        assert isinstance(error, ClientClosedError)
        assert error.cancel is CancelReport.CONFIRMED
        assert runs_nothing(server)
