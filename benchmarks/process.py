"""What Linux says of a process and its threads."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Thread:
    """One thread.

    Attributes:
        name: As the system has it, 15 characters at most.
        wakeups: How often it has gone to sleep of its own will, hence been woken, so far.
    """

    name: str
    wakeups: int


def threads(pid: int) -> dict[int, Thread]:
    """Return the threads of a process by their ids."""
    found = {}
    for task in Path(f"/proc/{pid}/task").iterdir():
        try:
            text = (task / "status").read_text()
        except OSError:
            continue  # it has just ended
        name = re.search(r"^Name:\t(.*)$", text, re.MULTILINE)
        wakeups = re.search(r"^voluntary_ctxt_switches:\t(\d+)$", text, re.MULTILINE)
        if name and wakeups:
            found[int(task.name)] = Thread(name[1], int(wakeups[1]))
    return found


def resident(pid: int) -> int:
    """Return the bytes of memory that are the process's own: resident, not shared."""
    text = Path(f"/proc/{pid}/smaps_rollup").read_text()
    return 1024 * sum(int(kb) for kb in re.findall(r"^Private_\w+:\s+(\d+) kB$", text, re.M))


def forget_peak(pid: int) -> int:
    """Begin anew to look for the most memory that a process has; return the bytes it has now."""
    Path(f"/proc/{pid}/clear_refs").write_text("5")
    return peak(pid)


def peak(pid: int) -> int:
    """Return the most bytes of memory that a process has had since `forget_peak`."""
    found = re.search(r"^VmHWM:\s+(\d+) kB$", Path(f"/proc/{pid}/status").read_text(), re.M)
    assert found is not None
    return 1024 * int(found[1])


def cpu(pid: int) -> float:
    """Return the seconds of CPU that the threads of a process have used that still run."""
    return sum(thread_cpu(pid).values())


def thread_cpu(pid: int) -> dict[int, float]:
    """Return the seconds that each thread has run, to the nanosecond."""
    found = {}
    for task in Path(f"/proc/{pid}/task").iterdir():
        try:
            found[int(task.name)] = int((task / "schedstat").read_text().split()[0]) / 1e9
        except (OSError, ValueError):
            continue
    return found
