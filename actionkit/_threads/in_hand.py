"""Tracks callbacks that are due or running; clients and the interpreter wait for them at the end.

A callback that runs for long is named in the log when there is more for its client to do. Nothing
else watches it: if it holds up nothing, it is named at the end, if it has not returned by then.

`close()` calls `finish` and `end`, and a signal handler may call `close()`: so they take no lock.
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
from collections.abc import Callable, Mapping
from types import BuiltinFunctionType, FunctionType, MethodType
from typing import Any, NamedTuple, Protocol

from actionkit._threads.diagnostics import log_later
from actionkit._threads.waiting import Flag, interrupted_at, taken_from

_PATIENCE = 5.0
"""Seconds that closing and the interpreter's exit wait for callbacks: enough to save a result, but
too short to look like a hang."""
WARN_AFTER = 5.0
"""Seconds after which the log names a callback: even one that waits for a slow disk has returned
by then."""


class Label(NamedTuple):
    """How the log names a callback that does not return."""

    kind: str  # such as `on_feedback`
    function: object  # the user's function, if there is one
    holds_up: str  # what waits until it returns

    def __str__(self) -> str:
        return self.kind if self.function is None else f"{self.kind} {full_name_of(self.function)}"


def full_name_of(function: Any) -> str:
    """Return a callable's name in its source. Runs no code of the user's, unlike `repr`."""
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
        """Run the next callback; return whether there may be another."""
        ...


def patience(cancel_grace: float) -> float:
    """Return how many seconds the end waits for callbacks, given `Timeouts.cancel`."""
    return max(_PATIENCE, cancel_grace)


class DueWork:
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
        """The thread that runs it, when there is one. This thread cannot wait for it."""
        self.since = math.inf
        """When its latest callback began on a thread of a pool."""
        self.named = False
        """Whether the log has named it already."""
        self._runs = runs

    @property
    def can_go_on(self) -> bool:
        """Whether it can continue: its event loop may have ended, but a thread has not."""
        return self._runs is None or self._runs()

    def stack(self) -> str | None:
        """Return where its callback is now, if it runs on a thread of a pool."""
        frame = sys._current_frames().get(self.thread or 0)
        if self.since == math.inf or frame is None:
            return None
        lines = traceback.format_stack(frame)
        return "".join(["Where it is now (most recent call last):\n", *lines]).rstrip()


class WorkOfPool:
    """The work that is due or running in one pool."""

    def __init__(self, owner: str, busy: dict[WorkOfPool, None]) -> None:
        """Begin without work.

        `owner` is the name of the client's action, for the log. `busy` is `CALLBACKS`, or the table
        of other work that the interpreter's exit handles in the same way.
        """
        self._owner = owner
        self._busy = busy
        self._ended = False
        self._hurried = False
        self._look_at = 0.0
        """Before this monotonic time, no callback has been running for long."""
        self._in_hand: dict[DueWork, None] = {}
        self._rests: deque[Callable[[], None]] = deque()
        self._finishing: list[int] = []  # the threads that are waiting in `finish`
        self.run_one: Callable[[], bool] = lambda: False
        """Runs work on this thread that no thread of the pool takes, if there is any. From Python
        3.12 on, no thread can be started at the interpreter's exit."""

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
    ) -> DueWork:
        """Record work that is due; `finish` waits for it until `done`.

        If it runs on a thread of the pool, that is `work`. If it runs on an event loop, `thread` is
        the loop's thread, and `runs` returns whether the loop is running.
        """
        due = DueWork(label, work, thread, runs)
        self._in_hand[due] = None
        self._note_busy()
        return due

    def done(self, due: DueWork) -> None:
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
        """Name each callback once in the log if it has run for long at the monotonic time `now`."""
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

    def _name(self, due: DueWork, seconds: float) -> None:
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
        """Wait for what is due or running, except work that waits for the caller itself.

        Stop waiting at the monotonic time `until`. `run_one` runs on this thread some work that no
        other thread takes, if there is any. Return whether nothing is left.
        """
        self._finishing.append(threading.get_ident())
        self._wake()  # other threads may be waiting for the callback that waits here
        try:
            while self._awaited_here():
                left = 0.0 if self._hurried else max(0.0, until - time.monotonic())
                if run_one is not None and left and run_one():
                    continue
                rested = Flag()
                self._rests.append(rested.set)
                # The work may have ended just before.
                if self._awaited_here() and not rested.wait(left):
                    return not self._awaited_here()
            return True
        finally:
            self._finishing.remove(threading.get_ident())

    def hurry(self) -> None:
        """Make `finish` stop waiting, because Ctrl-C interrupted the closing."""
        self._hurried = True
        self._wake()

    def end(self, *, at_exit: bool = False) -> None:
        """Let nothing begin from now on, and name in the log what did not finish.

        `at_exit` means that the interpreter ends; otherwise work on the calling thread goes on.
        """
        # Before the rest, because it reads files: the exit in another thread names nothing that was
        # named here, and may be over before the log has it.
        stacks = {due: due.stack() for due in list(self._in_hand)} if not self._ended else {}
        if not self._ended:
            self._ended = True
            self._busy.pop(self, None)
            self.warn(list(self._in_hand) if at_exit else self._unfinished(), stacks)

    def _unfinished(self) -> list[DueWork]:
        """Return all work, except callbacks that are closing the client themselves."""
        here, in_hand = threading.get_ident(), list(self._in_hand)
        called_back = any(due.thread == here for due in in_hand)
        closing = {here, *self._finishing} if called_back else {here}
        return [due for due in in_hand if due.thread not in closing or not due.can_go_on]

    def _awaited_here(self) -> list[DueWork]:
        """Return the work that the calling thread can wait for."""
        return [due for due in self._unfinished() if due.can_go_on]

    def warn(self, left: list[DueWork], stacks: Mapping[DueWork, str | None]) -> None:
        """Name in the log what did not finish, with the `stacks` that are known."""
        for due in left if self._busy is CALLBACKS else []:
            began = "has not begun" if due.thread is None else "has not returned"
            log_later(
                logging.WARNING,
                "%s of action %r %s in the time that closing and the exit wait for callbacks, and"
                " is cut off: let it return sooner, or close the client later",
                str(due.label),
                self._owner,
                began,
                stack=stacks.get(due),
            )


class _Exit:
    """Whether the interpreter has begun to end."""

    begun = False


_exit = _Exit()
CALLBACKS: dict[WorkOfPool, None] = {}
"""Pools with callbacks that are due or running, for the interpreter's exit."""
OBSERVERS: dict[WorkOfPool, None] = {}
"""Pools with work for observers or the log."""
FUNCTIONS: dict[WorkOfPool, None] = {}
"""Pools with functions. Their call reports one that does not return; the exit does not wait."""


def finish_all(until: float, busy: dict[WorkOfPool, None]) -> list[DueWork]:
    """At the interpreter's exit: wait for the work of all clients in `busy`; return the rest."""
    try:
        with interrupted_at(until) if busy else contextlib.nullcontext():
            for dues in list(busy):
                dues.finish(until, dues.run_one)
    except KeyboardInterrupt:
        if time.monotonic() < until:
            raise  # from a human
    return [due for dues in list(busy) for due in list(dues._in_hand)]


def end_all() -> None:
    """At the interpreter's exit: let no callback begin, and name what did not finish."""
    _exit.begun = True
    for dues in list(CALLBACKS):
        dues.end(at_exit=True)


def after_fork() -> None:
    """In a forked child: leave the callbacks of the parent to the parent."""
    for busy in (CALLBACKS, OBSERVERS, FUNCTIONS):
        busy.clear()
