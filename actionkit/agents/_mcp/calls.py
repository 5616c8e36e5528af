"""Calls in flight. Each is a task of its own, which is told once that its client gave up."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Mapping
from typing import Any

import anyio

from actionkit.agents._toolbox import Toolbox
from actionkit.agents._values import Approve, OnProgress, ToolResult

_LAST_WORDS = 0.5
"""Seconds for calls to end after the goals have."""
_AGAIN = 5.0
"""Seconds until a call is cancelled once more; the servers' confirmation takes 3 at most."""
_NOT_BEGUN = "this server is ending; nothing was sent"
_LOOKS = 4
"""Turns of the event loop in which a connection that is closed already shows that it is."""


class GoneError(Exception):
    """The client is gone, so nobody hears of it: the call was cancelled."""


class EndingError(Exception):
    """The process ends; the text says what that means for the call."""


class Calls:
    """All calls of a process, over all its connections."""

    def __init__(self, toolbox: Toolbox, after: asyncio.Future[Any] | None = None) -> None:
        """Make them. They wait until `after` is done, in any way, before they begin."""
        self._toolbox = toolbox
        self._after = [] if after is None else [after]
        self._tasks: set[asyncio.Task[ToolResult]] = set()
        self._ending = False

    async def run(
        self,
        name: str,
        arguments: Mapping[str, Any],
        *,
        gone: asyncio.Event | None,
        on_progress: OnProgress | None,
        approve: Approve | None,
    ) -> ToolResult:
        """Call a tool. Being cancelled cancels its goal, and waits until that is settled.

        Args:
            name: The tool.
            arguments: Its arguments.
            gone: Is set when the client's connection is dead; `None` where that ends the
                process, or cancels this.
            on_progress: See `Toolbox.call`.
            approve: See `Toolbox.call`.

        Raises:
            GoneError: The client is gone.
            EndingError: The process is ending.
        """
        if gone is not None:
            # A client that sent the request and vanished gets nothing sent (C10.3).
            for _ in range(_LOOKS):
                await asyncio.sleep(0)
            if gone.is_set():
                raise GoneError
        if self._ending:
            raise EndingError(_NOT_BEGUN)
        # Not awaited itself: a scope of anyio cancels what it awaits again and again, which would
        # end the wait for the server's confirmation, too.
        task = asyncio.ensure_future(self._call(name, arguments, on_progress, approve))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        vanished = asyncio.ensure_future(gone.wait()) if gone is not None else None
        try:
            await asyncio.wait(
                [task] if vanished is None else [task, vanished],
                return_when=asyncio.FIRST_COMPLETED,
            )
        finally:
            if vanished is not None:
                vanished.cancel()
            with anyio.CancelScope(shield=True):
                while not task.done():
                    task.cancel()
                    # Again after that: what a task awaits may swallow its cancellation.
                    await asyncio.wait([task], timeout=_AGAIN)
        try:
            return task.result()
        except asyncio.CancelledError:
            if not self._ending:
                raise GoneError from None
            raise EndingError(
                "this server is ending; the call was given up before anything was sent"
            ) from None

    async def _call(
        self,
        name: str,
        arguments: Mapping[str, Any],
        on_progress: OnProgress | None,
        approve: Approve | None,
    ) -> ToolResult:
        # Looked at here once more: the end may have come before this task's first turn, and what
        # begins after `cancel_all` is not cancelled by it.
        if self._after:
            await asyncio.wait(self._after)
        if self._ending:
            raise EndingError(_NOT_BEGUN)
        return await self._toolbox.call(name, arguments, on_progress=on_progress, approve=approve)

    async def end(self, patience: float) -> None:
        """Begin no more calls, cancel the goals of those there are, and wait for them.

        Args:
            patience: Seconds for the servers to confirm.
        """
        self._ending = True
        with contextlib.suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self._toolbox.cancel_all(), patience)
        # What did not have a goal by then: a question to a human, the reading of a topic.
        tasks = [task for task in self._tasks if not task.done()]
        if tasks:
            await asyncio.wait(tasks, timeout=_LAST_WORDS / 2)
        for task in tasks:
            task.cancel()
        if tasks:
            await asyncio.wait(tasks, timeout=_LAST_WORDS)
