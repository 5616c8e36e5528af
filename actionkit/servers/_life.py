"""Ends and restarts a server process. No rclpy here."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from typing import NoReturn

from actionkit.servers._run import Journal, Run

INSTANCE_VARIABLE = "ACTIONKIT_SERVER_INSTANCE"
"""The server's number, which stays over restarts; set by the program that starts it."""
GOALS_VARIABLE = "_ACTIONKIT_SERVER_GOALS"
"""Gives a new process the number of goals that earlier processes were asked for."""
END_SIGNALS = frozenset({signal.SIGINT, signal.SIGTERM})
"""They end the process cleanly. These and the next one are blocked; sigwait takes them."""
RESTART_SIGNAL = signal.SIGUSR1
"""Ends the process cleanly and starts it again."""


class Life:
    """The end and new start of this process, and the count of goals, which continues."""

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
        """Write a journal event, then die by SIGKILL."""
        run.emit("crashing", point=point)
        os.kill(os.getpid(), signal.SIGKILL)

    def end(self) -> None:
        """Request a clean end of the process; it comes a little later."""
        os.kill(os.getpid(), signal.SIGTERM)

    def restart(self, how: str) -> None:
        """Start again, and keep only the count of goals.

        With `how="clean"`, this returns, and the process first ends properly, a little later. With
        "kill", it is as if the process was killed, and this does not return.
        """
        if how == "clean":
            os.kill(os.getpid(), RESTART_SIGNAL)
        else:
            self.start_anew(how)

    def start_anew(self, how: str) -> NoReturn:
        """Replace the running program by a new one, at once; `how` is for the journal.

        For all other processes, this looks like a kill: threads and sockets disappear at once,
        without a message. But the process id, the pipes to the parent and the shell's job stay, so
        no other process has to restart it.
        """
        with self._journal.lock:  # the next event is "ready", of the new program
            self._journal.emit("restarting", how=how)
            for name in os.listdir("/proc/self/fd"):
                if int(name) > 2:
                    with contextlib.suppress(OSError):  # the descriptor of the listing itself
                        os.set_inheritable(int(name), False)
            os.dup2(self._stdout, 1)  # the place where we got it
            os.environ[GOALS_VARIABLE] = str(self._goals)
            os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])
