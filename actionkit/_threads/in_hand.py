"""Callbacks that are due or running: the end of a client, and of the interpreter, waits for them.

One that runs for long is named in the log when more comes for its client. Nothing watches it: what
holds up nobody is named at the end, if it has not returned by then.

`close()` calls `finish` and `end`, which a signal handler may do: so they take no lock.
"""

from __future__ import annotations

import contextlib
import functools
import logging
import math
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable
from types import BuiltinFunctionType, FunctionType, MethodType
from typing import Any, NamedTuple, Protocol

from actionkit._threads.diagnostics import log_later
from actionkit._threads.waiting import Flag, interrupted_at, taken_from

_PATIENCE = 5.0
"""Seconds that closing and the interpreter's exit wait for callbacks: enough to save a result, and
no hang for a human."""
WARN_AFTER = 5.0
"""Seconds after which the log names a callback: one that waits for a slow disk has returned by
then."""


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


def name_of(function: Any) -> str:
    """Return what a callable is called in its source. Runs nothing of the user's, unlike `repr`."""
    while isinstance(function, functools.partial):
        function = function.func
    if isinstance(function, MethodType):
        function = function.__func__
    named = (FunctionType, BuiltinFunctionType, type)
    known = function if isinstance(function, named) else type(function)
    return f"{known.__module__}.{known.__qualname__}" if known.__module__ else known.__qualname__


class Work(Protocol):
    """One callback, or several that run one after the other."""

    label: Label

    def step(self) -> bool:
        """Run the next one; return whether there may be another."""
        ...


def patience(cancel_grace: float) -> float:
    """Return how many seconds the end waits for callbacks, given `Timeouts.cancel`."""
    return max(_PATIENCE, cancel_grace)


class InHand:
    """Work that is due or running."""

    __slots__ = ("_runs", "label", "named", "since", "thread", "work")

    def __init__(
        self,
        label: Label,
        work: Work | None,
        thread: int | None = None,
        runs: Callable[[], bool] | None = None,
    ) -> None:
        self.label = label
        self.work = work
        self.thread = thread
        """The thread that runs it, once one does. It cannot wait for itself."""
        self.since = math.inf
        """When its latest callback began, on a thread of a pool."""
        self.named = False
        """Whether the log has named it."""
        self._runs = runs

    @property
    def can_go_on(self) -> bool:
        """Whether what runs it goes on: an event loop may have ended, a thread has not."""
        return self._runs is None or self._runs()

    def stack(self) -> str | None:
        """Return where its callback stands now, if it runs on a thread of a pool."""
        frame = sys._current_frames().get(self.thread or 0)
        if self.since == math.inf or frame is None:
            return None
        lines = traceback.format_stack(frame)
        return "".join(["Where it is now (most recent call last):\n", *lines]).rstrip()


class Dues:
    """What is due or running in one pool."""

    def __init__(self, owner: str, busy: dict[Dues, None]) -> None:
        """Begin with nothing.

        Args:
            owner: The name of the client's action, for the log.
            busy: `CALLBACKS`, or others that the interpreter's exit treats in the same way.
        """
        self._owner = owner
        self._busy = busy
        self._ended = False
        self._hurried = False
        self._look_at = 0.0
        """Before that monotonic time, no callback has been running for long."""
        self._in_hand: dict[InHand, None] = {}
        self._rests: deque[Callable[[], None]] = deque()
        self._finishing: list[int] = []  # the threads that wait in `finish`
        self.run_one: Callable[[], bool] = lambda: False
        """Runs on this thread what no thread of the pool takes, if there is any. From Python 3.12
        on no thread can be started at the interpreter's exit."""

    @property
    def ended(self) -> bool:
        """Whether nothing begins here any more."""
        return self._ended or _exit.begun

    def begin(
        self,
        label: Label,
        work: Work | None = None,
        thread: int | None = None,
        runs: Callable[[], bool] | None = None,
    ) -> InHand:
        """Note that something is due, which `finish` waits for until `done`.

        Args:
            label: What the log calls it.
            work: What a thread of the pool is to run.
            thread: Else the thread of the event loop that runs it.
            runs: Whether that loop is running.
        """
        due = InHand(label, work, thread, runs)
        self._in_hand[due] = None
        self._note_busy()
        return due

    def done(self, due: InHand) -> None:
        """Undo `begin`."""
        self._in_hand.pop(due, None)
        if not self._in_hand:
            self._busy.pop(self, None)
            if self._in_hand:  # begun meanwhile
                self._note_busy()
        self._wake()

    def _wake(self) -> None:
        for wake in taken_from(self._rests):
            wake()

    def _note_busy(self) -> None:
        if not self._ended:
            self._busy[self] = None

    def look(self, now: float) -> None:
        """Name in the log, once, what has been running for long at the monotonic time `now`."""
        if now < self._look_at:
            return
        earliest = now
        for due in list(self._in_hand):
            since = due.since
            if due.named:
                continue
            if now - since >= WARN_AFTER:
                due.named = True
                self._name(due, now - since)
            else:
                earliest = min(earliest, since)
        self._look_at = earliest + WARN_AFTER

    def _name(self, due: InHand, seconds: float) -> None:
        log_later(
            logging.WARNING,
            "%s of action %r was called at %s, %.0f s ago, and has not returned. Until it does, it"
            " holds up %s. Let it return sooner, and do long work on a thread of your own",
            str(due.label),
            self._owner,
            time.strftime("%H:%M:%S", time.localtime(time.time() - seconds)),
            seconds,
            due.label.holds_up,
            stack=due.stack(),
        )

    def finish(self, until: float, run_one: Callable[[], bool] | None = None) -> bool:
        """Wait for what is due or running, except what waits for the caller itself.

        Args:
            until: Monotonic time at which not to wait any longer.
            run_one: Runs on this thread something that no other takes, if there is any.

        Returns:
            Whether nothing is left.
        """
        self._finishing.append(threading.get_ident())
        self._wake()  # others may wait for the callback that waits here
        try:
            while self._awaited_here():
                left = 0.0 if self._hurried else max(0.0, until - time.monotonic())
                if run_one is not None and left and run_one():
                    continue
                rested = Flag()
                self._rests.append(rested.set)
                # It may have come to rest just before.
                if self._awaited_here() and not rested.wait(left):
                    return not self._awaited_here()
            return True
        finally:
            self._finishing.remove(threading.get_ident())

    def hurry(self) -> None:
        """Have `finish` wait no longer, because who waits for the closing was interrupted."""
        self._hurried = True
        self._wake()

    def end(self, *, at_exit: bool = False) -> None:
        """Let nothing begin any more, and name in the log what did not finish.

        Args:
            at_exit: Whether the interpreter ends. Else what runs on the calling thread goes on.
        """
        if not self._ended:
            self._ended = True
            self._busy.pop(self, None)
            self.warn(list(self._in_hand) if at_exit else self._unfinished())

    def _unfinished(self) -> list[InHand]:
        """What is in hand, less callbacks that close the client themselves."""
        here, in_hand = threading.get_ident(), list(self._in_hand)
        called_back = any(due.thread == here for due in in_hand)
        closing = {here, *self._finishing} if called_back else {here}
        return [due for due in in_hand if due.thread not in closing or not due.can_go_on]

    def _awaited_here(self) -> list[InHand]:
        """What the calling thread can wait for."""
        return [due for due in self._unfinished() if due.can_go_on]

    def warn(self, left: list[InHand]) -> None:
        """Name in the log what did not finish."""
        for due in left if self._busy is CALLBACKS else []:
            began = "has not begun" if due.thread is None else "has not returned"
            log_later(
                logging.WARNING,
                "%s of action %r %s in the time that closing and the exit wait for callbacks, and"
                " is cut off: let it return sooner, or close the client later",
                str(due.label),
                self._owner,
                began,
                stack=due.stack(),
            )


class _Exit:
    """Whether the interpreter has begun to end."""

    begun = False


_exit = _Exit()
CALLBACKS: dict[Dues, None] = {}
"""Those with callbacks that are due or running, for the interpreter's exit."""
OBSERVERS: dict[Dues, None] = {}
"""Those with something for observers or the log."""
FUNCTIONS: dict[Dues, None] = {}
"""Those with functions. A call reports one that does not return; the exit does not wait for it."""


def finish_all(until: float, busy: dict[Dues, None]) -> list[InHand]:
    """At the interpreter's exit: wait for all clients' callbacks, or observers; return the rest."""
    try:
        with interrupted_at(until) if busy else contextlib.nullcontext():
            for dues in list(busy):
                dues.finish(until, dues.run_one)
    except KeyboardInterrupt:
        if time.monotonic() < until:
            raise  # a human's
    return [due for dues in list(busy) for due in list(dues._in_hand)]


def end_all() -> None:
    """At the interpreter's exit: let no callback begin any more, and name what did not finish."""
    _exit.begun = True
    for dues in list(CALLBACKS):
        dues.end(at_exit=True)


def after_fork() -> None:
    """In a forked child: leave the callbacks of the parent to the parent."""
    for busy in (CALLBACKS, OBSERVERS, FUNCTIONS):
        busy.clear()
