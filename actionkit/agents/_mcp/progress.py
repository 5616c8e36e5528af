"""Progress on its way to a client that may be slow to read it."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Awaitable, Callable

from actionkit.agents._values import Progress

_PERIOD = 0.1
"""Seconds between two notifications, at least: feedback may come a thousand times a second."""
_LEAST_STEP = 0.001
EVERY = 5.0
"""Seconds between two while nothing changes: hosts give up on a call after some time of silence."""


class Reporter:
    """Sends the newest progress, and holds up nothing where its client does not read."""

    def __init__(self, send: Callable[[float, None, str], Awaitable[None]]) -> None:
        """Make one for a request.

        Args:
            send: Takes seconds since the request came, which only grow, and a line for people.
        """
        self._send = send
        self._newest = ""
        self._changed = asyncio.Event()
        self._began = time.monotonic()

    def __call__(self, progress: Progress) -> None:
        """Keep the newest progress, to be sent."""
        self.say(progress.message)

    def say(self, message: str) -> None:
        """Keep the newest line for people, to be sent."""
        self._newest = message
        self._changed.set()

    @contextlib.asynccontextmanager
    async def reporting(self) -> AsyncIterator[None]:
        """Send, as long as the block lasts."""
        task = asyncio.ensure_future(self._report())
        try:
            yield
        finally:
            task.cancel()

    @contextlib.asynccontextmanager
    async def saying(self, message: str) -> AsyncIterator[None]:
        """Say the same every few seconds, as long as the block lasts."""

        async def repeat() -> None:
            while True:
                self.say(message)
                await asyncio.sleep(EVERY)

        task = asyncio.ensure_future(repeat())
        try:
            yield
        finally:
            task.cancel()

    async def _report(self) -> None:
        told = 0.0
        while True:
            await self._changed.wait()
            self._changed.clear()
            # The protocol asks for numbers that grow; seconds do, with any feedback.
            told = max(round(time.monotonic() - self._began, 3), told + _LEAST_STEP)
            await self._send(told, None, self._newest)
            await asyncio.sleep(_PERIOD)
