"""Programs that are told to end, and what ends them, as in docs/faults.md."""

from __future__ import annotations

import signal
from dataclasses import dataclass

from tests.tables import Key

SCRIPT = "A script, in `call`"
ASYNCIO = "asyncio, in `await`"
SINGLE = "A node, SingleThreadedExecutor; `call` in a callback"
MULTI = "A node, MultiThreadedExecutor; `call` in a callback"
SPIN = "A node, `rclpy.spin`; `call` in a callback"
BESIDE = "A node that a thread spins; `call` in the main thread"

TERM, HUP, INT = signal.SIGTERM, signal.SIGHUP, signal.SIGINT
SHUTDOWN, DESTROY, KILL = "`rclpy.shutdown()`", "`node.destroy_node()`", "SIGKILL"
IGNORED = "SIGINT, ignored before"

CANCEL, NOTHING = "the cancel", "nothing: **the goal runs on**"

#: How each program goes about it; `Q` holds the signals for `cancel_on_signals`, if any.
HEAD = """
import asyncio, signal, sys, threading
import rclpy
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from actionkit import Client, Timeouts, cancel_on_signals
from test_msgs.action import Fibonacci

def say(feedback):
    print("running", flush=True)

def do_as_told():
    for line in sys.stdin:
        rclpy.shutdown() if line == "shutdown\\n" else node.destroy_node()

# The middleware may take seconds to see a server that many programs before have left by a signal.
PATIENT = Timeouts(server=60)
if Q is not None:
    cancel_on_signals(*Q)
"""
NODE = """
rclpy.init()
node = rclpy.create_node("users")
threading.Thread(target=do_as_told, daemon=True).start()
client = Client(Fibonacci, "fibonacci", node=node, timeouts=PATIENT)
"""
CALLBACK = (
    NODE
    + """
def on_timer():
    timer.cancel()
    client.call({"order": 1}, on_feedback=say)
timer = node.create_timer(0.01, on_timer)
"""
)
PROGRAMS = {
    SCRIPT: """
with Client(Fibonacci, "fibonacci", timeouts=PATIENT) as client:
    client.call({"order": 1}, on_feedback=say)
""",
    ASYNCIO: """
async def main():
    async with Client(Fibonacci, "fibonacci", timeouts=PATIENT) as client:
        await client.call_async({"order": 1}, say)
asyncio.run(main())
""",
    SINGLE: CALLBACK
    + "executor = SingleThreadedExecutor()\nexecutor.add_node(node)\nexecutor.spin()",
    MULTI: CALLBACK
    + "executor = MultiThreadedExecutor(2)\nexecutor.add_node(node)\nexecutor.spin()",
    SPIN: CALLBACK + "rclpy.spin(node)",
    BESIDE: NODE
    + """
def spin():
    try:
        rclpy.spin(node)
    except rclpy.executors.ExternalShutdownException:
        pass
threading.Thread(target=spin, daemon=True).start()
client.call({"order": 1}, on_feedback=say)
""",
}


@dataclass(frozen=True)
class Case:
    """A program, what ends it, and whether it has called `cancel_on_signals`."""

    program: str
    what: str
    handled: bool

    @property
    def number(self) -> signal.Signals | None:
        """The signal that is sent; `None` where the program is told to do it."""
        return signal.Signals[self.what.split(",")[0]] if self.what.startswith("SIG") else None

    @property
    def goes_on(self) -> bool:
        """Whether the program does not end: nothing tells a MultiThreadedExecutor."""
        return (self.program, self.what) == (MULTI, DESTROY)

    @property
    def key(self) -> tuple[str, str]:
        """Of its row."""
        return self.what, "yes" if self.handled else "no"

    @property
    def source(self) -> str:
        numbers = "None"
        if self.handled:
            numbers = f"[{int(INT)}]" if self.what == IGNORED else "[]"
        return f"Q = {numbers}\n{HEAD}{PROGRAMS[self.program]}"


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


def cases(program: str) -> list[Case]:
    """What is done to a program, in the order of the page."""
    has_node = program not in (SCRIPT, ASYNCIO)
    found = [Case(program, what, handled=True) for what in ("SIGTERM", "SIGHUP", "SIGINT", IGNORED)]
    if has_node:
        bare = ("SIGTERM", "SIGINT", IGNORED, SHUTDOWN, DESTROY)
    else:
        bare = ("SIGINT", "SIGTERM", KILL)
    return found + [Case(program, what, handled=False) for what in bare]


TABLES: dict[str, list[Key]] = {
    program: [case.key for case in cases(program)] for program in PROGRAMS
}
"""The keys of the rows of each program."""
