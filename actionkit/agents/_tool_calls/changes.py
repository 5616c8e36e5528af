"""Coroutines wait until another thread has changed something."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress


class Changes:
    """Wakes coroutines, on any event loop, to check their condition again."""

    def __init__(self) -> None:
        self._wakers: list[Callable[[], None]] = []

    def tell(self) -> None:
        """Tell that something may have changed; from any thread."""
        for wake in list(self._wakers):
            wake()

    async def until(self, condition: Callable[[], bool], seconds: float | None = None) -> bool:
        """Wait until a condition is true, or the seconds are over; return whether it is true."""
        # No `asyncio.wait_for`: before Python 3.12 it may swallow the cancellation of the task.
        loop = asyncio.get_running_loop()
        changed = asyncio.Event()
        over = False

        def wake() -> None:
            with suppress(RuntimeError):  # the loop was closed
                loop.call_soon_threadsafe(changed.set)

        def end() -> None:
            nonlocal over
            over = True
            changed.set()

        timer = None if seconds is None else loop.call_later(seconds, end)
        self._wakers.append(wake)
        try:
            while not condition() and not over:  # after `append`: no change is missed
                await changed.wait()
                changed.clear()
        finally:
            self._wakers.remove(wake)
            if timer is not None:
                timer.cancel()
        return condition()
