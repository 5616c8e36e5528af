"""Waiting in coroutines: for what blocks, and for what must be waited for though cancelled."""

from __future__ import annotations

import asyncio
import contextlib
import sys
import threading
from collections.abc import Callable
from typing import Any, TypeVar

T = TypeVar("T")


async def in_thread(function: Callable[[], T]) -> T:
    """Call a function that blocks on a thread of its own, and wait for what it returns.

    Where the waiting task is cancelled, the function goes on to its end. The threads of the event
    loop's executor are not used: there are few of them, and the interpreter's exit waits for them.
    """
    loop = asyncio.get_running_loop()
    done: asyncio.Future[T] = loop.create_future()

    def settle(result: Any, error: BaseException | None) -> None:
        if done.done():  # nobody waits any more
            return
        if error is not None:
            done.set_exception(error)
        else:
            done.set_result(result)

    def run() -> None:
        result: Any = None
        failed: BaseException | None = None
        try:
            result = function()
        except BaseException as error:  # noqa: BLE001  raised where it is waited for
            failed = error
        with contextlib.suppress(RuntimeError):  # the loop was closed
            loop.call_soon_threadsafe(settle, result, failed)

    threading.Thread(target=run, name="actionkit-agent", daemon=True).start()
    return await done


def though_cancelled() -> contextlib.AbstractContextManager[object]:
    """Keep out the cancel scopes of anyio, which cancel a task at each turn of the loop."""
    anyio: Any = sys.modules.get("anyio")
    return contextlib.nullcontext() if anyio is None else anyio.CancelScope(shield=True)
