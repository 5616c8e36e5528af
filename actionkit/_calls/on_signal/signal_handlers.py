"""Sets Python's handlers of signals, and tells what else handles a signal: a user's function, or
rclpy's handler in C.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from collections.abc import Callable
from types import FrameType
from typing import Any, TypeAlias

from actionkit._threads.waiting import Flag

Handler: TypeAlias = "Callable[[int, FrameType | None], Any] | int | None"
_libc = ctypes.CDLL(None)
_pythons_handler = 0
"""The address of Python's own handler in C: the same for all functions in Python."""


def set_handler(number: int, handler: Handler) -> None:
    """Set Python's handler of a signal, below rclpy's handler if there is one.

    `rclpy.init()` sets a handler in C, which shuts down all contexts, wakes the executors, and
    passes the signal on to the handler that it found. Python does not know about it, and would
    replace it with ours. So we take it out and put it in again, which takes microseconds, as if
    `rclpy.init()` came later. (If somebody has put another handler over rclpy's, rclpy ignores both
    steps.)
    """
    global _pythons_handler  # noqa: PLW0603
    rclpy = sys.modules.get("rclpy.signals")
    options = rclpy and rclpy.get_current_signal_handlers_options()
    listed = options is not None and _lists(options, number)
    if rclpy and listed:
        rclpy.uninstall_signal_handlers()
    signal.signal(number, signal.SIG_DFL if handler is None else handler)
    if callable(handler):
        _pythons_handler = _c_handler(number)
    if rclpy and listed:
        rclpy.install_signal_handlers(options)


def _lists(options: Any, number: int) -> bool:
    """Whether rclpy says that it handles a signal, even if another handler has replaced it."""
    mine = {int(signal.SIGINT): "SIGINT", int(signal.SIGTERM): "SIGTERM"}.get(number)
    return mine is not None and options.name in ("ALL", mine)


def rclpy_handles(number: int) -> bool:
    """Whether rclpy's handler passed the signal on to ours; it does its own part by itself."""
    rclpy = sys.modules.get("rclpy.signals")
    if rclpy is None or _c_handler(number) == _pythons_handler:
        return False
    return _lists(rclpy.get_current_signal_handlers_options(), number)


def _c_handler(number: int) -> int:
    """Return the address of a signal's handler in C: the first field of `struct sigaction`."""
    action = (ctypes.c_size_t * 64)()  # the struct needs 19 of these
    _libc.sigaction(number, None, action)
    return action[0]


def is_of_a_user(handler: Handler) -> bool:
    """Whether it is none of Python's handlers of Ctrl-C, which raise, or wake the loop."""
    if handler is signal.default_int_handler or not callable(handler):
        return False
    return getattr(getattr(handler, "func", None), "__module__", "") != "asyncio.runners"


def end_process(number: int) -> None:
    """Let the signal do its default, which ends the process. From any thread."""
    _libc.signal(number, None)  # Python's function works only in the main thread
    os.kill(os.getpid(), number)
    Flag().wait(1.0)  # another thread may receive it, within microseconds
