"""Telling of progress: from feedback, and from time to time while nothing changes."""

from __future__ import annotations

import asyncio
import inspect
import json
import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

from actionkit._messages import progress
from actionkit.agents._answers.plain import plain_json
from actionkit.agents._values import OnProgress, Progress

_EVERY = 5.0
"""Seconds; programs that call tools give up after a minute in which they hear nothing."""
_LEAST_GAP = 0.25
"""Seconds between two: feedback may come by the thousand."""
_LONGEST = 300
"""Characters of a message."""
_MOST_ITEMS = 8
_log = logging.getLogger("actionkit")


@contextmanager
def telling(
    on_progress: OnProgress | None, state: Callable[[], str]
) -> Iterator[Callable[[object], None] | None]:
    """Report progress while the block runs; yield the function to call with feedback."""
    if on_progress is None:
        yield None
        return
    teller = _ProgressTeller(on_progress, state)
    task = asyncio.ensure_future(teller.run())
    try:
        yield teller.on_feedback
    finally:
        teller.over = True
        task.cancel()


class _ProgressTeller:
    """Reports the newest state; waits for each report to end. Runs on its own event loop.

    Attributes:
        over: Set when nothing more is to be told: `on_progress` may swallow a cancellation.
    """

    def __init__(self, on_progress: OnProgress, state: Callable[[], str]) -> None:
        self._on_progress: Any = on_progress
        self._state = state
        self.over = False
        self._loop = asyncio.get_running_loop()
        self._changed = asyncio.Event()
        self._latest: Any = None
        self._reader: progress.Progress | None = None
        self._share: float | None = None
        self._count = 0
        self._woken = False
        self._began = time.monotonic()

    def on_feedback(self, feedback: object) -> None:
        """Count feedback and keep the newest. On a thread of ActionKit's."""
        if self._count == 0 and (field := progress.found(type(feedback))) is not None:
            self._reader = progress.Progress(field)
        if self._reader is not None:
            self._share = self._reader.share(feedback)
        self._latest = feedback
        self._count += 1
        if not self._woken:  # one wake for all that comes meanwhile
            self._woken = True
            with suppress(RuntimeError):  # the loop was closed
                self._loop.call_soon_threadsafe(self._changed.set)

    async def run(self) -> None:
        """Tell of it until cancelled, or `over`."""
        while not self.over:
            # No `asyncio.wait_for`: before Python 3.12 it may swallow the cancellation of the task.
            timer = self._loop.call_later(_EVERY, self._changed.set)
            try:
                await self._changed.wait()
            finally:
                timer.cancel()
            self._changed.clear()
            self._woken = False
            try:
                told = self._on_progress(self._progress())
                if inspect.isawaitable(told):
                    await told
            except Exception:  # noqa: BLE001  the goal goes on
                _log.exception("on_progress raised; it is not called again for this")
                return
            await asyncio.sleep(_LEAST_GAP)

    def _progress(self) -> Progress:
        message = self._state()
        if self._latest is not None:
            plain = plain_json(self._latest, _MOST_ITEMS)
            text = json.dumps(plain, ensure_ascii=False)
            short = text if len(text) <= _LONGEST else text[:_LONGEST] + "…"
            message = f"{message}, feedback {self._count}: {short}"
        elapsed = round(time.monotonic() - self._began, 3)
        percent = None if self._share is None else round(100 * self._share, 3)
        return Progress(elapsed, self._count, message, percent)
