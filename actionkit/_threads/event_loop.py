"""Finds the event loop of asyncio that runs in this thread, if any, without importing asyncio.

The import takes as long as making all entities of a client, and most programs that block do not
need asyncio. If nobody has imported it, no such loop can be running.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import asyncio


def running_loop() -> asyncio.AbstractEventLoop | None:
    """Return the running event loop, if any."""
    library: Any = sys.modules.get("asyncio")
    try:
        loop: asyncio.AbstractEventLoop = library.get_running_loop()
    except (RuntimeError, AttributeError):  # no loop runs, or asyncio is not (fully) imported
        return None
    return loop


def running_task() -> asyncio.Task[Any] | None:
    """Return the task that the running event loop is running, if any."""
    loop = running_loop()
    if loop is None:
        return None
    import asyncio  # already imported

    return asyncio.current_task(loop)
