"""Starts programs with many goals, and compares their reports with the server's journal."""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from actionkit.servers import Server
from actionkit.servers._events import TERMINAL
from tests import forked
from tests.conftest import NEVER, Script

_ROOT = Path(__file__).parents[2]
_numbers = itertools.count()

#: How each way of giving up is to end the program; 0 where nothing else is said.
CODES = {"ctrl_c": -2, "term_exit": 3}


@dataclass(frozen=True)
class End:
    """What a call came to, as its program saw it."""

    goal: str
    done: bool
    timeout: float | None
    error: str = ""
    cancel: str = ""
    elapsed: float = 0.0


class Crowd:
    """A program with many goals in flight."""

    def __init__(self, way: str, n: int, directory: Path, **settings: Any) -> None:
        """Start it; returns once its client sees the server.

        Args:
            way: How it gives up, a key of `attacks.WAYS`.
            n: How many goals it sends.
            directory: Where it may write.
            settings: `action`, its name; `lead`, seconds until its deadlines; `cancel`, the
                timeout; `log`, where warnings are to be logged.
        """
        self.way = way
        self.n = n
        self._report = directory / f"{way}-{n}-{next(_numbers)}.json"
        command = ["-m", "tests.faults.crowd_client", way, str(n), str(self._report)]
        process = forked.Popen(
            [sys.executable, *command, json.dumps(settings)],
            cwd=_ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={
                **os.environ,
                "PYTHONUNBUFFERED": "1",
                "PYTHONPATH": str(_ROOT),
                "PYTHONFAULTHANDLER": "1",
            },
        )
        self.process = process
        self._script = Script(process)
        assert self._script.line() == "up"

    def tell(self) -> None:
        """Let it go on: to send its goals, or to give up."""
        assert self.process.stdin is not None
        self.process.stdin.write("\n")
        self.process.stdin.flush()

    def fill(self, server: Server) -> None:
        """Let it send its goals; returns when all of them execute.

        Raises:
            AssertionError: They do not; says what the program was doing.
        """
        before = server.count("executing")
        self.tell()
        try:
            server.wait_for("executing", count=before + self.n, timeout=120)
        except AssertionError as error:
            raise AssertionError(f"{error}\n\n{self._last_state()}") from None

    def _last_state(self) -> str:
        """End the program; returns how far its goals were, and where each of its threads was."""
        ended = self.process.poll()
        self.process.send_signal(signal.SIGUSR1)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(2)  # it may be stuck, and not answer
        self.process.send_signal(signal.SIGABRT)  # for `faulthandler`, which needs no GIL
        said = self._script.finish(10)[2]
        return f"the program (exit code before: {ended}) said:\n{said}"

    def give_up(self) -> float:
        """Let it give up on its goals; returns when, on the monotonic clock."""
        began = time.monotonic()
        if self.way == "ctrl_c":
            self.process.send_signal(signal.SIGINT)
        elif self.way.startswith("term"):
            self.process.send_signal(signal.SIGTERM)
        elif self.way != "deadline":
            self.tell()
        return began

    def line(self) -> str:
        return self._script.line()

    def finish(self, timeout: float) -> tuple[int, str]:
        """Wait for its end; returns the exit code and what it wrote on standard error."""
        code, _, err = self._script.finish(timeout)
        return code, err

    @property
    def reported_at(self) -> float:
        return float(json.loads(self._report.read_text())["at"])

    @property
    def ends(self) -> list[End]:
        """What its calls came to."""
        return [End(**end) for end in json.loads(self._report.read_text())["ends"]]

    def kill(self) -> None:
        """End it in any state."""
        self._script.end()


def drain(server: Server, seconds: float = 10.0, quiet: float = 4.0) -> set[str]:
    """Wait until no goal runs on the server; returns those that do.

    Args:
        server: The server.
        seconds: The longest wait.
        quiet: Where nothing ends for so long, nothing more will.
    """
    until = time.monotonic() + seconds
    left, changed = server.running(), time.monotonic()
    while left and time.monotonic() < min(until, changed + quiet):
        NEVER.wait(0.05)
        now = server.running()
        if now != left:
            left, changed = now, time.monotonic()
    return left


def endings(server: Server) -> dict[str, tuple[str, float]]:
    """How and when each goal ended, by the journal."""
    return {
        str(event.goal_id): (event.event, event.monotonic)
        for event in server.events
        if event.event in TERMINAL
    }


def wrong(crowd: Crowd, ended: dict[str, tuple[str, float]]) -> list[End]:
    """The calls whose outcome is not what the journal shows, or what was to be known."""
    may_be_unknown = crowd.way == "deadline"
    error = "DeadlineExceededError" if may_be_unknown else "CancelledError"
    found = []
    for end in crowd.ends:
        if end.cancel == "CONFIRMED":
            # A client that is closed ends its calls with an error that says so.
            right = end.goal in ended and end.error in (error, "ClientClosedError")
        else:
            right = may_be_unknown and end.cancel == "UNKNOWN" and end.error == error
        if not (end.done and right):
            found.append(end)
    return found


def untrue(crowd: Crowd, ended: dict[str, tuple[str, float]]) -> list[End]:
    """The calls that did not end, or whose outcome says something that the journal does not."""
    return [
        end
        for end in crowd.ends
        if not end.done or not end.error or (end.cancel == "CONFIRMED" and end.goal not in ended)
    ]


def untold(left: set[str], err: str) -> int:
    """How many of the goals that were left running a program did not tell of.

    It may name each of them, or some, and tell how many there are.
    """
    named = sum(goal in err for goal in left)
    number = max((int(n) for n in re.findall(r"(\d+) goals?\b", err)), default=0)
    return max(0, len(left) - max(named, number)) if named else len(left)
