"""Keeps a new node from missing the first answers of those that it wants to discover.

A node announces itself when it is made, and every process that is there answers at once, to it
alone and once; what is announced later is answered only by the next regular announcement, up to 3 s
later. In Fast DDS 2.14 a participant announces itself up to a millisecond before it can take
answers, and drops those that come in between (`RTPSParticipantImpl::enable`). On a machine with
more than one core an answer takes a tenth of a millisecond, so one of three new nodes waited for
seconds until it saw a server that was there all the time.

What is dropped is dropped by threads of the middleware that read it too early. So while the node is
made, these threads share one core with the thread that makes it, and do not interrupt it there:
answers wait in their sockets until the node is complete. This needs no privilege. It is undone
when the node is made, and touches no thread but the maker's and those that it starts meanwhile.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
from collections.abc import Iterator
from functools import cache

SWITCH = "ACTIONKIT_QUICK_DISCOVERY"
"""The environment variable that turns this off, and the second try of `rejoining`, with `0`."""
_THREADS = "/proc/self/task"


def is_wanted() -> bool:
    """Return whether discovery is to be quickened: yes, unless the environment says no."""
    return os.environ.get(SWITCH, "").strip() != "0"


@contextlib.contextmanager
def joining() -> Iterator[None]:
    """Make the first node of a context in here. Does nothing where the system cannot do it."""
    alone = _alone() if is_wanted() else None
    try:
        yield
    finally:
        if alone is not None:
            alone.end()


def _alone() -> _Alone | None:
    if sys.platform != "linux":
        return None
    try:
        # A thread that somebody has made a real-time one could not be set back.
        if os.sched_getscheduler(0) == os.SCHED_OTHER:
            return _Alone()
    except (OSError, AttributeError):  # a sandbox that forbids it, or another C library
        pass
    return None


class _Alone:
    """The calling thread on the core where it runs, uninterrupted by threads that it starts."""

    def __init__(self) -> None:
        """Begin.

        Raises:
            OSError: The system does not allow it; nothing has changed.
            AttributeError: The C library has no function that is needed.
        """
        self._cores = os.sched_getaffinity(0)
        self._core = {_current_core()}
        self._others = _threads()
        os.sched_setaffinity(0, self._core)
        try:
            # A thread of this kind does not interrupt another when it wakes up.
            _set_policy(0, os.SCHED_BATCH)
        except OSError:
            os.sched_setaffinity(0, self._cores)
            raise

    def end(self) -> None:
        """Let the thread, and those that it has started, run as before."""
        with contextlib.suppress(OSError):
            _set_policy(0, os.SCHED_OTHER)
            os.sched_setaffinity(0, self._cores)
        seen = self._others
        # Those may have started others before they were set back.
        while new := _threads() - seen:
            for thread in new:
                self._set_back(thread)
            seen |= new

    def _set_back(self, thread: int) -> None:
        with contextlib.suppress(OSError):  # it has ended
            inherited = os.sched_getaffinity(thread) == self._core
            if inherited and os.sched_getscheduler(thread) == os.SCHED_BATCH:
                _set_policy(thread, os.SCHED_OTHER)
                os.sched_setaffinity(thread, self._cores)


def _set_policy(thread: int, policy: int) -> None:
    os.sched_setscheduler(thread, policy, os.sched_param(0))


def _threads() -> frozenset[int]:
    """Return the ids of this process's threads.

    Raises:
        OSError: The system does not tell.
    """
    return frozenset(map(int, os.listdir(_THREADS)))


def _current_core() -> int:
    core: int = _libc().sched_getcpu()
    if core < 0:
        raise OSError("the system does not tell on which core this thread runs")
    return core


@cache
def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None)
