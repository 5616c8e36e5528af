"""A human can always interrupt (C2.5): in each setting the server sees the cancel."""

from __future__ import annotations

import signal
import time

import pytest

from tests.conftest import asked_to_cancel, without_noise

HEAD = """
import sys, threading, time
from actionkit import Client, Timeouts
from test_msgs.action import Fibonacci
"""
CALL = """
with Client(Fibonacci, "fibonacci") as client:
    try:
        client.call({"order": 1}, on_feedback=lambda fb: print("running"))
    except KeyboardInterrupt:
        print("interrupted", client.pending)
        raise
"""
PLAIN = HEAD + CALL
AFTER_INIT = HEAD + "import rclpy\nrclpy.init()\n" + CALL
WITH_A_SPUN_NODE = (
    HEAD
    + """
import rclpy
rclpy.init()
node = rclpy.create_node("users")
def spin():
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
        pass
    except rclpy._rclpy_pybind11.RCLError:
        assert not rclpy.ok()  # the signal came between two steps of the executor (R10)
# Not a daemon: rclpy aborts where the interpreter ends while a thread is in it.
threading.Thread(target=spin).start()
"""
    + CALL.replace('"fibonacci")', '"fibonacci", node=node)')
)


@pytest.mark.parametrize(
    "source", [PLAIN, AFTER_INIT, WITH_A_SPUN_NODE], ids=["plain", "init", "spun node"]
)
def test_ctrl_c_in_a_blocking_call(source, action_server, run_script):
    server = action_server("never_finishes")
    script = run_script(source)
    assert script.line() == "running"
    began = time.monotonic()
    script.process.send_signal(signal.SIGINT)
    assert script.line() == "interrupted 0"
    waited = time.monotonic() - began
    # Seen by the server before the process has ended.
    (accepted,) = server.wait_for("cancel_accepted")
    assert asked_to_cancel(server, accepted.goal_id, waited=waited)
    assert len(server.wait_for("canceled")) == 1
    code, _, err = script.finish()
    assert code == -signal.SIGINT
    assert err.rstrip().endswith("KeyboardInterrupt")
    assert "Exception ignored" not in err


OLD_GOALS = (
    HEAD
    + """
import rclpy
from contextlib import ExitStack
rclpy.init()
grown_old = threading.Timer(2.0, print, ["old"])
with ExitStack() as stack:
    clients = [stack.enter_context(Client(Fibonacci, "fibonacci")) for _ in range(CLIENTS)]
    try:
        for client in clients[1:]:
            client.call_async({"order": 1})
        clients[0].call({"order": 1}, on_feedback=lambda feedback: grown_old.start())
    except BaseException as error:
        print(type(error).__name__)
"""
)


@pytest.mark.parametrize(("number", "clients"), [(signal.SIGINT, 4), (signal.SIGTERM, 4)])
def test_old_goals_are_cancelled_after_rclpys_handler_shut_down(
    number, clients, action_server, run_script
):
    """A goal of some seconds has more sources to wait for, and its cancel has one more (R10)."""
    server = action_server("never_finishes")
    script = run_script(OLD_GOALS.replace("CLIENTS", str(clients)))
    assert script.line() == "old"
    goals = {event.goal_id for event in server.wait_for("accepted", count=clients)}
    script.process.send_signal(number)
    ended = {event.goal_id for event in server.wait_for("canceled", count=clients)}
    _, out, err = script.finish()
    assert ended == goals
    assert "died" not in out + err
    how = {signal.SIGINT: "KeyboardInterrupt", signal.SIGTERM: "ClientClosedError"}
    assert how[number] in out.split()


NOT_WOKEN = (
    HEAD
    + """
import signal
with Client(Fibonacci, "fibonacci") as client, Client(Fibonacci, "nobody") as lonely:
    goal, tell = {"order": 1}, lambda feedback: print("running")
    future = None if CALLS else client.call_async(goal, tell)
    # Like a signal that comes just before a wait begins, it does not wake the main thread.
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        WAIT
    except KeyboardInterrupt:
        print("heard")
"""
)


@pytest.mark.long
@pytest.mark.timeout(60)
@pytest.mark.parametrize(
    "wait",
    [
        "client.call(goal, on_feedback=tell)",
        "future.result()",
        "future.exception(100)",
        "future.outcome()",
        "list(future.feedback())",
        "lonely.wait_for_server()",
    ],
)
def test_a_ctrl_c_that_does_not_wake_the_main_thread_is_heard(wait, action_server, run_script):
    server = action_server("never_finishes")
    source = NOT_WOKEN.replace("CALLS", str("client.call" in wait)).replace("WAIT", wait)
    script = run_script(source)
    assert script.line() == "running"
    script.process.send_signal(signal.SIGINT)
    assert script.line() == "heard"
    server.wait_for("canceled")
    code, _, err = script.finish()
    assert (code, err) == (0, "")


@pytest.mark.long
@pytest.mark.parametrize("rclpys", ["ALL", "NO"])
def test_where_a_handler_of_the_users_only_takes_note_rclpys_decides(
    rclpys, action_server, run_script
):
    """By default it shuts down every context (R10), and that ends the calls (C2.6)."""
    action_server("fibonacci", period=0.3)
    script = run_script(
        HEAD
        + f"""
import rclpy, signal
signal.signal(signal.SIGINT, lambda *_: print("noted"))
rclpy.init(signal_handler_options=rclpy.SignalHandlerOptions.{rclpys})
with Client(Fibonacci, "fibonacci") as client:
    future = client.call_async({{"order": 8}}, lambda feedback: print("running"))
    print(future.exception() or list(future.result().sequence))
"""
    )
    assert script.line() == "running"
    script.process.send_signal(signal.SIGINT)
    code, out, err = script.finish()
    assert (code, err) == (0, "")
    lines = without_noise(out).splitlines()
    assert "noted" in lines
    if rclpys == "NO":
        assert lines[-1] == "[0, 1, 1, 2, 3, 5, 8, 13, 21]"
    else:
        assert "signal handler shut down ROS" in lines[-1]


def test_ctrl_c_while_waiting_for_a_server(action_server, run_script):
    script = run_script(
        HEAD
        + "client = Client(Fibonacci, 'fibonacci', timeouts=Timeouts(server=None))\n"
        + "print('waiting')\n"
        + "client.call({'order': 1})\n"
    )
    assert script.line() == "waiting"
    script.process.send_signal(signal.SIGINT)
    code, _, err = script.finish()
    assert code == -signal.SIGINT
    assert "KeyboardInterrupt" in err


def test_a_second_ctrl_c_does_not_wait(action_server, run_script):
    server = action_server("slow_cancel", gate=1)
    script = run_script(
        HEAD
        + """
client = Client(Fibonacci, "fibonacci", timeouts=Timeouts(cancel=60), on_close="abandon")
try:
    client.call({"order": 1}, on_feedback=lambda fb: print("running"))
except KeyboardInterrupt:
    print("out")
    sys.stdout.flush()
    import os
    os._exit(7)
"""
    )
    assert script.line() == "running"
    script.process.send_signal(signal.SIGINT)
    server.wait_for("cancel_accepted")
    script.process.send_signal(signal.SIGINT)
    assert script.line() == "out"
    assert script.finish()[0] == 7


@pytest.mark.parametrize("presses", [1, 2])
def test_ctrl_c_tells_at_once_what_may_still_run(presses, action_server, run_script):
    server = action_server("slow_cancel", gate=1)
    grace = {1: 0.3, 2: 60}[presses]
    script = run_script(
        HEAD
        + f"client = Client(Fibonacci, 'fibonacci', timeouts=Timeouts(cancel={grace}))"
        + """
try:
    client.call({"order": 1}, on_feedback=lambda fb: print("running"))
except KeyboardInterrupt as error:
    print(*error.args)
    print(*getattr(error, "__notes__", ["actionkit cancel"]))
input()  # as a service or a notebook goes on
"""
    )
    assert script.line() == "running"
    script.process.send_signal(signal.SIGINT)
    (goal,) = server.wait_for("cancel_accepted")
    if presses == 2:
        script.process.send_signal(signal.SIGINT)
    news = f"Goal {goal.goal_id} of this call MAY STILL BE RUNNING: the server has not said that"
    assert news in script.line()
    assert "actionkit cancel" in script.line()
    assert news in script.process.stderr.readline()
    server.release()
    server.wait_for("canceled")
    code, _, err = script.finish()  # which ends the input
    assert (code, "MAY STILL" in err) == (1, False)


@pytest.mark.parametrize("init", ["", "import rclpy; rclpy.init()"])
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_signals_under_asyncio_cancel_the_goal(number, init, action_server, run_script):
    server = action_server("never_finishes")
    script = run_script(
        HEAD
        + init
        + """
import asyncio, signal

async def main():
    task = asyncio.current_task()
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, task.cancel)
    async with Client(Fibonacci, "fibonacci") as client:
        future = client.call_async({"order": 1}, on_feedback=lambda fb: print("running"))
        try:
            await future
        finally:
            print(future.outcome(0).cancel)

try:
    asyncio.run(main())
except (asyncio.CancelledError, KeyboardInterrupt) as error:
    print(type(error).__name__)
    sys.exit(3)
"""
    )
    assert script.line() == "running"
    script.process.send_signal(number)
    assert script.line() == "CONFIRMED"
    assert len(server.wait_for("canceled")) == 1
    assert script.line() == ("KeyboardInterrupt" if number == signal.SIGINT else "CancelledError")
    code, _, err = script.finish()
    assert (code, err) == (3, "")


LEAVES_A_NOTE = (
    HEAD
    + """
import asyncio, signal
loop = asyncio.new_event_loop()
async def cell():
    await client.call_async({"order": 1}, on_feedback=lambda fb: print("running"))
with Client(Fibonacci, "fibonacci") as client:
    task = loop.create_task(cell())
    # What Jupyter's handler does: it wakes no loop.
    signal.signal(signal.SIGINT, lambda *_: loop.call_soon(task.cancel))
    try:
        loop.run_until_complete(task)
    except asyncio.CancelledError:
        print("cancelled")
    assert (signal.set_wakeup_fd(-1) == -1) is (len(sys.argv) == 1)
"""
)


@pytest.mark.parametrize("watched", [False, True])
def test_a_handler_that_wakes_no_loop_cancels_what_is_awaited(watched, action_server, run_script):
    server = action_server("never_finishes")
    watching = "from actionkit import cancel_on_signals\ncancel_on_signals()\n"
    script = run_script(watching + LEAVES_A_NOTE, "on") if watched else run_script(LEAVES_A_NOTE)
    assert script.line() == "running"
    script.process.send_signal(signal.SIGINT)
    server.wait_for("canceled")
    assert script.line() == "cancelled"
    assert script.finish()[0] == 0


@pytest.mark.long
def test_the_program_goes_on_after_ctrl_c(action_server, run_script):
    # rclpy's handler has shut down every context of the process by then (R10).
    action_server("fibonacci", period=0.05)
    script = run_script(
        HEAD
        + """
import rclpy
rclpy.init()
try:
    with Client(Fibonacci, "fibonacci") as client:
        client.call({"order": 90}, on_feedback=lambda fb: print("running"))
except KeyboardInterrupt:
    rclpy.try_shutdown()
    rclpy.init()
with Client(Fibonacci, "fibonacci") as client:
    print("result", list(client.call({"order": 1}, 10).sequence))
    with Client(Fibonacci, "fibonaci", timeouts=Timeouts(server=1.0)) as typo:
        error = typo.call_async({"order": 1}).exception()
        print("hint", "/fibonacci" in str(error))  # it can look at the graph
    print("threads", sum(t.name == "actionkit" for t in threading.enumerate()))
"""
    )
    assert script.line() == "running"
    script.process.send_signal(signal.SIGINT)
    code, out, err = script.finish()
    assert (code, err) == (0, "")
    assert "result [0, 1]" in out
    assert "hint True" in out
    assert "threads 1" in out


def test_whatever_a_signal_handler_raises_cancels_the_goal(action_server, run_script):
    server = action_server("never_finishes")
    script = run_script(
        HEAD
        + """
import signal
signal.signal(signal.SIGTERM, lambda *_: sys.exit(5))
client = Client(Fibonacci, "fibonacci")
try:
    client.call({"order": 1}, on_feedback=lambda fb: print("running"))
finally:
    print("interrupted", client.pending)
"""
    )
    assert script.line() == "running"
    script.process.send_signal(signal.SIGTERM)
    assert script.line() == "interrupted 0"  # before the exit, which cancels, too
    code, _, err = script.finish()
    assert (code, err) == (5, "")
    assert len(server.wait_for("canceled")) == 1
