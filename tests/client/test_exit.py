"""The interpreter's exit at any moment: no hang, no traceback, no goal left (C1.10, C1.12)."""

from __future__ import annotations

import re
import signal
import subprocess
import time
from contextlib import suppress
from pathlib import Path

import pytest

from actionkit import RetryPolicy, ServerLostError, Timeouts
from tests.conftest import runs_nothing

HEAD = """
import sys, threading
from functools import partial
from actionkit import Client, Timeouts
from test_msgs.action import Fibonacci
Client = partial(Client, timeouts=Timeouts(server=30))  # seen late on a busy machine
"""
MOMENTS = {
    "before a call": "client = Client(Fibonacci, 'fibonacci')",
    "after a call": "client = Client(Fibonacci, 'fibonacci'); client.call({'order': 2}, 10)",
    "without a server": "client = Client(Fibonacci, 'nobody'); client.call_async({'order': 2})",
    "at once after sending": """
client = Client(Fibonacci, 'fibonacci')
client.wait_for_server(10)
futures = [client.call_async({'order': 90}) for _ in range(20)]
""",
    "while it runs": """
client = Client(Fibonacci, 'fibonacci')
running = threading.Event()
future = client.call_async({'order': 90}, on_feedback=lambda fb: running.set())
assert running.wait(10)
""",
    "inside a judge that blocks": """
client = Client(Fibonacci, 'fibonacci', classify=lambda outcome: threading.Event().wait())
judged = client.call_async({'order': 2}, timeout=60)
running = threading.Event()
future = client.call_async({'order': 90}, on_feedback=lambda fb: running.set())
assert running.wait(10)
""",
    "with a thread in result()": """
client = Client(Fibonacci, 'fibonacci')
running = threading.Event()
future = client.call_async({'order': 90}, on_feedback=lambda fb: running.set())
threading.Thread(target=future.exception, daemon=True).start()
assert running.wait(10)
""",
    "the client is dropped": """
future = Client(Fibonacci, 'fibonacci').call_async({'order': 2})
assert future.result(10)
""",
    "after close": """
with Client(Fibonacci, 'fibonacci') as client:
    client.call({'order': 2}, 10)
""",
    "after rclpy.init and shutdown": """
import rclpy
rclpy.init()
client = Client(Fibonacci, 'fibonacci')
client.call({'order': 2}, 10)
future = client.call_async({'order': 90})
rclpy.shutdown()
""",
    "the client was interrupted while it was made": """
import atexit
from actionkit._calls.sending import session
atexit.register(lambda: [print(t) for t in threading.enumerate() if t.name == 'actionkit'])
session.Session = None  # it raises in the place of Ctrl-C
try:
    Client(Fibonacci, 'fibonacci')
except TypeError:
    pass
""",
    "in a child that was forked": """
import atexit, os, signal
client = Client(Fibonacci, 'fibonacci')
client.call({'order': 2}, 10)
future = client.call_async({'order': 90})
if (child := os.fork()) == 0:
    signal.alarm(10)  # kills it where it waits for ever
    for use in (lambda: client.call({'order': 1}), future.result, future.cancel):
        try:
            use()
            os._exit(1)
        except RuntimeError as error:
            assert 'forked' in str(error) and ' Client ' in str(error)
    client.close()
    atexit._run_exitfuncs()  # the goal is its parent's: nothing is waited for, or told
    os._exit(9)  # as multiprocessing does; rclpy itself crashes in a forked child's sys.exit
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 9
assert client.call({'order': 2}, 10)
""",
}


WITH_LIBRARIES = (
    "at once after sending",
    "while it runs",
    "with a thread in result()",
    "inside a judge that blocks",
    "after rclpy.init and shutdown",
)
"""When libraries end as they do in an interpreter of its own, too."""
CODES = [(moment, 0) for moment in MOMENTS] + [("while it runs", 4)]


@pytest.mark.parametrize(("moment", "code"), CODES)
@pytest.mark.every
def test_exit(moment, code, action_server, run_script):
    server = action_server("fibonacci", period=0.05)
    fresh = moment in WITH_LIBRARIES
    exits = run_script(HEAD + MOMENTS[moment] + f"\nsys.exit({code})", fresh=fresh)
    assert exits.finish(timeout=15) == (code, "", "")
    assert runs_nothing(server)


WORKERS = """
import multiprocessing, sys, threading
from concurrent.futures import ProcessPoolExecutor
from actionkit import Client, Timeouts
from test_msgs.action import Fibonacci

def work(end):
    global client
    client = Client(Fibonacci, "fibonacci", timeouts=Timeouts(server=25))
    running = threading.Event()
    client.call_async({"order": 1}, lambda _: running.set())
    assert running.wait(25)
    if end == "raises":
        raise RuntimeError("mine")
    if end == "exits":
        sys.exit(3)

def main(how, end):
    context = multiprocessing.get_context(how)
    if end == "ends with its pool":
        with ProcessPoolExecutor(1, context) as pool:
            sys.exit(pool.submit(work, end).result())
    child = context.Process(target=work, args=(end,))
    child.start()
    child.join()
    sys.exit(child.exitcode)
"""
CODES_OF_CHILDREN = {"returns": 0, "raises": 1, "exits": 3, "ends with its pool": 0}
BY_DEFAULT = (("fork", "raises"), ("forkserver", "exits"), ("fork", "ends with its pool"))


@pytest.mark.long
@pytest.mark.parametrize(
    ("how", "end"),
    [
        pytest.param(how, end, marks=() if (how, end) in BY_DEFAULT else pytest.mark.long)
        for how in ("fork", "forkserver", "spawn")
        for end in CODES_OF_CHILDREN
    ],
)
def test_a_child_of_multiprocessing(how, end, action_server, tmp_path, run_script):
    """Except spawned ones, it ends without the functions of `atexit`."""
    server = action_server("never_finishes")
    (tmp_path / "workers.py").write_text(WORKERS, "utf-8")
    script = run_script(
        "import sys; sys.path.append(sys.argv[3]); import workers; workers.main(*sys.argv[1:3])",
        how,
        end,
        str(tmp_path),
    )
    code, _, err = script.finish(30)
    assert code == CODES_OF_CHILDREN[end], err
    assert "MAY STILL" not in err
    assert len(server.wait_for("accepted")) == 1
    assert runs_nothing(server)


UNSEEN = """
future = Client(Fibonacci, 'nobody').call_async({'order': 2}, timeout=0.1)
concurrent.futures.wait([future])
"""


@pytest.mark.long
@pytest.mark.parametrize(
    ("end", "told"),
    [
        ("", 1),
        ("future.itself = future", 1),
        ("del future", 1),
        ("future.exception()", 0),
        ("logging.getLogger('actionkit').setLevel(logging.CRITICAL)", 0),
        ("sys.stderr.close(); sys.stderr = None", 0),
    ],
)
def test_a_failure_that_nobody_looked_at_is_told_when_the_interpreter_drops_it(
    end, told, ros_domain, run_script
):
    source = "import concurrent.futures, logging" + HEAD + UNSEEN + end
    code, out, err = run_script(source).finish(timeout=15)
    assert (code, out) == (0, "")
    assert err.count("nobody asked its future how it ended: No server for") == told
    assert len(err.splitlines()) == told


UNANSWERED = """
client = Client(Fibonacci, 'fibonacci', timeouts=Timeouts(cancel=0.3))
future = client.call_async({'order': 1})
future.add_done_callback(lambda done: done.exception())  # which shows it to nobody
cancel_on_signals(signal.SIGTERM)
sys.stdin.readline()
"""


@pytest.mark.parametrize("end", ["exit", "SIGTERM"])
def test_a_silent_server_does_not_hold_up_the_exit(end, action_server, run_script):
    server = action_server("silent")
    head = HEAD + "import signal\nfrom actionkit import cancel_on_signals\n"
    script = run_script(head + UNANSWERED)
    server.wait_for("goal_received")
    if end == "SIGTERM":
        script.process.send_signal(signal.SIGTERM)
    else:
        script.process.stdin.close()
        script.process.stdin = None
    code, out, err = script.finish(timeout=10)
    assert (code, out) == (0 if end == "exit" else -signal.SIGTERM, "")
    assert err.count("1 goal MAY STILL BE RUNNING") == 1  # it may be accepted yet (C2.8)


UNACCEPTED = """
timeouts = Timeouts(server=30, accept=0.3, cancel=20)
client = Client(Fibonacci, 'fibonacci', timeouts=timeouts, retry=RetryPolicy.none())
print(type(client.call_async({'order': 90}).exception()).__name__, flush=True)
"""


def test_the_exit_waits_for_a_goal_that_may_be_accepted_late(action_server, run_script):
    """Its call has ended: the server does not know the goal yet."""
    server = action_server("slow_accept", gate=1, period=60)
    script = run_script(f"{HEAD}from actionkit import RetryPolicy\n{UNACCEPTED}")
    assert script.line() == "AcceptanceTimeoutError"
    goal = server.wait_for("goal_received")[0].goal_id
    server.wait_for("cancel_requested", goal_id=goal, count=3)
    server.release()
    server.wait_for("canceled", goal_id=goal)
    assert script.finish(timeout=15) == (0, "", "")


IN_THE_USERS_CONTEXT = """
import rclpy
rclpy.init()
client = Client(Fibonacci, 'fibonacci', node=rclpy.create_node('users'))
"""


@pytest.mark.long
@pytest.mark.parametrize("make", ["client = Client(Fibonacci, 'fibonacci')", IN_THE_USERS_CONTEXT])
def test_ctrl_c_ends_the_wait_and_crashes_nothing(make, action_server, run_script):
    server = action_server("ignores_cancel", period=60)
    script = run_script(
        f"{HEAD}{make}\nclient.call_async({{'order': 3}})\nsys.stdin.readline()", fresh=True
    )
    goal = server.wait_for("executing")[0].goal_id
    script.process.stdin.close()
    server.wait_for("cancel_requested", goal_id=goal)
    script.process.send_signal(signal.SIGINT)
    code, out, err = script.finish(timeout=15)
    assert (code, out) == (0, "")
    assert err.count("\n") == 1
    assert "1 goal MAY STILL BE RUNNING" in err


@pytest.mark.long
def test_ctrl_c_ends_the_wait_for_the_middleware(action_server, run_script):
    server = action_server("never_finishes")
    leaving = "import atexit\natexit.register(print, 'leaving', flush=True)"
    script = run_script(f"{HEAD}client = Client(Fibonacci, 'fibonacci')\n{leaving}\n{LONG}")
    assert script.line() == "runs"
    server.pause()
    began = time.monotonic()
    script.process.send_signal(signal.SIGINT)
    assert script.line() == "leaving"
    while script.process.poll() is None:  # one for each of its waits
        script.process.send_signal(signal.SIGINT)
        with suppress(subprocess.TimeoutExpired):
            script.process.wait(0.3)
    code, out, err = script.finish()
    # The node would be kept for 4 s after the cancel that nobody answered.
    assert time.monotonic() - began < 4
    assert (code, out) == (-signal.SIGINT, "")
    assert err.count("actionkit: ") == 1
    assert "MAY STILL BE RUNNING" in err


STOPPED = """
client = Client(
    Fibonacci, 'fibonacci', timeouts=Timeouts(cancel=0.5, liveness=0.5), retry=RetryPolicy.none()
)
started = threading.Event()
future = client.call_async({'order': 10_000_000}, on_feedback=lambda fb: started.set())
assert started.wait(10)
print('started', flush=True)
error = future.exception(10)
assert isinstance(error, ServerLostError)
assert f"{future.goal_id} of this call MAY STILL BE RUNNING" in str(error)
client.close()
"""


@pytest.mark.long
def test_closing_after_a_server_that_was_stopped_does_not_crash(action_server, run_script):
    # In memory that it shares with us, this one has most often just locked something.
    server = action_server("floods")
    head = HEAD + "from actionkit import RetryPolicy, ServerLostError\n"
    script = run_script(head + STOPPED, fresh=True)
    assert script.line() == "started"
    server.pause()
    # Nothing is warned of: the error has told of the goal.
    assert script.finish() == (0, "", "")


@pytest.mark.long
@pytest.mark.parametrize("stopped", [True, False])
def test_the_node_is_kept_while_the_middleware_clears_away(stopped, action_server, make_client):
    server = action_server("never_finishes")
    timeouts = Timeouts(cancel=0.5, liveness=0.5 if stopped else None)
    client = make_client(timeouts=timeouts, retry=RetryPolicy.none())
    future = client.call_async({"order": 1})
    server.wait_for("executing")
    thread = client._session.connection.runtime._thread
    if stopped:
        server.pause()
        with pytest.raises(ServerLostError):
            future.result(10)
    client.close()
    assert thread.is_alive() is stopped
    thread.join(10)
    assert not thread.is_alive()


DOCS = Path(__file__).parents[2] / "docs" / "when-things-fail.md"
LONG = "client.call({'order': 90}, on_feedback=lambda fb: print('runs', flush=True))"


def as_documented() -> str:
    found = re.search(
        r"```python\n(from actionkit import cancel_on_.*?)```", DOCS.read_text("utf-8"), re.S
    )
    assert found is not None
    return found[1]


@pytest.mark.parametrize(
    ("handler", "expected"),
    [
        (as_documented(), -signal.SIGTERM),
        ("import signal, sys\nsignal.signal(signal.SIGTERM, lambda *_: sys.exit(143))", 143),
    ],
    ids=["documented", "exit"],
)
def test_a_handler_of_sigterm_leaves_no_goal_running(handler, expected, action_server, run_script):
    server = action_server("fibonacci", period=0.5)
    source = f"{HEAD}{handler}\nclient = Client(Fibonacci, 'fibonacci')\n{LONG}\n"
    script = run_script(source)
    assert script.line() == "runs"
    script.process.send_signal(signal.SIGTERM)
    code, _, err = script.finish(timeout=15)
    assert (code, err) == (expected, "")
    server.wait_for("canceled")
    assert runs_nothing(server)
