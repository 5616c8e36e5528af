"""The table of docs/interrupting-a-tree.md: its rows, and how they are written and read."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

PATH = Path(__file__).parents[2] / "docs" / "interrupting-a-tree.md"

NOBODY = "no server is there"
UNANSWERED = "sent, not answered"
RUNNING = "executing"
REFUSING = "executing, the server refuses to cancel"
ENDED = "ended, not ticked since"
PHASES = (NOBODY, UNANSWERED, RUNNING, REFUSING, ENDED)

SELECTOR = "A selector turns to a child of higher priority"
TIMEOUT = "The time of a `Timeout` decorator is up"
GUARD = "The condition of an `EternalGuard` fails"
ONE = "Another child ends a `Parallel` with `SuccessOnOne`"
STOP = "`root.stop(Status.INVALID)`"
SHUTDOWN = "`tree.shutdown()`"
DROPPED = "The tree is dropped without `shutdown()`"
CTRL_C = "Ctrl-C in a program that ticks"
SIGTERM = "SIGTERM in a program that ticks, with `cancel_on_signals()`"
EVENTS = (SELECTOR, TIMEOUT, GUARD, ONE, STOP, SHUTDOWN, DROPPED)
PROGRAMS = (CTRL_C, SIGTERM)

_INTRO = f"""
# Interrupting a tree

What reaches the server when a tree gives up on a goal that an `ActionBehaviour` has sent, for each
way to give up and each phase of the goal. The tests in `tests/trees/` write this page: they do
what it tells of with real servers, and fail where it is no longer so
(`ACTIONKIT_WRITE_INTERRUPTING=1 pytest -n 0 tests/trees/test_interrupting.py` writes it anew).

- **phase**: how far the goal was. Where the server refuses to cancel, no client can stop the goal.
  "{ENDED}": the server has ended it, and the tree has not looked since.
- **reached the server**: in this order. A cancel that comes before the server knows the goal is
  sent again when the server has accepted it.
- **the goal ended**: as the server tells; `succeeded` is its own end, which nobody hurried.
- **a new run**: when the leaf, ticked again, sends its next goal. Until then it is RUNNING, and
  `feedback_message` says what it waits for. "-": there is no leaf any more.
"""
_OUTRO = """
A process that is killed (SIGKILL), or ended by SIGTERM without `cancel_on_signals()` and without
`rclpy.init()`, cancels nothing: [what ends a program](ending.md). An exception that a behaviour
raises in a tick leaves the tree as it stands, with its goals: catch it, and call `tree.shutdown()`.
"""
_HEAD = ("phase", "reached the server", "the goal ended", "a new run")


@dataclass(frozen=True)
class Row:
    """What came of one event in one phase."""

    event: str
    phase: str
    reached: str
    ended: str
    new_run: str

    @property
    def line(self) -> str:
        """The row as it is written."""
        return f"| {self.phase} | {self.reached} | {self.ended} | {self.new_run} |"


def read(text: str) -> dict[tuple[str, str], str]:
    """Return the lines of a page by event and phase."""
    found: dict[tuple[str, str], str] = {}
    event = ""
    for line in text.splitlines():
        if line.startswith("## "):
            event = line.removeprefix("## ")
        elif line.startswith("| ") and not line.startswith(f"| {_HEAD[0]} |"):
            found[event, line[2:].split(" | ")[0]] = line
    return found


def render(rows: Iterable[Row], known: str) -> str:
    """Return the page, with the lines of `known` where there is no row."""
    lines = read(known) | {(row.event, row.phase): row.line for row in rows}
    parts = [_INTRO.strip()]
    for event in EVENTS + PROGRAMS:
        table = [lines[event, phase] for phase in PHASES if (event, phase) in lines]
        head = ["| " + " | ".join(_HEAD) + " |", "|---" * len(_HEAD) + "|"]
        parts.append(f"## {event}\n\n" + "\n".join(head + table))
    return "\n\n".join([*parts, _OUTRO.strip()]) + "\n"
