"""Repairs shared memory after a process was killed, so that no other process hangs.

Fast DDS makes a file for each of its ports, empty at first. If a process is killed just then, the
file stays empty, and every process of the machine that opens that port waits for it without end,
inside rclpy's `Node()`. Tests kill hundreds of processes, so it happens in one of some ten whole
runs.
"""

from __future__ import annotations

import contextlib
import struct
import threading
import time
from pathlib import Path

_PORTS = "fastrtps_port*[0-9]"
_EMPTY_FOR = 2.0
"""Seconds; a process that lives fills the file within a millisecond."""
_SIZE = 4096
_CORRUPTED = struct.pack("<I", 3)
"""How a file of boost's says that it cannot be used; who waits for it makes another one then."""


def mend(folder: Path) -> list[str]:
    """Mark the files that were left empty; return their names."""
    mended = []
    for path in folder.glob(_PORTS):
        with contextlib.suppress(OSError):  # it is gone by now
            found = path.stat()
            if found.st_size == 0 and time.time() - found.st_mtime > _EMPTY_FOR:
                path.write_bytes(_CORRUPTED.ljust(_SIZE, b"\0"))
                mended.append(path.name)
    return mended


def keep_mending(folder: Path = Path("/dev/shm")) -> None:
    """Look once a second, as long as this process lives."""

    def look() -> None:
        while not never.wait(1.0):
            for name in mend(folder):
                print(f"\n{folder / name} was left empty by a killed process: mended", flush=True)

    never = threading.Event()
    threading.Thread(target=look, name="shared memory", daemon=True).start()
