"""Blocking waits that hear Ctrl-C, whenever it comes (contract C2.5).

CPython only takes note of a signal when it comes; its handler, and with it KeyboardInterrupt, runs
between two bytecodes of the main thread. A signal that this thread takes wakes it from a wait. One
that comes after the last bytecode and before the wait proper, or is taken by another thread, is not
heard until the wait ends. Where that would be never, a human would have to press twice. (Seen with
2 of 960 signals to plain futures, and 7 of 294 to calls, of eight processes at a time on two
cores.) So the main thread waits in slices.
"""

from __future__ import annotations

import concurrent.futures
import threading
import time
from collections.abc import Collection, Iterator
from typing import Any

_SLICE = 0.5
"""Seconds; as late as a signal may be heard."""


def slices(timeout: float | None) -> Iterator[float | None]:
    """Yield how long to wait each time, until it was `timeout` in all.

    Args:
        timeout: Seconds, or `None` for no limit. With 0 or less there is one slice, of that.
            More than the operating system can wait, 292 years, is no limit either.
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


def await_ends(
    futures: Collection[concurrent.futures.Future[Any]], grace: float, longest: float
) -> bool:
    """Wait for futures to be done, for as long as some of them end within each `grace` seconds.

    Args:
        futures: What to wait for.
        grace: Seconds.
        longest: Seconds by which the wait is extended at most.

    Returns:
        Whether all are done.
    """
    latest = time.monotonic() + grace + longest
    before = len(futures) + 1
    waiting = list(futures)
    while waiting and len(waiting) < before and time.monotonic() < latest:
        before = len(waiting)
        for seconds in slices(grace):
            if not concurrent.futures.wait(waiting, seconds)[1]:
                return True
        waiting = [future for future in waiting if not future.done()]
    return not waiting
