"""Runs tests on copies of the checkout, several at a time, each in a fork of this process.

This process has imported pytest and rclpy, which takes a second each time otherwise, but nothing of
ActionKit: each fork imports that from its copy.
"""

from __future__ import annotations

import importlib
import os
import select
import shutil
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from tests.mutants.mutant import Mutant

ROOT = Path(__file__).parents[2]
LONGEST = 300.0
"""Seconds after which the tests of one mutant are killed."""
_HANGS = "60"
"""Seconds after which a test has failed, as it hangs."""
_PRELOADED = ("_pytest.main", "hypothesis.strategies", "pytest", "rclpy.action", "rclpy.executors")
_FAILED = 1  # pytest's exit code where tests have failed; 0 where none has
_CRASHED = 70  # ours, where pytest itself has


@dataclass
class Run:
    """How the tests of a mutant have ended."""

    mutant: Mutant | None  # `None`: nothing was changed
    seconds: float
    code: int | None  # pytest's exit code; `None` if it was killed because it took too long
    output: str

    @property
    def noticed(self) -> bool:
        """Whether a test has failed."""
        return self.code == _FAILED

    @property
    def why(self) -> str:
        """The test that has failed, and how; or why none has."""
        failed = [
            line
            for line in self.output.splitlines()
            if line.startswith(("FAILED tests/", "ERROR tests/"))
        ]
        if failed:
            return failed[0].partition(" ")[2].removeprefix("tests/")
        if self.code is None:
            return f"its tests took longer than {LONGEST:g} s"
        if self.noticed:
            return "a test that hung"
        tests = "" if self.mutant is None else ", ".join(self.mutant.tests)
        return tests if self.code == 0 else f"pytest ended with {self.code}: {self.output[-500:]}"


@dataclass(eq=False)
class _Slot:
    """A copy of the checkout."""

    root: Path
    mutant: Mutant | None = None
    source: str = ""
    began: float = 0.0

    def begin(self, mutant: Mutant | None, arguments: list[str]) -> int:
        """Make the mutant, and start its tests; return the process."""
        self.mutant, self.began = mutant, time.monotonic()
        if mutant is not None:
            self.source = mutant.file(self.root).read_text("utf-8")
            self._write(mutant, self.source.replace(mutant.old, mutant.new))
        pid = os.fork()
        if pid:
            return pid
        code = _CRASHED
        try:
            code = self._test(arguments)
        except BaseException:  # noqa: BLE001  a fork never returns
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)

    def end(self, code: int | None) -> Run:
        """Undo the mutant; return how its tests have ended."""
        if self.mutant is not None:
            self._write(self.mutant, self.source)
        seconds = time.monotonic() - self.began
        return Run(self.mutant, seconds, code, self._log.read_text("utf-8", "replace"))

    @property
    def _log(self) -> Path:
        return self.root.with_suffix(".log")

    def _write(self, mutant: Mutant, source: str) -> None:
        file = mutant.file(self.root)
        file.write_text(source, "utf-8")
        # Python takes a compiled file for the right one if it is as old, in seconds, and as long.
        for compiled in (file.parent / "__pycache__").glob(f"{file.stem}.*"):
            compiled.unlink()

    def _test(self, arguments: list[str]) -> int:
        os.setsid()
        log = os.open(self._log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        nothing = os.open(os.devnull, os.O_RDONLY)
        for source, target in ((nothing, 0), (log, 1), (log, 2)):
            os.dup2(source, target)
        os.chdir(self.root)
        os.environ["PYTHONPATH"] = str(self.root)  # before the checkout that pip has installed
        sys.path[:] = [str(self.root), *(path for path in sys.path if path not in ("", str(ROOT)))]
        for name in [name for name in sys.modules if name.split(".")[0] in ("actionkit", "tests")]:
            del sys.modules[name]
        import pytest

        # In the usual folder one run removes what another one is about to read.
        return int(pytest.main([*arguments, "--basetemp", str(self.root.with_suffix(".files"))]))


def listed_files() -> list[str]:
    """Return the files of the checkout, also new ones, without those that git ignores."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, check=True, text=True).stdout
    return [name for name in listed.split("\0") if (ROOT / name).is_file()]


def _copies(folder: Path, number: int) -> list[_Slot]:
    slots, names = [_Slot(folder / f"copy{index}") for index in range(number)], listed_files()
    for slot in slots:
        for name in names:
            (slot.root / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, slot.root / name)
    return slots


def _next_end(running: dict[int, _Slot], longest: float = LONGEST) -> Run:
    """Wait until one has ended, or has taken too long."""
    oldest = min(running, key=lambda pid: running[pid].began)
    handles = {os.pidfd_open(pid): pid for pid in running}
    try:
        left = running[oldest].began + longest - time.monotonic()
        ended = select.select(handles, [], [], max(0.0, left))[0]
    finally:
        for handle in handles:
            os.close(handle)
    pid = handles[ended[0]] if ended else oldest
    _kill(pid)
    _, status = os.waitpid(pid, 0)
    return running.pop(pid).end(os.waitstatus_to_exitcode(status) if ended else None)


def _kill(pid: int) -> None:
    """Kill the process of some tests, and what it has started and left."""
    with suppress(ProcessLookupError):
        os.killpg(pid, signal.SIGKILL)


def run(mutants: Sequence[Mutant], folder: Path, at_once: int) -> Iterator[Run]:
    """Run the tests of each mutant; before that once all these tests, with nothing changed."""
    for name in _PRELOADED:
        importlib.import_module(name)
    slots = _copies(folder, at_once)
    running: dict[int, _Slot] = {}
    try:
        for long in (False, True):
            tests = {test for mutant in mutants if mutant.long is long for test in mutant.tests}
            if tests:
                arguments = [*_arguments(sorted(tests), long), "-n", str(at_once)]
                running[slots[0].begin(None, arguments)] = slots[0]
                yield _next_end(running, 4 * LONGEST)
        waiting = list(reversed(mutants))
        while waiting or running:
            for slot in [slot for slot in slots if slot not in running.values()][: len(waiting)]:
                mutant = waiting.pop()
                arguments = [*_arguments(mutant.tests, mutant.long), "-n", "0"]
                running[slot.begin(mutant, arguments)] = slot
            yield _next_end(running)
    finally:  # also after Ctrl-C
        for pid in running:
            _kill(pid)


def _arguments(tests: Iterable[str], long: bool) -> list[str]:
    first = ["-q", "-x", "--reruns", "0", "--timeout", _HANGS, "-p", "no:cacheprovider"]
    return [*first, *(["--long"] if long else []), *(f"tests/{test}" for test in tests)]
