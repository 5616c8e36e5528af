"""Refuses to block in ActionKit's own callbacks, and warns before blocking an event loop."""

from __future__ import annotations

import inspect
import sys
import warnings
from types import FrameType

from actionkit._threads.event_loop import running_loop
from actionkit._threads.pool import in_callback

_warned: list[str] = []
"""The warning that this process has given, if any: one is enough."""


def refuse_in_callback() -> None:
    """Raise if the caller would wait for itself.

    Raises:
        RuntimeError: The caller is inside one of ActionKit's callbacks.
    """
    if in_callback.get():
        raise RuntimeError(
            "Client.call() would wait inside a callback that ActionKit itself is waiting"
            " for: use call_async() here"
        )


def warn_on_event_loop(blocking: str, instead: str) -> None:
    """Warn once in a process that a call blocks an event loop, at the user's line.

    Call this directly from the public method that blocks. `instead` is code that does not block.
    """
    if running_loop() is not None and not _warned and not _is_line_of_a_notebook(sys._getframe(2)):
        _warned.append(blocking)
        warnings.warn(
            f"{blocking} blocks the event loop of asyncio that runs in this thread, with all its"
            f" tasks, until it returns: in a coroutine use `{instead}`",
            RuntimeWarning,
            stacklevel=3,
        )


def _is_line_of_a_notebook(frame: FrameType | None) -> bool:
    """Whether a cell calls this without a coroutine of the user's in between.

    Jupyter runs cells on its event loop, and nothing else goes on there until a cell has ended.
    """
    while frame is not None:
        if str(frame.f_globals.get("__name__")).startswith("IPython."):
            return True
        is_cell = frame.f_code.co_name.startswith("<")  # it has a coroutine's flag if it awaits
        if frame.f_code.co_flags & inspect.CO_COROUTINE and not is_cell:
            return False
        frame = frame.f_back
    return False
