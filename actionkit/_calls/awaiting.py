"""The coroutines that await a goal: of asyncio, trio and rclpy, one or several (C1.4, C1.13)."""

from __future__ import annotations

import time
from collections.abc import Callable, Coroutine
from functools import partial
from typing import Any

from actionkit._calls.drivers import Driver, find_driver
from actionkit._threads.event_loop import running_task
from actionkit._threads.function_runner import Clock
from actionkit._threads.waiting import Flag

_LOOK_PERIOD = 1.0
"""Seconds between two checks whether an executor of rclpy that awaits a goal was shut down; it
tells nobody. If nobody can be told the goal's end any more, the goal is cancelled this much later.
"""

Wait = Callable[[], Coroutine[Any, Any, Any]]
"""Makes a coroutine that waits for the goal and returns its result."""


class Awaiters:
    """The coroutines that await one goal. The last one that is cancelled cancels the goal."""

    def __init__(self, over: Flag, clock: Clock) -> None:
        """Make one without any.

        Args:
            over: Set when the call is over.
            clock: The communication thread.
        """
        self._over = over
        self._clock = clock
        self._waiting: set[object] = set()
        """One object for each coroutine that waits."""
        self._tasks: dict[object, Coroutine[Any, Any, Any]] = {}
        """The waits of asyncio tasks that have the future itself as their coroutine, each at a step
        of its own."""

    async def wait(self, cancel: Callable[[], object], grace: float) -> type[BaseException]:
        """Wait until the call is over.

        Args:
            cancel: Cancels the goal. It is called where nobody waits for it any more, or can.
            grace: Seconds that a task which is cancelled waits for that to be confirmed.

        Returns:
            What is to be raised where the goal was cancelled by others.

        Raises:
            RuntimeError: Nothing runs this coroutine that could wait.
        """
        waiting = object()
        self._waiting.add(waiting)
        driver = None
        try:
            driver = find_driver()
            if driver.has_ended is not None:
                self._clock.call_soon(partial(self._look, driver.has_ended, waiting, cancel))
            await driver.wait(self._over)
            self._waiting.discard(waiting)
            return driver.was_cancelled
        except BaseException as error:
            await self._give_up(driver, error, waiting, cancel, grace)
            raise

    async def _give_up(
        self,
        driver: Driver | None,
        error: BaseException,
        waiting: object,
        cancel: Callable[[], object],
        grace: float,
    ) -> None:
        """Cancel the goal where nobody else waits for it, and wait for that where one can wait."""
        if driver is None or not isinstance(error, driver.cancellation):
            self._stop(waiting, cancel)
            return
        try:
            await driver.let_others_begin()
        finally:
            cancelled = self._stop(waiting, cancel)
        if cancelled:
            await driver.wait_cancelled(self._over, grace)

    def _stop(self, waiting: object, cancel: Callable[[], object]) -> bool:
        self._waiting.discard(waiting)
        if self._waiting:
            return False
        cancel()
        return True

    def _look(
        self, has_ended: Callable[[], bool], waiting: object, cancel: Callable[[], object]
    ) -> None:
        """Check once in a while whether an executor is still there. On the communication thread."""
        if self._over.is_set() or waiting not in self._waiting:
            return
        if has_ended():
            self._stop(waiting, cancel)
        else:
            look = partial(self._look, has_ended, waiting, cancel)
            self._clock.call_at(time.monotonic() + _LOOK_PERIOD, look)

    # --- tasks that have the future itself as their coroutine ------------------------------

    def send(self, wait: Wait, value: Any) -> Any:
        """Go on with the running task, or begin it.

        Args:
            wait: Called where the task begins.
            value: What the event loop sends.
        """
        task = running_task()
        begun = self._tasks.get(task)
        if begun is None:
            begun = self._tasks[task] = wait()
        return self._step(task, partial(begun.send, value))

    def throw(self, wait: Wait, error: BaseException) -> Any:
        """Raise an error in the running task; if its wait has not begun yet, it begins now."""
        task = running_task()
        begun = self._tasks.get(task)
        if begun is None:
            # Cancelled before its first step; the goal is to be cancelled all the same.
            begun = self._tasks[task] = wait()
            try:
                self._step(task, partial(begun.send, None))
            except StopIteration:  # the call is over
                raise error from None
        return self._step(task, partial(begun.throw, error))

    def close(self, cancel: Callable[[], object]) -> None:
        """Cancel the goal if nobody waits for it: asyncio refuses to make a task of the future."""
        if not self._waiting:
            cancel()

    def _step(self, task: object, step: Callable[[], Any]) -> Any:
        try:
            return step()
        except BaseException:  # `StopIteration`, too: the wait is over
            self._tasks.pop(task, None)
            raise
