# rclpy has annotations here and there only.
# mypy: disable-error-code="no-untyped-call"
"""Executors for servers with many long goals at the same time."""

from __future__ import annotations

import inspect
import threading
import time
from collections.abc import Callable
from typing import Any

from rclpy.context import Context
from rclpy.executors import Executor, MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.task import Task

from actionkit.servers._run import ServerStopping


class ThreadPerGoalExecutor(SingleThreadedExecutor):
    """One thread answers requests, in their order; each executing goal has its own thread.

    rclpy's MultiThreadedExecutor offers a task again and again until a thread of its pool begins
    it. So it uses a whole core while the pool is full, and requests overtake each other. rclpy's
    ActionServer passes coroutine functions to `create_task` only to execute goals: so these tasks
    can be identified here.
    """

    def __init__(self, *, context: Context, on_error: Callable[[BaseException], None]) -> None:
        super().__init__(context=context)
        self._on_error = on_error
        self._threads: set[threading.Thread] = set()
        self._threads_lock = threading.Lock()

    def create_task(self, callback: Any, *args: Any, **kwargs: Any) -> Task:
        if not inspect.iscoroutinefunction(callback):
            return super().create_task(callback, *args, **kwargs)
        task = Task(callback, args, kwargs, executor=self)
        thread = threading.Thread(target=self._run, args=(task,), name="goal", daemon=True)
        with self._threads_lock:
            self._threads.add(thread)
        thread.start()
        return task

    def join_goals(self, seconds: float) -> bool:
        """Wait until the threads of the goals have ended; return whether all did in that time."""
        until = time.monotonic() + seconds
        with self._threads_lock:
            threads = self._threads - {threading.current_thread()}
        for thread in threads:
            thread.join(max(0.0, until - time.monotonic()))
        return not any(thread.is_alive() for thread in threads)

    def _run(self, task: Task) -> None:
        try:
            task()
            error = task.exception()
            if error is not None:
                self._on_error(error)
        except ServerStopping:
            pass
        finally:
            with self._threads_lock:
                self._threads.discard(threading.current_thread())


def make_executor(
    threads: int, context: Context, on_error: Callable[[BaseException], None]
) -> Executor:
    """Return the executor for the option `threads`."""
    if threads == 0:
        return ThreadPerGoalExecutor(context=context, on_error=on_error)
    if threads == 1:
        return SingleThreadedExecutor(context=context)
    return MultiThreadedExecutor(threads, context=context)


def spin(
    executor: Executor, stopping: Callable[[], bool], on_error: Callable[[BaseException], None]
) -> None:
    """Spin until `stopping`. A callback's exception is reported, and the loop goes on.

    rclpy's own `spin` would end with the first one. Some come from rclpy itself, such as a KeyError
    for a goal that expired while its result was being set.
    """
    while not stopping() and executor.context.ok():
        try:
            executor.spin_once()
        except ServerStopping:
            return
        except Exception as error:  # noqa: BLE001 - any error is reported
            if executor.context.ok():  # otherwise rclpy's signal handler has just shut it down
                on_error(error)
