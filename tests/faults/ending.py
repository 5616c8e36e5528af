"""Programs as users write them, and the ways to end them, as in docs/maintainers/faults.md."""

from __future__ import annotations

from dataclasses import dataclass

from tests.tables import Key

SCRIPT = "A script"
INIT = "A script with `rclpy.init()`"
SPIN = "A node that the main thread spins"
BESIDE = "A node that a thread spins"
MULTI = "A node in a MultiThreadedExecutor"
COROUTINE = "A coroutine in an rclpy executor"
ASYNCIO = "asyncio"
POOL = "A pool of threads"
CHILD = "A child process of `multiprocessing`"
TREE = "A behaviour tree"

SIGINT, SIGTERM, SIGHUP, SIGKILL = "SIGINT", "SIGTERM", "SIGHUP", "SIGKILL"
TWICE = "SIGINT twice"
IGNORED = "SIGINT, ignored before"
SILENT = "SIGINT while the server is silent"
RAISES = "an exception in the main thread"
RETURNS = "the end of the main thread"
SHUTDOWN, DESTROY = "`rclpy.shutdown()`", "`node.destroy_node()`"
CLOSE = "`client.close()` in another thread"

CANCEL = "the cancel"
NOTHING = "nothing: **the goal runs on**"
WARNED = "nothing; a warning says so"

AGES = (0.1, 1.5, 3.0, 12.0)
"""Seconds that a goal has run when its program is ended: before and after its status is read."""

#: What they begin with. The driver gives the action's name, a number for the goal, how the program
#: ends, and whether it calls `cancel_on_signals`.
HEAD = """
import asyncio, os, signal, sys, threading
import rclpy
from actionkit import Client, Timeouts, cancel_on_signals
from test_msgs.action import Fibonacci

NAME, GOAL, END, HANDLED = sys.argv[1], {"order": int(sys.argv[2])}, sys.argv[3], sys.argv[4]
# The middleware may take seconds to see a server that many programs before have left by a signal.
PATIENT = Timeouts(server=60)
told = threading.Event()
client = node = None
if HANDLED:
    cancel_on_signals(*([signal.SIGINT] if "ignored" in END else []))

def listen():
    threading.Thread(target=do_as_told, daemon=True).start()

def do_as_told():
    os.read(0, 1)
    told.set()
    if "shutdown" in END:
        rclpy.shutdown()
    elif "destroy" in END:
        node.destroy_node()
    elif "close" in END:
        client.close()

def main_ends():
    return "main thread" in END

def end_main():
    if "exception" in END:
        raise ValueError("mine")

def run():
    if not main_ends():
        client.call(GOAL)
        return
    client.call_async(GOAL)
    told.wait()
    end_main()
"""
NODE = """
listen()
rclpy.init()
node = rclpy.create_node("users")
client = Client(Fibonacci, NAME, node=node, timeouts=PATIENT)
"""
CALLBACK = (
    NODE
    + """
def on_timer():
    timer.cancel()
    client.call(GOAL)
timer = node.create_timer(0.01, on_timer)
"""
)
PROGRAMS = {
    SCRIPT: """
listen()
client = Client(Fibonacci, NAME, timeouts=PATIENT)
run()
""",
    INIT: """
listen()
rclpy.init()
client = Client(Fibonacci, NAME, timeouts=PATIENT)
run()
""",
    SPIN: CALLBACK + "rclpy.spin(node)",
    BESIDE: NODE
    + """
def spin():
    try:
        rclpy.spin(node)
    except rclpy.executors.ExternalShutdownException:
        pass
threading.Thread(target=spin, daemon=True).start()
run()
""",
    MULTI: CALLBACK
    + """
executor = rclpy.executors.MultiThreadedExecutor(2)
executor.add_node(node)
executor.spin()
""",
    COROUTINE: NODE
    + """
async def on_timer():
    timer.cancel()
    await client.call_async(GOAL)
timer = node.create_timer(0.01, on_timer)
if main_ends():
    while not told.is_set():
        rclpy.spin_once(node, timeout_sec=0.1)
    end_main()
else:
    rclpy.spin(node)
""",
    ASYNCIO: """
listen()
async def main():
    global client
    async with Client(Fibonacci, NAME, timeouts=PATIENT) as client:
        future = client.call_async(GOAL)
        if main_ends():
            await asyncio.to_thread(told.wait)
            end_main()
        else:
            await future
asyncio.run(main())
""",
    POOL: """
from concurrent.futures import ThreadPoolExecutor
listen()
with Client(Fibonacci, NAME, timeouts=PATIENT) as client, ThreadPoolExecutor(2) as pool:
    pool.submit(client.call, GOAL).result()
""",
    CHILD: """
import multiprocessing
def work():
    global client
    listen()
    with Client(Fibonacci, NAME, timeouts=PATIENT) as client:
        run()
if __name__ == "__main__":
    child = multiprocessing.get_context("spawn").Process(target=work)
    child.start()
    child.join()
    sys.exit(child.exitcode)
""",
    TREE: """
import py_trees
from actionkit.trees import ActionBehaviour
listen()
client = Client(Fibonacci, NAME, timeouts=PATIENT)
tree = py_trees.trees.BehaviourTree(ActionBehaviour("count", client, GOAL, server_timeout=60))
tree.setup(timeout=60)
try:
    while not told.wait(0.05):
        tree.tick()
    end_main()
finally:
    tree.shutdown()
""",
}
_WITH_ROS = (INIT, SPIN, BESIDE, MULTI, COROUTINE)


@dataclass(frozen=True)
class Case:
    """A program, what ends it, and whether it has called `cancel_on_signals`."""

    program: str
    what: str
    handled: bool = False

    @property
    def goes_on(self) -> bool:
        """Whether the program does not end: nothing tells an executor, or a pool of threads."""
        return (self.program, self.what) in ((POOL, SIGINT), (MULTI, DESTROY), (MULTI, CLOSE))

    @property
    def key(self) -> tuple[str, str]:
        """Of its row."""
        return "yes" if self.handled else "no", self.what

    @property
    def name(self) -> str:
        """For the test."""
        return f"{self.program}, {self.what}{', handled' if self.handled else ''}".replace("`", "")


@dataclass(frozen=True)
class Row:
    """What came of it."""

    case: Case
    reached: str
    code: int | None

    @property
    def cells(self) -> tuple[str, str]:
        """How it is written."""
        code = "it goes on" if self.code is None else str(self.code)
        if self.code is not None and self.code < 0:
            code = f"{128 - self.code} ({self.code})"
        return self.reached, code


def _cases(program: str) -> list[Case]:
    """What ends a program, in the order of the page."""
    has_ros, has_node = program in _WITH_ROS, program in _WITH_ROS[1:]
    main_is_free = program not in (SPIN, MULTI, POOL)
    bare = [SIGINT, TWICE, SIGTERM, SIGHUP] + [SILENT] * (program != POOL)
    bare += [IGNORED] * has_ros + [SIGKILL] * (program == SCRIPT)
    bare += [RAISES, RETURNS] * main_is_free
    bare += [SHUTDOWN] * has_ros + [DESTROY] * has_node + [CLOSE] * (program != TREE)
    handled = [Case(program, what, handled=True) for what in (SIGTERM, SIGHUP, SIGINT, IGNORED)]
    return handled + [Case(program, what) for what in bare]


CASES = [case for program in PROGRAMS for case in _cases(program)]
BY_DEFAULT = {
    Case(SCRIPT, SILENT): 1.5,
    Case(SCRIPT, RETURNS): 0.1,
    Case(INIT, SIGINT): 3.0,
    Case(SPIN, SHUTDOWN): 1.5,
    Case(BESIDE, SIGTERM): 3.0,
    Case(MULTI, DESTROY): 0.1,
    Case(COROUTINE, RAISES): 1.5,
    Case(ASYNCIO, SIGHUP, handled=True): 1.5,
    Case(ASYNCIO, CLOSE): 0.1,
    Case(POOL, SIGTERM, handled=True): 1.5,
    Case(CHILD, SIGINT): 1.5,
    Case(TREE, TWICE): 1.5,
}
"""Each program and each kind of end once, at one age; the rest takes long."""

TABLES: dict[str, list[Key]] = {
    program: [case.key for case in CASES if case.program == program] for program in PROGRAMS
}
"""The keys of the rows of each program."""
