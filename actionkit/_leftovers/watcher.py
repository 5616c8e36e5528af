"""A process that waits for the end of another one, and cancels the goals that it has left running.

It has a session of its own, so what ends the other process and its whole group does not end it.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from actionkit._leftovers.ledger import Ledger
from actionkit._model.environment.own_module import command_for

_SECONDS = 60.0
"""How long it goes on cancelling."""
_LOOK = 0.01
"""Seconds between two looks whether the other process has gone, once it is ending."""


def watch_over(path: Path) -> subprocess.Popen[bytes]:
    """Start a process that cancels what this process leaves in the ledger at `path`.

    Raises:
        OSError: It cannot be started.
    """
    return subprocess.Popen(
        command_for("actionkit._leftovers.watcher", str(path), str(os.getpid())),
        stdin=subprocess.PIPE,  # its end tells that this process has ended
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def main() -> None:
    """Watch the parent, which is the process of that number."""
    path, watched = sys.argv[1], int(sys.argv[2])
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    ledger = Ledger(path)
    os.read(0, 1)
    while os.getppid() == watched:
        time.sleep(_LOOK)
    ledger._cancel(_SECONDS, server=_SECONDS)  # a server may be out of sight for a while


if __name__ == "__main__":
    main()
