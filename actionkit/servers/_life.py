"""The life of a server process: its end, and how it comes back from it. No rclpy here."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from typing import NoReturn

from actionkit.servers._run import Journal, Run

INSTANCE_VARIABLE = "ACTIONKIT_SERVER_INSTANCE"
"""Names the server among others, over its restarts; set by the program that starts it."""
GOALS_VARIABLE = "_ACTIONKIT_SERVER_GOALS"
"""Tells a new process how many goals those before it were asked for."""
END_SIGNALS = frozenset({signal.SIGINT, signal.SIGTERM})
"""They end the process cleanly. Blocked, and taken by sigwait, as the next one is."""
RESTART_SIGNAL = signal.SIGUSR1
"""It ends the process cleanly and starts it again."""


class Life:
    """The end of this process and its new start, and the count of goals that outlasts both."""

    def __init__(self, stdout: int, journal: Journal) -> None:
        self._stdout = stdout
        self._journal = journal
        self._lock = threading.Lock()
        self._goals = int(os.environ.pop(GOALS_VARIABLE, "0"))

    def next_number(self) -> int:
        """Return the number of the next goal, 0 for the server's first."""
        with self._lock:
            self._goals += 1
            return self._goals - 1

    def crash(self, run: Run, point: str) -> None:
        """Write it into the journal, then die by SIGKILL."""
        run.emit("crashing", point=point)
        os.kill(os.getpid(), signal.SIGKILL)

    def end(self) -> None:
        """Ask for a clean end of the process; it comes a little later."""
        os.kill(os.getpid(), signal.SIGTERM)

    def restart(self, how: str) -> None:
        """Start again, with nothing kept but the count of goals.

        Args:
            how: "clean" ends properly before, returns, and the end comes a little later; "kill"
                is as if the process was killed, and does not return.
        """
        if how == "clean":
            os.kill(os.getpid(), RESTART_SIGNAL)
        else:
            self.start_anew(how)

    def start_anew(self, how: str) -> NoReturn:
        """Replace the running program by a new one, here and now; `how` is for the journal.

        To everybody outside, it is as if the process was killed: its threads and sockets are
        gone between two instructions, and nobody is told. But the process id stays, and so do the
        pipes to the parent and the shell's job, so that no other process has to restart it.
        """
        with self._journal.lock:  # the next event is "ready", of the new program
            self._journal.emit("restarting", how=how)
            for name in os.listdir("/proc/self/fd"):
                if int(name) > 2:
                    with contextlib.suppress(OSError):  # the descriptor of the listing itself
                        os.set_inheritable(int(name), False)
            os.dup2(self._stdout, 1)  # where it was given to us
            os.environ[GOALS_VARIABLE] = str(self._goals)
            os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])
