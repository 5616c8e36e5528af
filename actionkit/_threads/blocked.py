"""Notices callbacks of the user's that do not return, and names them in the log.

One thread for the process looks once a second, and only while there are callback threads.
"""

from __future__ import annotations

import functools
import logging
import sys
import threading
import time
import traceback
from collections.abc import Callable
from types import BuiltinFunctionType, FunctionType, MethodType
from typing import Any, NamedTuple, Protocol

from actionkit._threads.diagnostics import log_later, log_own_error

_PERIOD = 1.0
"""Seconds between two looks, so that no callback has a timer of its own."""
BLOCKED_AFTER = 1.0
"""Seconds after which a callback counts as blocked, and another thread replaces its own. One that
only computes has returned long before."""
WARN_AFTER = 5.0
"""Seconds after which the log names it: one that waits for a slow disk has returned by then."""


class Label(NamedTuple):
    """What the log says of a callback that does not return.

    Attributes:
        kind: Such as `on_feedback`.
        function: The user's function, where there is one.
        holds_up: What waits until it returns.
    """

    kind: str
    function: object
    holds_up: str

    def __str__(self) -> str:
        return self.kind if self.function is None else f"{self.kind} {name_of(self.function)}"


class Work(Protocol):
    """One callback, or several that run one after the other."""

    label: Label

    def step(self) -> bool:
        """Run the next one; return whether there may be another."""
        ...


Turn = tuple[Work, float]
"""What a thread is running, and since which monotonic time. A new one for each callback."""


class Worker:
    """A callback thread, as the watcher sees it. Made on that thread."""

    __slots__ = ("owner", "replace", "replaced", "thread", "turn", "warned")

    def __init__(self, owner: str, replace: Callable[[Worker, Turn], None]) -> None:
        """Represent the running thread.

        Args:
            owner: The name of the client's action.
            replace: Called when the thread is blocked, with what it is running.
        """
        self.owner = owner
        self.replace = replace
        self.thread = threading.get_ident()
        self.turn: Turn | None = None
        self.replaced: Turn | None = None
        """The turn in which another thread took its place."""
        self.warned: Turn | None = None
        """The turn that the log warned of."""

    def begin(self, work: Work) -> None:
        """Note that the next callback begins."""
        self.turn = (work, time.monotonic())

    def end(self) -> None:
        """Note that it returned."""
        turn, self.turn = self.turn, None
        if turn is not None and self.warned is turn:
            _log_return(self, turn)
        self.warned = None


class _Watcher:
    """Looks at all callback threads of the process."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._workers: set[Worker] = set()
        self._running = False

    def add(self, worker: Worker) -> None:
        """Watch a thread from now on."""
        with self._changed:
            self._workers.add(worker)
            if self._running:
                return
            self._running = True
        try:
            threading.Thread(target=self._watch, name="actionkit-watcher", daemon=True).start()
        except RuntimeError:  # no more threads; from Python 3.12 on there are none at the exit
            with self._changed:
                self._running = False

    def remove(self, worker: Worker) -> None:
        """Watch a thread no more, because it ends."""
        with self._changed:
            self._workers.discard(worker)
            if not self._workers:
                self._changed.notify_all()

    def _watch(self) -> None:
        while True:
            with self._changed:
                if self._changed.wait_for(lambda: not self._workers, _PERIOD):
                    self._running = False
                    return
                workers = list(self._workers)
            _look_at_all(workers)
            workers.clear()  # or one that ends would be held until the next look


def _look_at_all(workers: list[Worker]) -> None:
    for worker in workers:
        try:
            look_at(worker, time.monotonic())
        except Exception:  # noqa: BLE001  the watcher of all clients is not to be lost
            log_own_error()


def look_at(worker: Worker, now: float) -> None:
    """Replace the thread, and warn, if its callback has been running for too long at time `now`."""
    turn = worker.turn
    if turn is None:
        return
    seconds = now - turn[1]
    if seconds >= BLOCKED_AFTER and worker.replaced is not turn:
        worker.replace(worker, turn)
    if seconds >= WARN_AFTER and worker.warned is not turn:
        worker.warned = turn
        _warn(worker, turn, seconds)


def _warn(worker: Worker, turn: Turn, seconds: float) -> None:
    label = turn[0].label
    frame = sys._current_frames().get(worker.thread)
    stack = "" if frame is None else "".join(traceback.format_stack(frame))
    log_later(
        logging.WARNING,
        "%s of action %r was called at %s, %.0f s ago, and has not returned. Until it does, it"
        " holds up %s. Let it return sooner, and do long work on a thread of your own",
        str(label),
        worker.owner,
        _clock_time(seconds),
        seconds,
        label.holds_up,
        stack=f"Where it is now (most recent call last):\n{stack}".rstrip() if stack else None,
    )


def _log_return(worker: Worker, turn: Turn) -> None:
    seconds = time.monotonic() - turn[1]
    log_later(
        logging.WARNING,
        "%s of action %r, called at %s, has returned after %.0f s",
        str(turn[0].label),
        worker.owner,
        _clock_time(seconds),
        seconds,
    )


def _clock_time(seconds_ago: float) -> str:
    return time.strftime("%H:%M:%S", time.localtime(time.time() - seconds_ago))


def name_of(function: Any) -> str:
    """Return what a callable is called in its source. Runs nothing of the user's, unlike `repr`."""
    while isinstance(function, functools.partial):
        function = function.func
    if isinstance(function, MethodType):
        function = function.__func__
    named = (FunctionType, BuiltinFunctionType, type)
    known = function if isinstance(function, named) else type(function)
    return f"{known.__module__}.{known.__qualname__}" if known.__module__ else known.__qualname__


watcher = _Watcher()
"""Looks at the callback threads of all clients of the process."""


def after_fork() -> None:
    """In a forked child, where the threads of the parent do not exist: watch none of them."""
    watcher.__init__()  # type: ignore[misc]  # one object, because others hold it
