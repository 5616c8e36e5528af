"""What is told of an action server of the field, and the server while it runs."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

from tests import forked

Goal = dict[str, Any]
PATIENCE = 20.0
_LINES, _WIDTH = 60, 200
"""How much of a log a failure shows."""


@dataclass(frozen=True)
class Kind:
    """An action server of the field.

    Attributes:
        name: The server's row in the table.
        program: Returns what follows `python -u` on the command line; builds what is missing. The
            program ends at the end of its standard input, as it does when the tests have died.
        goals: What the server does with which goal. `short` ends well after some tenths of a
            second, with feedback. `long` runs for 10 s or more, and heeds a cancel. `aborts` ends
            as aborted, `rejected` is rejected. Of `ignores`, a cancel is accepted, and it runs on
            for 1 to 3 s. What the server cannot do is left out. Without `long`, it has only tests
            that say what they need.
        log: Regular expressions of lines in the server's own log: `executing`, `cancel_requested`,
            `succeeded`, `canceled`, `aborted`, `rejected`. What it does not say is left out. A
            group `result` has the numbers of the result.
        results: What `sequence` of the result of a goal is, by the server's source.
        second: What it does with a second goal while one runs: `queues it`, `preempts`, `runs
            both`, `crashes`, or `answers later`.
        has_status: Whether it publishes the states of its goals.
        action_type: The action's type.
        action_name: The action's name.
        prepare: Makes the type known to the process of the tests.
        own: What can happen on this server alone, each a row of a table of its own.
    """

    name: str
    program: Callable[[], Sequence[str]]
    goals: Mapping[str, Goal]
    log: Mapping[str, str]
    second: str
    results: Mapping[str, Sequence[int]] = field(default_factory=dict)
    has_status: bool = True
    action_type: str = "test_msgs/action/Fibonacci"
    action_name: str = "fibonacci"
    prepare: Callable[[], None] = field(default=lambda: None)
    own: tuple[str, ...] = ()

    @property
    def type(self) -> Any:
        """Return the action's class."""
        self.prepare()
        package, _, name = self.action_type.split("/")
        return getattr(import_module(f"{package}.action"), name)


class Server:
    """A server of the field in a process of its own, and its log."""

    def __init__(self, kind: Kind) -> None:
        self.kind = kind
        self.lines: list[str] = []
        self._changed = threading.Condition()
        self._program = kind.program()
        self.start()

    def start(self) -> None:
        """Start it, for the second time after `kill`."""
        self._process = forked.Popen(
            [sys.executable, "-u", *self._program],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,  # with processes of its own, as a bridge and its web page
            env=os.environ | {"RCUTILS_COLORIZED_OUTPUT": "0", "RCUTILS_LOGGING_USE_STDOUT": "1"},
        )
        self._reader = threading.Thread(target=self._read, args=(self._process,), daemon=True)
        self._reader.start()

    def tell(self, command: str) -> None:
        """Write a line to its standard input, which it obeys."""
        assert self._process.stdin is not None
        self._process.stdin.write(command + "\n")
        self._process.stdin.flush()

    def count(self, event: str) -> int:
        """Return how many lines of its log say this."""
        return len(self.found(event))

    def found(self, event: str) -> list[re.Match[str]]:
        """Return where its log says this."""
        pattern = self.kind.log[event]
        with self._changed:
            return [found for line in self.lines if (found := re.search(pattern, line))]

    def wait_for(self, event: str, count: int = 1, timeout: float = PATIENCE) -> re.Match[str]:
        """Wait until so many lines of its log say this; return where the last of these does."""
        return self._wait(lambda: self.found(event), count, f"{event!r}", timeout)

    def wait_for_text(self, pattern: str, count: int = 1, timeout: float = PATIENCE) -> None:
        """Wait until so many lines of its log match."""

        def found() -> list[re.Match[str]]:
            with self._changed:
                return [match for line in self.lines if (match := re.search(pattern, line))]

        self._wait(found, count, pattern, timeout)

    def _wait(
        self, found: Callable[[], list[re.Match[str]]], count: int, what: str, timeout: float
    ) -> re.Match[str]:
        until = time.monotonic() + timeout
        while len(matches := found()) < count:
            with self._changed:
                left = until - time.monotonic()
                assert left > 0, f"no {what} ({count}) after {timeout} s:\n{self.log}"
                self._changed.wait(min(left, 0.5))
        return matches[count - 1]

    def order(self, *events: str) -> list[str]:
        """Return these events as they follow each other in its log."""
        seen = []
        with self._changed:
            for line in self.lines:
                seen += [event for event in events if re.search(self.kind.log[event], line)]
        return seen

    @property
    def log(self) -> str:
        """What it has written of late, without the ends of long lines."""
        with self._changed:
            return "\n".join(line[:_WIDTH] for line in self.lines[-_LINES:])

    def signal(self, number: int) -> None:
        """Send it a signal."""
        self._process.send_signal(number)

    def kill(self) -> None:
        """End it as a crash does."""
        assert self._process.stdin is not None
        os.killpg(self._process.pid, signal.SIGKILL)
        self._process.stdin.close()
        self._end()

    def close(self) -> None:
        """End it: its input ends. One that is killed may leave a lock of the middleware locked."""
        if self._process.returncode is not None:
            return
        assert self._process.stdin is not None
        self._process.stdin.close()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(3.0)
        with suppress(ProcessLookupError):  # what it has started may live
            os.killpg(self._process.pid, signal.SIGKILL)
        self._end()

    def _end(self) -> None:
        self._process.wait()
        self._reader.join()

    def _read(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        with process.stdout:
            for line in process.stdout:
                with self._changed:
                    self.lines.append(line.rstrip())
                    self._changed.notify_all()
