"""Handles what ends a call from outside: signals, and a closed output."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import stat
import sys
import threading
import time
from collections.abc import Callable, Iterator
from types import FrameType

from actionkit.cli._shared import early
from actionkit.cli._shared.exits import Exit

_EXITS = {
    signal.SIGINT: Exit.INTERRUPTED,
    signal.SIGTERM: Exit.TERMINATED,
    signal.SIGHUP: Exit.HANGUP,
}
_SHOW_CURSOR = b"\x1b[?25h"
_ONE_PRESS = 0.1
"""Seconds in which two signals count as one press of Ctrl-C: the terminal sends SIGINT to all its
processes, and a wrapper such as `uv run` sends us its own one, too."""


@contextlib.contextmanager
def handled(
    first: Callable[[Exit], object], farewell: Callable[[], str], *, times: int = 1
) -> Iterator[None]:
    """Handle SIGINT, SIGTERM and SIGHUP: the first calls `first`, the next ends the process.

    Signals that were ignored before, as with `nohup` or a shell's `&`, stay ignored. `first` gets
    the exit code and runs in the main thread, in the middle of its work. It is called so many
    `times` before another signal ends the process. `farewell` returns the text for that.

    Raises:
        KeyboardInterrupt: Ctrl-C came before, and was lost.
    """
    told: list[float] = []

    def handle(number: int, frame: FrameType | None) -> None:
        now = time.monotonic()
        code = _EXITS[signal.Signals(number)]
        if told and now - told[-1] <= _ONE_PRESS:
            return
        told.append(now)  # before: another signal may come during this
        if len(told) <= times:
            first(code)
        elif len(told) == times + 1:
            leave_at_once(code, farewell())

    before = {
        number: signal.signal(number, handle)
        for number in _EXITS
        if signal.getsignal(number) is not signal.SIG_IGN
    }
    try:
        early.check()
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler or signal.SIG_DFL)


def leave_at_once(code: Exit, words: str) -> None:
    """End the process at once. Does not return."""
    with contextlib.suppress(OSError):
        if sys.stdout.isatty():
            os.write(sys.stdout.fileno(), _SHOW_CURSOR)
        os.write(2, f"\n{words}\n".encode(errors="replace"))
    os._exit(code)


def watch_output(closed: Callable[[], object]) -> None:
    """Call `closed` on another thread when nobody reads our output any more.

    A write would show it, too, but the next write may be hours away while a goal runs. If it is so
    already, call it here.
    """
    try:
        descriptor = sys.stdout.fileno()
        mode = os.fstat(descriptor).st_mode
    except OSError:
        return
    if not (stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode)):
        return

    poll = select.poll()
    poll.register(descriptor, 0)  # errors are always reported
    if poll.poll(0):
        closed()
        return

    def watch() -> None:
        poll.poll()
        closed()

    threading.Thread(target=watch, name="output", daemon=True).start()


def discard_output() -> None:
    """Drop unwritten output: Python would try to write it again at its end."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in filter(None, (sys.stdout, sys.stderr)):
        try:
            stream.flush()
        except OSError:
            os.dup2(nowhere, stream.fileno())
    os.close(nowhere)
