"""Lets one or several coroutines of asyncio, trio and rclpy await a goal (C1.4, C1.13)."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Coroutine, Iterator
from functools import partial
from typing import Any

from actionkit._calls.awaiting.drivers import Driver, find_driver
from actionkit._threads.clock import TimerHandle
from actionkit._threads.event_loop import running_task
from actionkit._threads.function_runner import Scheduler
from actionkit._threads.waiting import Flag

_LOOK_PERIOD = 1.0
"""Seconds between two checks whether an executor of rclpy that runs a waiting coroutine was shut
down; the executor does not tell anybody. If no other coroutine waits, the goal is cancelled then,
up to this much later."""

Wait = Callable[[], Coroutine[Any, Any, Any]]
"""Makes a coroutine that waits for the goal and returns its result."""


@contextlib.contextmanager
def _limited(flag: Flag, seconds: float | None, clock: Scheduler) -> Iterator[Flag]:
    """Yield a flag that is set with `flag`, or after `seconds`; `None` means no limit."""
    if seconds is None:
        yield flag
        return
    limited = Flag()
    at = time.monotonic() + seconds
    timers: list[TimerHandle] = []

    def begin() -> None:  # timers belong to the communication thread
        if not limited.is_set():
            timers.append(clock.call_at(at, limited.set))

    def end() -> None:
        for timer in timers:
            clock.cancel_timer(timer)

    flag.add_waiter(limited.set)
    try:
        if flag.is_set():
            limited.set()
        else:
            clock.call_soon(begin)
        yield limited
    finally:
        flag.remove_waiter(limited.set)
        limited.set()
        clock.call_soon(end)


class Awaiters:
    """The coroutines that await one goal. If all are cancelled, the last one cancels the goal."""

    def __init__(self, over: Flag, clock: Scheduler) -> None:
        """Begin without any. `over` is set when the call is over."""
        self._over = over
        self._clock = clock
        self._waiting: set[object] = set()
        """One object for each waiting coroutine."""
        self._tasks: dict[object, Coroutine[Any, Any, Any]] = {}
        """The waits of asyncio tasks that use the future itself as their coroutine. Each task is at
        a step of its own."""

    async def wait(
        self,
        cancel: Callable[[], object],
        tell: Callable[[BaseException], None],
        grace: float,
        until: Flag | None = None,
        seconds: float | None = None,
    ) -> type[BaseException]:
        """Wait until the call is over; return the error to raise if somebody else cancelled it.

        `cancel` cancels the goal. It is called if no coroutine waits any more, or can wait. A
        cancelled task waits `grace` seconds for the confirmation; then `tell` gets the error with
        which it ends. `until` is another end of the wait, which comes no later than the call's;
        after `seconds` it ends, too.

        Raises:
            RuntimeError: The coroutine runs under nothing that can wait for a goal.
        """
        waiting = object()
        self._waiting.add(waiting)
        driver = None
        try:
            driver = find_driver()
            if driver.has_ended is not None:
                self._clock.call_soon(partial(self._look, driver.has_ended, waiting, cancel))
            with _limited(until or self._over, seconds, self._clock) as end:
                await driver.wait(end)
            self._waiting.discard(waiting)
            return driver.was_cancelled
        except BaseException as error:
            await self._give_up(driver, error, waiting, cancel, tell, grace)
            raise

    async def _give_up(
        self,
        driver: Driver | None,
        error: BaseException,
        waiting: object,
        cancel: Callable[[], object],
        tell: Callable[[BaseException], None],
        grace: float,
    ) -> None:
        """Cancel the goal if no other coroutine waits; wait for the confirmation if possible."""
        if driver is None or not isinstance(error, driver.cancellation):
            self._stop(waiting, cancel)
            return
        cancelled = False
        try:
            try:
                await driver.let_others_begin()
            finally:
                cancelled = self._stop(waiting, cancel)
            if cancelled:
                await driver.wait_cancelled(self._over, grace)
                tell(error)
        except BaseException as second:
            if cancelled:
                tell(second)
            raise

    def _stop(self, waiting: object, cancel: Callable[[], object]) -> bool:
        self._waiting.discard(waiting)
        return not self._waiting and cancel() is not False

    def _look(
        self, has_ended: Callable[[], bool], waiting: object, cancel: Callable[[], object]
    ) -> None:
        """Check regularly whether an executor still runs. On the communication thread."""
        if self._over.is_set() or waiting not in self._waiting:
            return
        if has_ended():
            self._stop(waiting, cancel)
        else:
            look = partial(self._look, has_ended, waiting, cancel)
            self._clock.call_at(time.monotonic() + _LOOK_PERIOD, look)

    # --- tasks that use the future itself as their coroutine -------------------------------

    def send(self, wait: Wait, value: Any) -> Any:
        """Begin the wait of the running task with `wait`, or resume it with the loop's `value`."""
        task = running_task()
        begun = self._tasks.get(task)
        if begun is None:
            begun = self._tasks[task] = wait()
        return self._step(task, partial(begun.send, value))

    def throw(self, wait: Wait, error: BaseException) -> Any:
        """Raise an error in the running task; if its wait has not begun, begin it now."""
        task = running_task()
        begun = self._tasks.get(task)
        if begun is None:
            # The task was cancelled before its first step; that must cancel the goal, too.
            begun = self._tasks[task] = wait()
            try:
                self._step(task, partial(begun.send, None))
            except StopIteration:  # the call is over
                raise error from None
        return self._step(task, partial(begun.throw, error))

    def close(self, cancel: Callable[[], object]) -> None:
        """Cancel the goal if nobody waits: asyncio did not accept the future as a coroutine."""
        if not self._waiting:
            cancel()

    def _step(self, task: object, step: Callable[[], Any]) -> Any:
        try:
            return step()
        except BaseException:  # `StopIteration`, too: the wait is over
            self._tasks.pop(task, None)
            raise
