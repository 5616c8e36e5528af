"""Runs commands, several at the same time, and reports why one failed."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from subprocess import DEVNULL, PIPE, STDOUT
from typing import TypeVar

from actionkit._interfaces.errors import InterfacesError

_SHOWN = 6
"""Lines that are shown, the first and the last: a compiler writes the cause first, Python last."""
Progress = Callable[[float], None]
In = TypeVar("In")


def run(
    words: Sequence[str], failed: str, folder: Path, environment: Mapping[str, str] | None = None
) -> None:
    """Run a command. If it fails, the error shows the first and the last lines that it wrote."""
    done = subprocess.run(
        words, cwd=folder, env=environment, stdin=DEVNULL, stdout=PIPE, stderr=STDOUT, check=False
    )
    if done.returncode:
        lines = done.stdout.decode(errors="replace").strip().splitlines()
        if len(lines) > 2 * _SHOWN:
            lines[_SHOWN:-_SHOWN] = ["..."]
        raise InterfacesError("\n".join([f"{failed} (exit code {done.returncode}):", *lines]))


def each(work: Callable[[In], None], things: Sequence[In], progress: Progress) -> None:
    """Call `work`, which waits for a process, for each thing, on several threads."""
    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        futures = [pool.submit(work, one) for one in things]
        try:
            for count, future in enumerate(as_completed(futures), 1):
                future.result()  # the first failure ends all others
                progress(count / len(things))
        finally:  # also after Ctrl-C: no process goes on
            pool.shutdown(cancel_futures=True)
