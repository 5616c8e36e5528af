"""The life of a server process: its end, and how it comes back from it. No rclpy here."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Mapping
from typing import NoReturn

#: Tells a new process how many goals those before it were asked for.
GOALS_VARIABLE = "_ACTIONKIT_SERVER_GOALS"

#: A clean end; and one to come back from. They are blocked, and taken by sigwait.
END_SIGNALS = frozenset({signal.SIGINT, signal.SIGTERM})
RESTART_SIGNAL = signal.SIGUSR1


class Life:
    """This process's part in the life of a server, which may take several."""

    def __init__(self, stdout: int) -> None:
        self._stdout = stdout
        self._lock = threading.Lock()
        self._goals = int(os.environ.pop(GOALS_VARIABLE, "0"))

    def next_number(self) -> int:
        """The number of the next goal, 0 for the server's first."""
        with self._lock:
            self._goals += 1
            return self._goals - 1

    def end(self) -> None:
        """Ask for a clean end; it comes a little later."""
        os.kill(os.getpid(), signal.SIGTERM)

    def end_and_restart(self) -> None:
        """Ask for a clean end, and a new start after it."""
        os.kill(os.getpid(), RESTART_SIGNAL)

    def start_anew(self) -> NoReturn:
        """Replace the running program by a new one, here and now.

        To everybody outside, it is as if the process was killed: its threads and sockets are
        gone between two instructions, with no word of goodbye. But the process id stays, and so
        do the pipes to the parent and the shell's job, so that nobody has to watch over it.
        """
        for name in os.listdir("/proc/self/fd"):
            if int(name) > 2:
                with contextlib.suppress(OSError):  # the descriptor of the listing itself
                    os.set_inheritable(int(name), False)
        os.dup2(self._stdout, 1)  # where it was given to us
        os.environ[GOALS_VARIABLE] = str(self._goals)
        os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])


def with_goals(environment: Mapping[str, str], goals: int) -> dict[str, str]:
    """The environment for a process that takes over after so many goals."""
    return {**environment, GOALS_VARIABLE: str(goals)}
