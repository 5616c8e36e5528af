"""Passes feedback to the callback of a call, on a thread or on an event loop (C1.7, C1.8).

Each message comes as a function that decodes it, which is called only where the message is used. So
feedback that nobody reads costs almost nothing, and slow callbacks do not hold up the communication
thread.
"""

from __future__ import annotations

import inspect
import logging
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from actionkit._messages.lazy import UndecodableError
from actionkit._threads.diagnostics import is_interrupt, log_here, log_later
from actionkit._threads.event_loop import running_loop, running_task
from actionkit._threads.in_hand import DueWork, Label
from actionkit._threads.pool import Pool, in_callback
from actionkit._threads.serial_queue import SerialQueue

if TYPE_CHECKING:
    import asyncio

KEPT = 100
"""How many feedback messages wait for a slow callback or reader; if there are more, the oldest are
left out. That is feedback of some seconds: older messages do not show what the robot does now."""


class Callbacks(SerialQueue[Callable[[], Any]]):
    """Passes feedback to a user's callback, in order. The communication thread adds it."""

    def __init__(self, function: Callable[[Any], Any], action_name: str, pool: Pool) -> None:
        super().__init__(KEPT)
        self.label = Label("on_feedback", function, "the further feedback of its goal")
        """The callback's name in the log."""
        self.errors = 0
        """How often it has raised an error."""
        self._function = function
        self._action_name = action_name
        self._pool = pool
        self._closed = False

    def put(self, *items: Callable[[], Any]) -> None:
        """Queue messages."""
        if not self._closed:
            self._pool.look()  # the callback may have run for long
            super().put(*items)

    def close(self) -> int:
        """Pass on nothing more; return how many messages were waiting."""
        self._closed = True
        waiting = len(self._items)
        self._items.clear()
        self._finishes.clear()
        return waiting

    def _failed(self) -> None:
        """Count an error of the callback, and log the first: feedback may come at 50 Hz."""
        self.errors += 1
        if self.errors == 1:
            log_here(
                logging.ERROR,
                "%s of action %r raised. It is called with the Feedback message itself; further"
                " errors of it are counted until the goal ends",
                str(self.label),
                self._action_name,
                exc_info=True,
            )


class ThreadCallbacks(Callbacks):
    """Calls a plain function on a thread of the pool."""

    def _begin(self) -> None:
        self._pool.run(self)

    def step(self) -> bool:
        """Pass on the next message; return whether there may be another."""
        decode = self._take()
        if decode is None:
            return False
        try:
            self._function(decode())
        except UndecodableError:
            pass
        except BaseException as error:  # the callback still gets further feedback (C1.8)
            if is_interrupt(error):
                raise  # it ends the wait of the exit
            self._failed()
        return True


class LoopCallbacks(Callbacks):
    """Awaits a coroutine function on the caller's event loop."""

    def __init__(
        self,
        function: Callable[[Any], Any],
        action_name: str,
        pool: Pool,
        loop: asyncio.AbstractEventLoop,
    ) -> None:
        super().__init__(function, action_name, pool)
        self._loop = loop
        self._thread = threading.get_ident()
        self._due: DueWork | None = None
        self._task: asyncio.Task[None] | None = None

    def _begin(self) -> None:
        runs = self._loop.is_running
        self._due = self._pool.dues.begin(self.label, thread=self._thread, runs=runs)
        try:
            self._loop.call_soon_threadsafe(self._start)
        except RuntimeError:  # the loop was closed, so no callback can run
            self._end()

    def _start(self) -> None:
        self._task = self._loop.create_task(self._drain())  # stored, as loops hold tasks weakly

    def _rest(self) -> None:
        due, self._due = self._due, None
        if due is not None:
            self._pool.dues.done(due)
        super()._rest()

    def _end(self) -> None:
        """Drop what is queued, and run no task from now on."""
        self._closed = True
        self._items.clear()
        self._rest()

    async def _drain(self) -> None:
        import asyncio  # already imported: its loop runs this

        in_callback.set(True)
        while (decode := self._next()) is not None:
            try:
                await self._function(decode())
            except UndecodableError:
                continue
            except asyncio.CancelledError:
                if _is_being_cancelled():  # the loop is shutting down
                    self._tell_that_cut_off()
                    self._end()
                    raise
                self._failed()
            except Exception:  # noqa: BLE001  the callback still gets further feedback
                self._failed()

    def _next(self) -> Callable[[], Any] | None:
        if self._pool.dues.ended and self._items:
            left_out, because = len(self._items), "the client is closed"
            log_left_out(logging.WARNING, self, self._action_name, left_out, because)
            self._items.clear()
        return self._take()

    def _tell_that_cut_off(self) -> None:
        log_later(
            logging.WARNING,
            "%s of action %r was cancelled before it returned, as when its event loop ends: close"
            " the client before that, as `async with` does",
            str(self.label),
            self._action_name,
        )


def log_left_out(
    level: int, callbacks: Callbacks, action_name: str, messages: int, because: str
) -> None:
    """Log that a callback has missed feedback."""
    log_later(
        level,
        "%s of action %r was not given the last %d feedback messages, because %s. Let it return"
        " sooner, or read future.feedback()",
        str(callbacks.label),
        action_name,
        messages,
        because,
    )


def log_errors(callbacks: Callbacks, action_name: str) -> None:
    """Log how often a callback raised an error, if it did so more than once."""
    if callbacks.errors > 1:
        text = "%s of action %r raised %d times"
        log_later(logging.ERROR, text, str(callbacks.label), action_name, callbacks.errors)


def _is_being_cancelled() -> bool:
    """Whether the running task was cancelled, and not only something that it called."""
    task: Any = running_task()
    # Before Python 3.11, a task does not know; then assume that it is being cancelled.
    return not hasattr(task, "cancelling") or task.cancelling() > 0


def callbacks_for(
    function: Callable[[Any], object] | None, action_name: str, pool: Pool
) -> Callbacks | None:
    """Return the object that passes feedback to `function`.

    A plain function runs on a thread of `pool`, a coroutine function on the caller's event loop.

    Raises:
        TypeError: `function` cannot be called, or it is a coroutine function and no event loop
            runs in the calling thread.
    """
    if function is None:
        return None
    if not callable(function):
        number = isinstance(function, (int, float))
        hint = f"; for a time limit write timeout={function!r}" if number else ""
        raise TypeError(
            f"on_feedback={function!r} must be callable with the feedback message{hint}"
        )
    if not inspect.iscoroutinefunction(function) and not inspect.iscoroutinefunction(
        getattr(function, "__call__", None)  # noqa: B004  an object with `async def __call__`
    ):
        return ThreadCallbacks(function, action_name, pool)
    loop = running_loop()
    if loop is None:
        raise TypeError(
            f"on_feedback={function!r} is a coroutine function, but no event loop is running in"
            " this thread: pass a plain function, or call from inside a coroutine"
        )
    return LoopCallbacks(function, action_name, pool, loop)
