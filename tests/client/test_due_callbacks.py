"""Callbacks that are due when a client closes, or the program ends, are finished (C1.8, C1.10)."""

from __future__ import annotations

import signal
import time

import pytest

from tests.conftest import NEVER, runs_nothing

HEAD = """
import asyncio, atexit, os, sys, threading, time
from actionkit import Client, Timeouts
from test_msgs.action import Fibonacci
def await_threads():  # they end when there is nothing left to call
    for thread in threading.enumerate():
        if thread.name == 'actionkit-callbacks':
            thread.join()
def say(*words):
    os.write(1, (' '.join(map(str, words)) + '\\n').encode())
def new_client(**options):
    # On a busy machine a server may be seen late, and what a script waits for would never come.
    return Client(Fibonacci, 'fibonacci', timeouts=Timeouts(server=60), **options)
"""
SAVING = """
def save(future):
    say('begun')
    time.sleep(0.3)  # it takes a while
    say('saved')
def call(client, order=2):
    future = client.call_async({'order': order}, timeout=60)
    future.add_done_callback(save)
    return future
"""
DONE = {
    "at the exit": "client = new_client(); call(client).result()",
    "with a goal in flight": """
client = new_client(); client.wait_for_server(10)
running = threading.Event()
future = client.call_async({'order': 90}, lambda feedback: running.set(), timeout=60)
future.add_done_callback(save)
running.wait(10)
""",
    "at the closing": """
with new_client() as client:
    call(client).result()
os._exit(0)
""",
    "the client is dropped": """
def main():
    call(new_client()).result()
main()
""",
    "after the event loop": """
async def main():
    global client
    client = new_client()
    await call(client)
asyncio.run(main())
""",
    "at the end of async with": """
async def main():
    async with new_client() as client:
        await call(client)
    os._exit(0)
asyncio.run(main())
""",
}


@pytest.mark.parametrize("end", DONE)
def test_a_done_callback_is_finished(end, action_server, run_script):
    action_server("fibonacci", period=0.05)
    exits = run_script(HEAD + SAVING + DONE[end])
    assert exits.finish(timeout=15) == (0, "begun\nsaved\n", "")


# --- feedback ----------------------------------------------------------------------------------

SHOWING = """
def show(feedback):
    time.sleep(0.2)
    say(len(feedback.sequence))
async def show_async(feedback):
    await asyncio.sleep(0.2)
    say(len(feedback.sequence))
def call(client, on_feedback):
    global future
    future = client.call_async({'order': 7}, on_feedback, timeout=60)
    return future
def is_last(feedback):
    return len(feedback.sequence) == 8
"""
FEEDBACK = {
    "at the closing": """
with new_client() as client:
    any(map(is_last, call(client, show).feedback()))
say('closed')
await_threads()
os._exit(0)
""",
    "at the end of async with": """
async def main():
    async with new_client() as client:
        async for feedback in call(client, show_async).feedback():
            if is_last(feedback):
                break
    say('closed')
    await asyncio.gather(*asyncio.all_tasks() - {asyncio.current_task()})
asyncio.run(main())
""",
    "at the exit": """
atexit.register(say, 'closed')  # is called last
client = new_client()
any(map(is_last, call(client, show).feedback()))
""",
}


@pytest.mark.parametrize("end", FEEDBACK)
def test_feedback_that_has_come_is_handed_over(end, action_server, run_script):
    server = action_server("fibonacci", period=0.01, gate=1)
    code, out, err = run_script(HEAD + SHOWING + FEEDBACK[end]).finish(timeout=20)
    assert (code, err) == (0, "")
    *lengths, closed = out.split()
    # The first may be missing, as servers are found one after the other.
    assert lengths == [str(length) for length in range(int(lengths[0]), 9)]
    assert len(lengths) > 3
    assert closed == "closed"
    assert runs_nothing(server)


BURST = """
def show(feedback):
    say('begun')
    time.sleep(0.2)
import logging
logging.basicConfig(level=logging.INFO)
client = new_client()
future = client.call_async({'order': 5}, show, timeout=60)
count = future.outcome().feedback_count
say('result', count)
await_threads()
"""


def test_a_slow_callback_gets_nothing_after_the_result_and_the_log_tells(action_server, run_script):
    action_server("fibonacci")  # which sends all its feedback within a millisecond
    code, out, err = run_script(HEAD + BURST).finish(timeout=20)
    *begun, result, count = out.split()
    assert (code, result) == (0, "result")
    left_out = int(count) - len(begun)
    told = (
        f"on_feedback __main__.show of action '/fibonacci' was not given the last {left_out} feed"
    )
    assert left_out > 0
    assert told in err


CUT_OFF = {
    "with a running loop": (
        """
async def main():
    client = new_client()
    call(client)
    await begun.wait()
asyncio.run(main())
""",
        "was cancelled before it returned",
    ),
    "with a loop that is never closed": (
        """
async def main():
    client = new_client()
    call(client)
    await begun.wait()
asyncio.new_event_loop().run_until_complete(main())
""",
        "has not returned",
    ),
    "with a client that is closed in its loop": (
        """
async def main():
    client = new_client()
    call(client)
    await begun.wait()
    client.close()
asyncio.run(main())
""",
        "was cancelled before it returned",
    ),
}
HANGING = """
begun = asyncio.Event()
async def hang(feedback):
    begun.set()
    await asyncio.sleep(60)
def call(client):
    global future
    future = client.call_async({'order': 90}, hang, timeout=60)
"""


@pytest.mark.parametrize("end", CUT_OFF)
@pytest.mark.long
def test_a_coroutine_that_its_loop_leaves_is_named_and_not_waited_for(
    end, action_server, run_script
):
    server = action_server("fibonacci", period=0.01)
    source, told = CUT_OFF[end]
    script = run_script(HEAD + HANGING + source + "say(time.monotonic())")
    ended_at = float(script.line())
    code, out, err = script.finish(timeout=20)
    assert time.monotonic() - ended_at < 4  # it would be 5 s
    assert (code, out) == (0, "")
    assert err.count(f"on_feedback __main__.hang of action '/fibonacci' {told}") == 1
    assert runs_nothing(server)


# --- the end of the wait -------------------------------------------------------------------------

BLOCKED = """
def block(future):
    say('begun')
    threading.Event().wait()
def call(client):
    future = client.call_async({'order': 2}, timeout=60)
    future.add_done_callback(block)
    return future
def refuse(thread):  # as from Python 3.12 on at the exit
    raise RuntimeError("can't create new thread at interpreter shutdown")
"""
AT_EXIT = """
client = new_client()
future = client.call_async({'order': 90}, timeout=60)
future.add_done_callback(block)
sys.stdin.readline()
if NO_THREADS:
    atexit.register(setattr, threading.Thread, 'start', refuse)
"""


@pytest.mark.parametrize("no_threads", [False, True])
def test_one_that_does_not_return_is_named_and_left(no_threads, action_server, run_script):
    server = action_server("fibonacci", period=0.05)
    script = run_script(HEAD + BLOCKED + AT_EXIT.replace("NO_THREADS", str(no_threads)))
    server.wait_for("executing")
    code, out, err = script.finish(timeout=25)
    assert (code, out) == (0, "begun\n")
    assert err.count("done callback __main__.block of action '/fibonacci' has not returned") == 1
    assert runs_nothing(server)


INTERRUPTED = {
    "at the closing": """
with new_client() as client:
    call(client).result()
    say('closing')
""",
    "at the end of async with": """
async def main():
    async with new_client() as client:
        await call(client)
        say('closing')
asyncio.run(main())
""",
    "at the exit": """
client = new_client()
call(client).result()
say('closing')
sys.exit(4)
""",
    "at the exit without threads": """
client = new_client()
future = client.call_async({'order': 90}, timeout=60)
future.add_done_callback(block)
client.wait_for_server()
atexit.register(setattr, threading.Thread, 'start', refuse)
say('closing')
sys.exit(4)
""",
}


@pytest.mark.parametrize(
    "end",
    [
        pytest.param(end, marks=pytest.mark.long if end == "at the exit" else ())
        for end in INTERRUPTED
    ],
)
def test_ctrl_c_ends_the_wait(end, action_server, run_script):
    action_server("fibonacci")
    script = run_script(HEAD + BLOCKED + INTERRUPTED[end])
    assert {script.line(), script.line()} == {"begun", "closing"}
    NEVER.wait(0.5)  # by then it waits for the callback
    began = time.monotonic()
    script.process.send_signal(signal.SIGINT)
    code, _, err = script.finish(timeout=20)
    assert time.monotonic() - began < 4  # it would be 5 s
    assert err.count("done callback __main__.block of action '/fibonacci' has not returned") == 1
    # As Python's own: what waits in `atexit` keeps the exit code.
    assert code == (4 if "exit" in end else -signal.SIGINT)


LATE = """
class Slow:
    def on_event(self, event, call):
        time.sleep(0.4)
        say('observer')
def after():
    say('exit')
    time.sleep(1.5)
"""


@pytest.mark.long
def test_nothing_begins_after_the_exit(action_server, run_script):
    action_server("fibonacci")
    source = """
atexit.register(after)  # is called last
client = new_client(observers=[Slow()])
for _ in range(5):
    client.call({'order': 2}, 10)
"""
    code, out, _ = run_script(HEAD + LATE + source).finish(timeout=20)
    assert code == 0
    assert "observer" in out
    # The one that was running then returns, and no other begins.
    assert out.split()[-3:] in (["observer", "exit", "observer"], ["observer", "observer", "exit"])


FORKED = """
begun = threading.Event()
def slow(future):
    begun.set()
    time.sleep(1)
    say('finished in', os.getpid())
client = new_client()
future = client.call_async({'order': 2}, timeout=60)
future.add_done_callback(slow)
begun.wait()
if (child := os.fork()) == 0:
    client.close()
    atexit._run_exitfuncs()
    os._exit(9)  # rclpy itself crashes in a forked child's sys.exit
began = time.monotonic()
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 9
assert time.monotonic() - began < 0.8
say(os.getpid())
"""


@pytest.mark.long
def test_the_child_of_a_fork_waits_for_no_callback_of_its_parent(action_server, run_script):
    action_server("fibonacci")
    code, out, err = run_script(HEAD + FORKED).finish(timeout=20)
    assert (code, err) == (0, "")
    parent, finished = out.splitlines()
    assert finished == f"finished in {parent}"
