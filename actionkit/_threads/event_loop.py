"""The event loop of asyncio that runs in this thread, if any.

Importing asyncio takes as long as making all of a client's entities, and most programs that block
need nothing of it. Where it was not imported by anybody, no loop of its kind can run.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import asyncio


def running_loop() -> asyncio.AbstractEventLoop | None:
    """Return the running event loop."""
    library: Any = sys.modules.get("asyncio")
    try:
        loop: asyncio.AbstractEventLoop = library.get_running_loop()
    except (RuntimeError, AttributeError):  # none runs; it is not imported, or is just now
        return None
    return loop


def running_task() -> asyncio.Task[Any] | None:
    """Return the task that runs in the running event loop."""
    loop = running_loop()
    if loop is None:
        return None
    import asyncio  # it is there

    return asyncio.current_task(loop)
