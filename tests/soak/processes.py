"""The processes of the soak: one that calls all the time, and programs that are ended."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.conftest import NEVER, Script
from tests.faults.crowd import Crowd
from tests.soak.children import CODES
from tests.soak.place import Place
from tests.soak.plan import CHILDREN, Program

_ROOT = Path(__file__).parents[2]
_LONGEST = 60.0
"""Seconds in which a program has to come to its end, from its start on."""
_SHOWN = 20_000


class Worker:
    """A process that calls, round after round."""

    def __init__(self, place: Place) -> None:
        """Start it."""
        self._stderr = tempfile.TemporaryFile()  # noqa: SIM115  closed by `stop`
        self._heard = 0
        with place.clients():
            self._process = subprocess.Popen(
                [sys.executable, "-m", "tests.soak.worker"],
                cwd=_ROOT,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._stderr,
                text=True,
                env={**os.environ, "PYTHONPATH": str(_ROOT)},
            )
        self._lines: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        threading.Thread(target=self._read, daemon=True, name="worker").start()
        try:
            self.answer(60)
        except queue.Empty:
            raise RuntimeError(
                f"the process that calls did not come up:\n{self.stacks()}"
            ) from None

    def tell(self, **command: Any) -> bool:
        """Give it a command; returns whether it is there to take it."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(command) + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            return False
        return True

    def answer(self, timeout: float) -> dict[str, Any]:
        """Its next line.

        Raises:
            queue.Empty: There was none in time, or the process is gone.
        """
        return self._lines.get(timeout=timeout)

    def stacks(self) -> str:
        """Where all of its threads are, by what it wrote on standard error."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGUSR1)
            NEVER.wait(1.0)
        # pread leaves alone the file offset, which the process shares and writes at.
        descriptor = self._stderr.fileno()
        size = os.fstat(descriptor).st_size
        return os.pread(descriptor, _SHOWN, max(0, size - _SHOWN)).decode(errors="replace")

    def said(self) -> str:
        """What it wrote on standard error, its log, since this was asked last."""
        descriptor, before = self._stderr.fileno(), self._heard
        self._heard = os.fstat(descriptor).st_size
        return os.pread(descriptor, self._heard - before, before).decode(errors="replace")

    def stop(self, timeout: float) -> bool:
        """End it; returns whether it ended by itself in time."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        try:
            self._process.wait(timeout)
            return self._process.returncode == 0
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            return False
        finally:
            self._stderr.close()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            # Fast DDS may complain there.
            if line.startswith("{"):
                self._lines.put(json.loads(line))


@dataclass
class Ended:
    """What came of a program that was told to end.

    Attributes:
        program: Which it was.
        seconds: From the word until its end; `None` where it had to be killed.
        crowd: The program, with what it reported.
        err: What it wrote on standard error.
        problem: What went wrong, or "".
    """

    program: Program
    seconds: float | None = None
    crowd: Crowd | None = None
    err: str = ""
    problem: str = ""
    report: list[Any] = field(default_factory=list)


def run_program(place: Place, program: Program, directory: Path) -> Ended:
    """Start a program, let it send its goals, tell it to end, and wait for its end."""
    if program.way in CHILDREN:
        return _run_with_child(place, program)
    ended = Ended(program)
    killed = threading.Event()
    try:
        with place.clients():
            crowd = Crowd(program.way, program.n, directory, action="endless")
    except (AssertionError, OSError) as error:
        ended.problem = f"it did not come up: {error!r}"
        return ended

    def kill() -> None:
        killed.set()
        crowd.process.send_signal(signal.SIGABRT)

    guard = threading.Timer(_LONGEST, kill)
    guard.start()
    try:
        crowd.tell()
        NEVER.wait(program.life)
        began = crowd.give_up()
        code, ended.err = crowd.finish(_LONGEST + 10)
        ended.crowd = crowd
        if killed.is_set():
            ended.problem = f"it did not end within {_LONGEST:g} s:\n{ended.err[-5000:]}"
        elif code not in (0, 3, -signal.SIGINT):
            ended.problem = f"it ended with {code}:\n{ended.err[-5000:]}"
        else:
            ended.report = list(crowd.ends)
            ended.seconds = crowd.reported_at - began
    except OSError as error:
        ended.problem = f"{error!r}"
    finally:
        guard.cancel()
        crowd.kill()
    return ended


def _run_with_child(place: Place, program: Program) -> Ended:
    """Start a program with a child that sends the goals, and wait for their ends."""
    how, end = program.way.split(", ")
    command = ["-m", "tests.soak.children", how, end, str(program.n), str(program.life)]
    with place.clients():
        script = Script(
            subprocess.Popen(
                [sys.executable, *command],
                cwd=_ROOT,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                env={**os.environ, "PYTHONPATH": str(_ROOT)},
                start_new_session=True,
            )
        )
    ended = Ended(program)
    try:
        code, _, ended.err = script.finish(_LONGEST)
        if code != CODES[end]:
            ended.problem = f"it ended with {code}:\n{ended.err[-5000:]}"
    except subprocess.TimeoutExpired:
        ended.problem = f"it did not end within {_LONGEST:g} s"
    finally:
        with contextlib.suppress(ProcessLookupError):  # its child, too, even if that hangs
            os.killpg(script.process.pid, signal.SIGKILL)
        script.end()
    return ended
