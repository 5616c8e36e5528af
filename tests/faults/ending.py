"""The table of docs/ending.md: programs, what ends them, how the rows are written and read."""

from __future__ import annotations

import signal
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

PATH = Path(__file__).parents[2] / "docs" / "ending.md"

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
    def cells(self) -> str:
        """The first cells of its row."""
        return f"| {self.what} | {'yes' if self.handled else 'no'} |"

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
    def line(self) -> str:
        code = "it goes on" if self.code is None else str(self.code)
        if self.code is not None and self.code < 0:
            code = f"{128 - self.code} ({self.code})"
        return f"{self.case.cells} {self.reached} | {code} |"


def cases(program: str) -> list[Case]:
    """What is done to a program, in the order of the page."""
    has_node = program not in (SCRIPT, ASYNCIO)
    found = [Case(program, what, handled=True) for what in ("SIGTERM", "SIGHUP", "SIGINT", IGNORED)]
    if has_node:
        bare = ("SIGTERM", "SIGINT", IGNORED, SHUTDOWN, DESTROY)
    else:
        bare = ("SIGINT", "SIGTERM", KILL)
    return found + [Case(program, what, handled=False) for what in bare]


EXPLAINED = {
    SCRIPT: "No `rclpy.init()`, no node.",
    ASYNCIO: "`asyncio.run(main())`, no `rclpy.init()`, no node.",
    SINGLE: "`rclpy.init()`; the client is made with `node=`.",
    MULTI: "The same; other callbacks run meanwhile.",
    SPIN: "The same.",
    BESIDE: "The same; the call waits in the main thread.",
}
INTRO = """
# How a program ends, and what reaches the server

This page is written by `tests/faults/test_ending.py`, which does what it tells of with real
programs, signals and servers, and fails where it is no longer so
(`ACTIONKIT_WRITE_ENDING=1 pytest -n 0 tests/faults/test_ending.py` writes it anew). What to do
about it is told in [Losing the server](losing-the-server.md#when-your-own-process-ends).

Each program has one goal running, and is told to end. The server's own journal says what reached
it.

- **handled**: whether the program has called `cancel_on_signals()` at its start, before
  `rclpy.init()`; with SIGINT as its argument where that was ignored before, as it is in a program
  that a shell script starts in the background.
- **reached the server**: "the cancel" means also that the goal ended, before the program did.
- **exit code**: as a shell shows it, and in brackets that of Python's `subprocess`. 1 is the error
  of the call, `ClientClosedError` or `CancelledError`, that nothing in these programs catches.
  Where a signal comes between two steps of an executor, rclpy itself fails ("failed to initialize
  wait set: the given context is not valid"), and the program ends with 1: one in hundreds, which
  was tried again here.

Each of them is gone within `Timeouts.cancel` and a second, and most at once.
"""
_HEAD = "| what ends it | handled | reached the server | exit code |\n|---|---|---|---|"


def render(rows: Iterable[Row], text: str) -> str:
    """The page with new rows in place of its old ones; what was not tried anew stays."""
    found = {row.case: row.line for row in rows}
    parts = [INTRO.strip()]
    for program, explanation in EXPLAINED.items():
        lines = []
        for case in cases(program):
            old = (x for x in section(program, text).splitlines() if x.startswith(case.cells))
            lines.append(found.get(case) or next(old, ""))
        lines = [line for line in lines if line]
        parts.append(f"## {program}\n\n{explanation}\n\n" + "\n".join([_HEAD, *lines]))
    return "\n\n".join(parts) + "\n"


def is_written(row: Row, text: str) -> bool:
    """Whether the page has this row."""
    return row.line in section(row.case.program, text).splitlines()


def section(program: str, text: str) -> str:
    """What the page says of a program."""
    return text.partition(f"## {program}\n")[2].partition("\n## ")[0]
