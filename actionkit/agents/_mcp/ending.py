"""Why and when the process ends: a signal, or its host is gone; and that it does end.

Hosts close standard input, send SIGTERM 2 seconds later and SIGKILL 2 seconds after that. A part
that hangs by then, even the event loop, does not hold up the cancelling or the end.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import select
import signal
import threading
from collections.abc import Callable
from types import FrameType
from typing import NoReturn

PATIENCE = 2.5
"""Seconds for the servers to confirm that the goals are cancelled."""
_LOOP_HEARS = 0.8
"""Seconds for the event loop to begin, before another thread does it: it takes milliseconds."""
_LAST = 3.7
"""Seconds after which the process ends, even if it waits for something."""

_EXITS = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGHUP: 129}


class Ending:
    """Waits for the reason to end; the first counts. Made on the event loop, in the main thread.

    Attributes:
        asked: Set on the event loop when the process is to end.
        why: The reason, for people.
        code: The exit code.
    """

    def __init__(
        self, cancel_from_a_thread: Callable[[], object], go_on: Callable[[], list[str]]
    ) -> None:
        """Begin to hear of signals.

        Args:
            cancel_from_a_thread: Cancels all goals, and may block; called from a thread where the
                event loop does not begin to.
            go_on: Sees to the goals that may outlive the process; returns a line on each.
        """
        self.asked = asyncio.Event()
        self.why = ""
        self.code = 0
        self._cancel = cancel_from_a_thread
        self._go_on = go_on
        self._left: list[str] | None = None
        self._loop = asyncio.get_running_loop()
        self._first = threading.Lock()
        self._reads, writes = os.pipe()
        os.set_blocking(writes, False)
        for number in _EXITS:
            # Ignored before, as under `nohup` and in a script's background: stays so.
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, _heard_elsewhere)
        signal.set_wakeup_fd(writes, warn_on_full_buffer=False)
        # Not the loop's `add_signal_handler`: that hears of nothing while the loop hangs.
        threading.Thread(target=self._hear, name="mcp-signals", daemon=True).start()

    def ask(self, code: int, why: str) -> None:
        """Have the process end; only the first reason counts. From any thread."""
        if not self._first.acquire(blocking=False):
            return
        self.why, self.code = why, code
        threading.Thread(target=self._watch, name="mcp-ending", daemon=True).start()
        self._loop.call_soon_threadsafe(self.asked.set)

    def leave_behind(self) -> bool:
        """See to the goals that may outlive the process, once; return whether there are any."""
        if self._left is None:
            self._left = self._go_on()
            for line in self._left:
                say(line)
        return bool(self._left)

    def _hear(self) -> None:
        while True:
            for number in os.read(self._reads, 16):
                # The wakeup descriptor tells of every signal that has a handler in Python.
                if number in _EXITS and signal.getsignal(number) is _heard_elsewhere:
                    self.ask(_EXITS[signal.Signals(number)], signal.Signals(number).name)

    def _watch(self) -> None:
        """End the process in time, and cancel the goals where the event loop does not."""
        heard = threading.Event()
        self._loop.call_soon_threadsafe(heard.set)
        if not heard.wait(_LOOP_HEARS):
            threading.Thread(target=self._cancel, name="mcp-cancel", daemon=True).start()
        threading.Event().wait(_LAST - (0 if heard.is_set() else _LOOP_HEARS))
        try:
            self.leave_behind()
        finally:
            leave(self.code, "the end took too long")


def _heard_elsewhere(number: int, frame: FrameType | None) -> None:
    """Do nothing: the signal is heard by its wakeup descriptor."""


def leave(code: int, words: str = "") -> NoReturn:
    """End the process here and now, even if threads wait for something. Does not return.

    Python would wait for what is written to a host that reads nothing, and for the event loop's
    tasks that do.
    """
    if words:
        say(words)
    os._exit(code)


def say(words: str) -> None:
    """Tell people something, on standard error, which hosts keep in their logs."""
    text = f"actionkit mcp: {words}\n".encode(errors="replace")
    with contextlib.suppress(OSError, ValueError):  # nobody is there to read it
        # A host that reads nothing must not hold up the end: a pipe that can be written to at all
        # takes so many bytes without waiting.
        if select.select([], [2], [], 0)[1]:
            os.write(2, text[: select.PIPE_BUF])
