"""The feedback of one call for its readers: `for`, `async for`, and the latest message (C1.7)."""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterable, Iterator
from functools import partial
from typing import Generic

from actionkit._calls.feedback import KEPT
from actionkit._messages.lazy import UndecodableError
from actionkit._model.action_type import FeedbackT
from actionkit._threads.waiting import Flag, taken_from, wake_future


class FeedbackBroadcast(Generic[FeedbackT]):
    """The feedback of one call as it comes, for any number of readers.

    `put` and `end` are called by one thread, which waits for none of the readers.
    """

    def __init__(self) -> None:
        self.count = 0
        self._latest: tuple[int, Callable[[], FeedbackT]] | None = None
        self._streams: list[_Stream[FeedbackT]] = []
        self._ended = False

    def put(self, *decodes: Callable[[], FeedbackT]) -> None:
        """Add messages."""
        first = self.count + 1
        self.count += len(decodes)
        self._latest = (self.count, decodes[-1])  # first: who then comes too late finds it here
        for stream in list(self._streams):
            stream.put(enumerate(decodes, first))

    def end(self) -> None:
        """No more will come."""
        self._ended = True
        for stream in list(self._streams):
            stream.end()
        self._streams.clear()

    @property
    def latest(self) -> FeedbackT | None:
        """The newest message, or `None`."""
        latest = self._latest
        try:
            return None if latest is None else latest[1]()
        except UndecodableError:
            return None

    def stream(self) -> FeedbackStream[FeedbackT]:
        """Return a reader of what comes from now on, beginning with the newest so far."""
        stream: _Stream[FeedbackT] = _Stream()
        self._streams.append(stream)
        latest = self._latest
        if latest is not None:
            stream.put([latest])  # it may be there already: its number tells
        if self._ended:
            stream.end()
        return FeedbackStream(stream)


class _Stream(Generic[FeedbackT]):
    """A bounded buffer with one reader, blocking or on an event loop. Who writes never waits."""

    def __init__(self) -> None:
        self._buffer: deque[tuple[int, Callable[[], FeedbackT]]] = deque(maxlen=KEPT)
        self._taken = 0  # the number of the last message that was taken
        self._ended = False
        self._wakes: deque[Callable[[], None]] = deque()

    def put(self, numbered: Iterable[tuple[int, Callable[[], FeedbackT]]]) -> None:
        self._buffer.extend(numbered)
        self._wake()

    def end(self) -> None:
        self._ended = True
        self._wake()

    def _wake(self) -> None:
        for wake in taken_from(self._wakes):
            wake()

    def _next(self) -> Callable[[], FeedbackT] | None:
        for number, decode in taken_from(self._buffer):
            if number > self._taken:
                self._taken = number
                return decode
        return None

    def take(self) -> Callable[[], FeedbackT] | None:
        """Wait for a message; `None` when no more will come."""
        while True:
            news = Flag()
            self._wakes.append(news.set)
            try:
                ended = self._ended  # before looking, or the last message could be missed
                decode = self._next()
                if decode is not None or ended:
                    return decode
                news.wait()
            finally:
                self._no_wake(news.set)

    async def take_async(self) -> Callable[[], FeedbackT] | None:
        """Wait for a message without blocking the loop; `None` when no more will come."""
        loop = asyncio.get_running_loop()
        while True:
            woken: asyncio.Future[None] = loop.create_future()
            wake = partial(wake_future, loop, woken)
            self._wakes.append(wake)
            try:
                ended = self._ended
                decode = self._next()
                if decode is not None or ended:
                    return decode
                await woken
            finally:
                self._no_wake(wake)

    def _no_wake(self, wake: Callable[[], None]) -> None:
        with contextlib.suppress(ValueError):  # it was called by now
            self._wakes.remove(wake)


class FeedbackStream(Generic[FeedbackT]):
    """`for` and `async for` over feedback; ends when the goal ends."""

    def __init__(self, stream: _Stream[FeedbackT]) -> None:
        self._stream = stream

    def __iter__(self) -> Iterator[FeedbackT]:
        """Yield messages, waiting for each."""
        while (decode := self._stream.take()) is not None:
            try:
                message = decode()
            except UndecodableError:
                continue
            yield message

    async def __aiter__(self) -> AsyncIterator[FeedbackT]:
        """Yield messages, awaiting each."""
        while (decode := await self._stream.take_async()) is not None:
            try:
                message = decode()
            except UndecodableError:
                continue
            yield message
