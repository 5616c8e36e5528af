"""When a process counts as doing nothing."""

from __future__ import annotations

import select
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from actionkit.servers import _quiet
from actionkit.servers._quiet import await_quiet

SPINS = """
import sys, time
print("spins", flush=True)
until = time.monotonic() + 0.2
while time.monotonic() < until:
    pass
print("rests", flush=True)
sys.stdin.read()
"""


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="no /proc here")
def test_a_process_that_runs_is_not_quiet() -> None:
    command = [sys.executable, "-c", SPINS]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdin
        assert process.stdout
        assert process.stdout.readline() == b"spins\n"
        await_quiet(process.pid)
        assert select.select([process.stdout], [], [], 0)[0], "it still spins"
        process.stdin.close()


def test_a_process_that_is_gone_is_quiet_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    waits: list[float] = []
    clock = SimpleNamespace(monotonic=time.monotonic, sleep=waits.append)
    monkeypatch.setattr(_quiet, "time", clock)
    await_quiet(process.pid)
    assert waits == []
