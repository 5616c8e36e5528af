"""Where a thread must not block, in callbacks of ActionKit's, or had better not, on event loops."""

from __future__ import annotations

import warnings

from actionkit._threads.event_loop import running_loop
from actionkit._threads.pool import in_callback

_warned: list[str] = []
"""What was warned of in this process: more than one would only repeat it."""


def refuse_in_callback() -> None:
    """Raise where waiting for a call would wait for itself.

    Raises:
        RuntimeError: The caller is inside a callback of ActionKit's.
    """
    if in_callback.get():
        raise RuntimeError(
            "Client.call() would wait inside a callback that ActionKit itself is waiting"
            " for: use call_async() here"
        )


def warn_on_event_loop(blocking: str, instead: str) -> None:
    """Warn, once in a process and naming the user's line, where an event loop is held up.

    Called by what the user calls.

    Args:
        blocking: What that is.
        instead: What does not block.
    """
    if running_loop() is not None and not _warned:
        _warned.append(blocking)
        warnings.warn(
            f"{blocking} blocks the event loop of asyncio that runs in this thread, with all its"
            f" tasks, until it returns: in a coroutine use `{instead}`",
            RuntimeWarning,
            stacklevel=3,
        )
