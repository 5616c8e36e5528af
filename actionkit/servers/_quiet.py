"""Waits until a process does nothing for a moment, before it is killed or paused.

Fast DDS shares memory, with locks in it, with all processes on the machine. If a process is killed
while it holds such a lock, it blocks each process that talks to it for up to 3 s, and may crash it.
A test that kills a server for another reason should not sometimes get this fault, too.
"""

from __future__ import annotations

import time
from pathlib import Path

_MOMENT = 0.005
"""Seconds; Fast DDS holds such a lock for microseconds."""
_PATIENCE = 0.5
"""Seconds; an idle server is quiet at once, but a server that floods is never quiet."""


def await_quiet(pid: int) -> None:
    """Return when no thread of the process has run for 5 ms, or after half a second.

    It returns at once if there is no `/proc`, or no such process.
    """
    until = time.monotonic() + _PATIENCE
    before = _threads(pid)
    while before and time.monotonic() < until:
        time.sleep(_MOMENT)
        now = _threads(pid)
        if now == before and not any(state == "R" for state, _ in now):
            return
        before = now


def _threads(pid: int) -> list[tuple[str, str]]:
    """Return the state of each thread, and how many times it has gone to sleep."""
    found = []
    for path in sorted(Path(f"/proc/{pid}/task").glob("*/status")):
        try:
            status = dict(line.split(":\t", 1) for line in path.read_text().splitlines())
        except (OSError, ValueError):
            continue  # it has just ended
        found.append((status["State"][:1], status["voluntary_ctxt_switches"]))
    return found
