"""Provides waits that react to Ctrl-C at any moment, and wake-ups that never block (C2.5).

When a signal arrives, CPython only records it. Its handler, and so KeyboardInterrupt, runs between
two bytecodes of the main thread. If this thread gets the signal, the signal wakes it from a wait.
But if the signal arrives after the last bytecode and before the real wait, or if another thread
gets it, it is not handled until the wait ends. Without an end of the wait, a human would have to
press twice. (Seen with 2 of 960 signals to plain futures, and 7 of 294 to calls, in eight processes
at a time on two cores.) So the main thread waits in slices.
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
"""Seconds by which the reaction to a signal may be late: for a human that is still at once. It is
less than `session._CTRL_C_HEARD`."""


def slices(timeout: float | None) -> Iterator[float | None]:
    """Yield how long to wait each time, until the sum is `timeout`.

    `timeout` is in seconds; `None`, or more than the 292 years that the operating system can wait,
    means no limit. If it is 0 or less, there is one slice of this length.
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
    """Take out items one by one until nothing is left; several threads may do so at once."""
    while queue:
        try:
            item = queue.popleft()
        except IndexError:  # another thread was faster
            return
        yield item


class Flag:
    """Like `threading.Event`, but setting it waits for nobody (C2.9).

    An Event contains a lock, which a thread holds for a moment when it begins to wait. If a signal
    handler called `close()` at that moment, the communication thread would wait for that lock, and
    the handler for that thread. Here each waiting thread has a lock of its own.
    """

    __slots__ = ("_is_set", "_waiting")

    def __init__(self) -> None:
        self._is_set = False
        self._waiting: deque[Callable[[], None]] = deque()

    def is_set(self) -> bool:
        """Whether it was set."""
        return self._is_set

    def set(self) -> None:
        """Set it for good; all waiting threads continue. Never blocks."""
        self._is_set = True
        for wake in taken_from(self._waiting):
            wake()

    def add_waiter(self, wake: Callable[[], None]) -> None:
        """Call `wake` when it is set, unless it is set already: check that afterwards.

        The thread that sets the flag calls `wake`, which must neither block nor raise an error.
        """
        self._waiting.append(wake)

    def remove_waiter(self, wake: Callable[[], None]) -> None:
        """Undo `add_waiter`, even if `wake` was called already."""
        if wake not in self._waiting:
            return  # the usual case; the error of `remove` would cost more than everything else
        with contextlib.suppress(ValueError):
            self._waiting.remove(wake)

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until it is set, with reaction to Ctrl-C; return whether it is set.

        `timeout` is in seconds, `None` means no limit.
        """
        if self._is_set:
            return True
        woken = threading.Lock()
        woken.acquire()
        self.add_waiter(woken.release)
        try:
            if self._is_set:  # set just before it had `woken`
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

    It uses SIGALRM. If the program itself uses SIGALRM, nothing interrupts the block.
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
    except RuntimeError:  # the loop is closed
        return


def complete(future: asyncio.Future[None]) -> None:
    """Complete `future` on the thread of its loop, unless it is done."""
    if not future.done():
        future.set_result(None)


def run_in_thread(function: Callable[[], object]) -> None:
    """Run `function` on a thread of its own, because it takes locks of the user's threads.

    Not on a `threading.Thread`: starting one takes a lock, too.
    """
    try:
        _thread.start_new_thread(function, ())
    except RuntimeError:  # there are too many threads, or the interpreter is ending
        function()
