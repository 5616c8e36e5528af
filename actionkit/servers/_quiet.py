"""Waiting for a moment in which a process does nothing, before it is stopped for good.

Fast DDS shares memory, and locks in it, with every process on the machine. One that is killed while
it holds such a lock blocks each process that talks to it for seconds, and may crash that process;
see `docs/losing-the-server.md`. A test that kills a server for another reason should not meet this
fault from time to time.
"""

from __future__ import annotations

import time
from pathlib import Path

_MOMENT = 0.005
"""Seconds; what Fast DDS does under such a lock takes microseconds."""
_PATIENCE = 0.5
"""Seconds; an idle server is quiet at once, and one that floods never is."""


def await_quiet(pid: int) -> None:
    """Return when no thread of the process has run for 5 ms, but after half a second in any case.

    It returns at once where there is no `/proc`, or no such process.
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
    """Return the state of each thread, and how often it has gone to sleep."""
    found = []
    for path in sorted(Path(f"/proc/{pid}/task").glob("*/status")):
        try:
            status = dict(line.split(":\t", 1) for line in path.read_text().splitlines())
        except (OSError, ValueError):
            continue  # it has just ended
        found.append((status["State"][:1], status["voluntary_ctxt_switches"]))
    return found
