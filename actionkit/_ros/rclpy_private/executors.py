"""Wakes and asks the user's executors, with private parts of rclpy.

ActionKit has no executor of its own. Tested with rclpy 7.1.x.
"""

from __future__ import annotations

import contextlib
import weakref
from collections.abc import Callable
from typing import Any
from weakref import WeakMethod

from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.executors import Executor
from rclpy.task import Task

from actionkit._ros.rclpy_private.native import RCLError, is_up


def wake_executors(context: Context) -> None:
    """Wake the executors of a context that was shut down, so that their `spin` ends.

    At a signal, rclpy wakes executors first, and then shuts down their context. A quick executor
    finds the context still up, and waits for ever (in 4 of 270 programs with rclpy only).

    This does the same as `Executor.wake()`, because the user may have overridden that.
    """
    methods = [callback() for callback in context._callbacks if isinstance(callback, WeakMethod)]
    for executor in [getattr(method, "__self__", None) for method in methods]:
        guard = executor._guard if isinstance(executor, Executor) else None
        if guard is not None:
            with contextlib.suppress(InvalidHandle, RCLError):
                guard.trigger()


def executor_of(task: Any) -> Any:
    """Return the executor of a task; `None` if it has none, or the executor was dropped."""
    return task._executor()


def has_ended(executor: Any) -> bool:
    """Whether an executor, or its context, was shut down. From any thread; takes no lock."""
    context = getattr(executor, "context", None)
    return getattr(executor, "_is_shutdown", False) or (context is not None and not is_up(context))


def take_out(executor: Any, task: Task) -> Callable[[], None]:
    """Take a task that begins to wait out of its executor's list; return what puts it back.

    Up to rclpy 7.1.8, an executor runs every task in that list again whenever anything wakes it,
    and an executor with several threads records each time. With ten tasks that waited beside a
    timer of 100 Hz, it used a whole core after some seconds. Later versions have no such list, and
    continue a task when its wait is over.

    The function that puts the task back takes a lock. The executor runs the task when it wakes
    next.
    """
    tasks = getattr(executor, "_tasks", None)
    lock = getattr(executor, "_tasks_lock", None)
    taken: list[Any] = []
    if isinstance(tasks, list) and lock is not None:
        with lock:
            # Not `tasks`: it may be another list by now.
            taken = [entry for entry in executor._tasks if entry[0] is task]
            executor._tasks = [entry for entry in executor._tasks if entry[0] is not task]
    weak = weakref.ref(executor)

    def put_back() -> None:
        owner = weak()
        if owner is not None and lock is not None:
            with lock:
                owner._tasks += taken
                taken.clear()

    return put_back if taken else _nothing


def _nothing() -> None:
    return
