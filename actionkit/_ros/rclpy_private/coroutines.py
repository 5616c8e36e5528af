"""Lets coroutines that an executor of rclpy runs wait for a goal (C1.13)."""

from __future__ import annotations

import concurrent.futures
import time
import weakref
from collections.abc import Callable
from typing import Any

from rclpy.task import Future

from actionkit._ros.rclpy_private.executors import executor_of, has_ended, take_out
from actionkit._threads.diagnostics import log_own_error
from actionkit._threads.waiting import Flag, run_in_thread

_STEP = 0.0005
"""Seconds between two checks whether the step that began a wait is over. A step takes microseconds,
and the check is needed only if the goal ended in that step."""


_Future: Any = Future  # it has no types


class Rclpy:
    """The user's executor that runs the current coroutine."""

    cancellation: tuple[type[BaseException], ...] = ()
    # It must be an `Exception`: otherwise rclpy does not end the task.
    was_cancelled: type[BaseException] = concurrent.futures.CancelledError

    def __init__(self, task: Any) -> None:
        """Find the executor of a task that is being executed.

        Raises:
            RuntimeError: There is none, so nothing would continue the coroutine.
        """
        executor = executor_of(task)
        if executor is None:
            raise RuntimeError("this coroutine belongs to no executor of rclpy, so it cannot wait")
        self._task = task
        self._executor: weakref.ref[Any] = weakref.ref(executor)
        self.has_ended: Callable[[], bool] | None = self._has_ended

    async def wait(self, flag: Flag) -> None:
        """Return when the flag is set."""
        executor: Any = self._executor()
        task, woken = self._task, _Future(executor=executor)
        put_back = take_out(executor, task)
        left = Flag()

        def resume() -> None:
            # An executor skips a task while its step is not over, and is not woken again.
            while task.executing() and not left.is_set():
                time.sleep(_STEP)
            executor = self._executor()
            try:
                woken.set_result(None)
                put_back()
                if executor is not None:
                    executor.wake()
            except Exception:  # noqa: BLE001  many kinds, if the executor was shut down
                if not (executor is None or has_ended(executor)):
                    log_own_error()

        def wake() -> None:
            run_in_thread(resume)  # future and executor have locks

        del executor  # do not keep the user's executor alive
        flag.add_waiter(wake)
        try:
            if flag.is_set():  # the coroutine goes on in this step
                put_back()
            else:
                await woken
        finally:
            left.set()
            flag.remove_waiter(wake)

    async def let_others_begin(self) -> None:
        """Do nothing: this is for tasks that were cancelled, and go on."""

    async def wait_cancelled(self, flag: Flag, seconds: float) -> None:
        """Do nothing: a coroutine that rclpy ends cannot wait."""

    def _has_ended(self) -> bool:
        """Whether the executor was dropped or shut down, or its context was."""
        executor = self._executor()
        return executor is None or has_ended(executor)
