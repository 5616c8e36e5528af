"""Waits that react to Ctrl-C at any moment, and wake-ups that never block (C2.5).

When a signal comes, CPython only records it; its handler, and with it KeyboardInterrupt, runs
between two bytecodes of the main thread. A signal that this thread gets wakes it from a wait. One
that comes after the last bytecode and before the real wait, or that another thread gets, is not
handled until the wait ends. If the wait never ended, a human would have to press twice. (Seen with
2 of 960 signals to plain futures, and 7 of 294 to calls, of eight processes at a time on two
cores.) So the main thread waits in slices.
"""

from __future__ import annotations

import _thread
import contextlib
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    import asyncio

_T = TypeVar("_T")
_SLICE = 0.5
"""Seconds by which a signal may be heard late: to a human that is still at once."""


def slices(timeout: float | None) -> Iterator[float | None]:
    """Yield how long to wait each time, until it was `timeout` in all.

    Args:
        timeout: Seconds, or `None` for no limit. With 0 or less there is one slice, of that.
            More than the operating system can wait, 292 years, means no limit, too.
    """
    if timeout is not None and timeout > threading.TIMEOUT_MAX:
        timeout = None
    if threading.current_thread() is not threading.main_thread():
        yield timeout  # signal handlers do not run here
        return
    if timeout is None:
        while True:
            yield _SLICE
    until = time.monotonic() + timeout
    yield min(_SLICE, timeout)
    while (left := until - time.monotonic()) > 0:
        yield min(_SLICE, left)


def taken_from(queue: deque[_T]) -> Iterator[_T]:
    """Take out one after the other, until nothing is left; several threads may do so at once."""
    while queue:
        try:
            item = queue.popleft()
        except IndexError:  # another thread was quicker
            return
        yield item


class Flag:
    """Like `threading.Event`, but setting it waits for nobody (C2.9).

    An Event has a lock inside, which a thread holds for a moment when it begins to wait. If a
    signal handler called `close()` in that moment, the communication thread would wait for that
    lock, and the handler for that thread. Here each thread that waits has a lock of its own.
    """

    __slots__ = ("_is_set", "_waiting")

    def __init__(self) -> None:
        self._is_set = False
        self._waiting: deque[Callable[[], None]] = deque()

    def is_set(self) -> bool:
        """Whether it was set."""
        return self._is_set

    def set(self) -> None:
        """Set it, once and for all; all threads that wait go on. Never blocks."""
        self._is_set = True
        for wake in taken_from(self._waiting):
            wake()

    def add_waiter(self, wake: Callable[[], None]) -> None:
        """Have `wake` called when it is set, unless it is set already: look for that afterwards.

        Args:
            wake: Called by who sets the flag, so it must neither block nor raise.
        """
        self._waiting.append(wake)

    def remove_waiter(self, wake: Callable[[], None]) -> None:
        """Undo `add_waiter`, also where `wake` was called by now."""
        if wake not in self._waiting:
            return  # as a rule; the error of `remove` would cost more than all the rest
        with contextlib.suppress(ValueError):
            self._waiting.remove(wake)

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until it is set; hear Ctrl-C meanwhile.

        Args:
            timeout: Seconds, or `None` for no limit.

        Returns:
            Whether it is set.
        """
        if self._is_set:
            return True
        woken = threading.Lock()
        woken.acquire()
        self.add_waiter(woken.release)
        try:
            if self._is_set:  # just before `woken` could be seen
                return True
            for seconds in slices(timeout):
                if woken.acquire(timeout=-1 if seconds is None else max(0.0, seconds)):
                    return True
            return self._is_set
        finally:
            self.remove_waiter(woken.release)


@contextlib.contextmanager
def interrupted_at(until: float) -> Iterator[None]:
    """Interrupt the block just after that monotonic time, as Ctrl-C does. In the main thread.

    By SIGALRM: where the program uses that itself, nothing interrupts.
    """
    in_use = signal.getsignal(signal.SIGALRM) is not signal.SIG_DFL
    if in_use or any(signal.getitimer(signal.ITIMER_REAL)):
        yield
        return
    signal.signal(signal.SIGALRM, signal.default_int_handler)
    try:
        signal.setitimer(signal.ITIMER_REAL, max(0.0, until - time.monotonic()) + 0.1)
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, signal.SIG_DFL)


def wake_future(loop: asyncio.AbstractEventLoop, future: asyncio.Future[None]) -> None:
    """Complete `future` from another thread, even if its loop was closed (R11)."""
    try:
        loop.call_soon_threadsafe(complete, future)
    except RuntimeError:  # the loop was closed by now
        return


def complete(future: asyncio.Future[None]) -> None:
    """Complete `future` on the thread of its loop, if nobody else did."""
    if not future.done():
        future.set_result(None)


def run_in_thread(function: Callable[[], object]) -> None:
    """Run `function` on a thread for that alone, because it takes locks of the user's threads.

    Not a `threading.Thread`: starting one takes a lock, too.
    """
    try:
        _thread.start_new_thread(function, ())
    except RuntimeError:  # there are too many, or the interpreter is at its end
        function()
