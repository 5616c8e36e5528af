"""What is asked of, or done to, executors of the user's. It uses private parts of rclpy.

ActionKit has no executor of its own. Seen on rclpy 7.1.x.
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

from actionkit._ros.native import RCLError, is_up


def wake_executors(context: Context) -> None:
    """Wake the executors of a context that was shut down, so that their `spin` ends.

    At a signal rclpy wakes executors first, and then shuts down their context. One that is quick
    finds it still up, and waits on without end (in 4 of 270 programs of rclpy alone).

    What `Executor.wake()` does is done here, as that may be a method of the user's.
    """
    methods = [callback() for callback in context._callbacks if isinstance(callback, WeakMethod)]
    for executor in [getattr(method, "__self__", None) for method in methods]:
        guard = executor._guard if isinstance(executor, Executor) else None
        if guard is not None:
            with contextlib.suppress(InvalidHandle, RCLError):
                guard.trigger()


def executor_of(task: Any) -> Any:
    """Return the executor of a task; `None` where it has none, or it was dropped."""
    return task._executor()


def has_ended(executor: Any) -> bool:
    """Whether an executor, or its context, was shut down. From any thread; takes no lock."""
    context = getattr(executor, "context", None)
    return getattr(executor, "_is_shutdown", False) or (context is not None and not is_up(context))


def take_out(executor: Any, task: Task) -> Callable[[], None]:
    """Take a task that begins to wait out of the list of its executor.

    Up to 7.1.8 an executor runs every task in that list again whenever anything wakes it, and the
    one with several threads keeps a note of each time: with ten tasks that waited beside a timer of
    100 Hz it used a whole core after some seconds. Later ones have no such list, and go on with a
    task when what it awaits is done.

    Returns:
        What puts it back, so that the executor runs it when it is next woken. It takes a lock.
    """
    tasks = getattr(executor, "_tasks", None)
    lock = getattr(executor, "_tasks_lock", None)
    taken: list[Any] = []
    if isinstance(tasks, list) and lock is not None:
        with lock:
            # Not `tasks`, which may be another by now.
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
