"""Lets a coroutine wait under asyncio, trio, or an executor of rclpy (C1.4, C1.13).

Each of these wakes a coroutine that waits for another thread in its own way. The frame that resumed
the coroutine shows which one it is. Several may run on a thread, one inside a callback of another,
and only the innermost can resume this coroutine.
"""

from __future__ import annotations

import concurrent.futures
import contextlib
import inspect
import sys
import threading
from collections.abc import Callable
from functools import partial
from types import FrameType
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from actionkit._calls.on_signal.signals import waking
from actionkit._threads.event_loop import running_loop
from actionkit._threads.waiting import Flag, complete, run_in_thread, wake_future

if TYPE_CHECKING:
    import asyncio

T = TypeVar("T")
_COROUTINE = (
    inspect.CO_COROUTINE
    | inspect.CO_GENERATOR
    | inspect.CO_ITERABLE_COROUTINE
    | inspect.CO_ASYNC_GENERATOR
)


class Driver(Protocol):
    """The library that runs the current coroutine."""

    cancellation: tuple[type[BaseException], ...]
    """The errors that cancel a coroutine and after which it may still wait."""
    was_cancelled: type[BaseException]
    """What awaiting a goal raises when somebody else has cancelled the goal."""
    has_ended: Callable[[], bool] | None
    """Whether it will not resume any coroutine; `None` if it tells its coroutines when it ends."""

    async def wait(self, flag: Flag) -> None:
        """Return when the flag is set."""

    async def let_others_begin(self) -> None:
        """Let tasks that exist now take their first step."""

    async def wait_cancelled(self, flag: Flag, seconds: float) -> None:
        """Return when the flag is set, or after `seconds`, even if the task was cancelled."""


class Asyncio:
    """The running event loop."""

    has_ended: Callable[[], bool] | None = None

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        import asyncio  # already imported

        self._asyncio = asyncio
        self._loop = loop
        self.was_cancelled: type[BaseException] = asyncio.CancelledError
        self.cancellation: tuple[type[BaseException], ...] = (asyncio.CancelledError,)

    async def wait(self, flag: Flag, seconds: float | None = None) -> None:
        """Return when the flag is set, or after `seconds`."""
        woken = self._loop.create_future()
        wake = partial(wake_future, self._loop, woken)
        timer = None if seconds is None else self._loop.call_later(seconds, complete, woken)
        flag.add_waiter(wake)
        try:
            if not flag.is_set():  # it may have been set before it had `wake`
                with waking(self._wake_up):
                    await woken
        finally:
            flag.remove_waiter(wake)
            if timer is not None:
                timer.cancel()

    def _wake_up(self) -> None:
        with contextlib.suppress(RuntimeError):  # the loop was closed
            self._loop.call_soon_threadsafe(int)

    async def let_others_begin(self) -> None:
        """Wait for the next turn of the loop."""
        with unless_by_anyio():
            await self._asyncio.sleep(0)

    async def wait_cancelled(self, flag: Flag, seconds: float) -> None:
        """Return when the flag is set, after `seconds`, or when the task is cancelled again."""
        with unless_by_anyio():
            await self.wait(flag, seconds)


def unless_by_anyio() -> contextlib.AbstractContextManager[object]:
    """Shield from the cancel scopes of anyio, which cancel a task at each turn of the loop."""
    anyio: Any = sys.modules.get("anyio")
    return contextlib.nullcontext() if anyio is None else anyio.CancelScope(shield=True)


class Trio:
    """The running trio."""

    was_cancelled: type[BaseException] = concurrent.futures.CancelledError
    has_ended: Callable[[], bool] | None = None

    def __init__(self) -> None:
        self._trio: Any = sys.modules["trio"]
        self._token = self._trio.lowlevel.current_trio_token()
        self.cancellation: tuple[type[BaseException], ...] = (self._trio.Cancelled,)

    async def wait(self, flag: Flag) -> None:
        """Return when the flag is set."""
        woken = self._trio.Event()

        def set_woken() -> None:
            with contextlib.suppress(self._trio.RunFinishedError):
                self._token.run_sync_soon(woken.set)

        def wake() -> None:
            run_in_thread(set_woken)  # the token has a lock

        flag.add_waiter(wake)
        try:
            if not flag.is_set():
                await woken.wait()
        finally:
            flag.remove_waiter(wake)

    async def let_others_begin(self) -> None:
        """Do nothing: trio takes functions, so it never makes a task of a future."""

    async def wait_cancelled(self, flag: Flag, seconds: float) -> None:
        """Return when the flag is set, or after `seconds`; Ctrl-C may end the wait earlier."""
        with self._trio.CancelScope(shield=True, deadline=self._trio.current_time() + seconds):
            await self.wait(flag)


def find_driver() -> Driver:
    """Return the driver of the coroutine that calls this.

    Raises:
        RuntimeError: The coroutine runs under nothing that can wait for a goal.
    """
    frame: FrameType | None = sys._getframe(1)
    trio_runs = "trio" in sys.modules
    while frame is not None and frame.f_code.co_flags & _COROUTINE:
        if trio_runs and _is_of_trio(frame):
            return Trio()
        frame = frame.f_back
    if frame is not None and frame.f_globals.get("__name__") == "rclpy.task":
        from actionkit._ros.rclpy_private.coroutines import Rclpy  # rclpy is already imported

        return Rclpy(frame.f_locals["self"])
    loop = running_loop()
    if loop is not None:
        return Asyncio(loop)
    raise RuntimeError(
        "nothing runs this coroutine that could go on with it later: await under asyncio, under"
        " trio, or in a callback that an executor of rclpy runs; elsewhere use what blocks, as"
        " result() does"
    )


def _is_of_trio(frame: FrameType) -> bool:
    """Whether the frame is in trio's own code: there a generator resumes the coroutines."""
    return str(frame.f_globals.get("__name__")).startswith("trio.")


async def in_thread(function: Callable[[], T]) -> T:
    """Call a function that blocks on a thread of its own, and wait for what it returns.

    The function continues even if the waiting task is cancelled. The threads of asyncio's executor
    are not used: there are few of them, and the interpreter's exit waits for them.

    Raises:
        RuntimeError: The coroutine runs under nothing that can wait; the function was called.
    """
    ended = Flag()
    end: concurrent.futures.Future[T] = concurrent.futures.Future()

    def call() -> None:
        try:
            end.set_result(function())
        except BaseException as error:  # noqa: BLE001  raised below
            end.set_exception(error)
        finally:
            ended.set()

    threading.Thread(target=call, name="actionkit-blocking", daemon=True).start()
    await find_driver().wait(ended)
    return end.result(0)
