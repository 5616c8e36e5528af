"""Gives the feedback of one call to its readers: `for`, `async for`, the latest message (C1.7)."""

from __future__ import annotations

import contextlib
import weakref
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterable, Iterator
from typing import Generic

from actionkit._calls.awaiting.drivers import find_driver
from actionkit._calls.futures.feedback import KEPT
from actionkit._messages.lazy import UndecodableError
from actionkit._model.action_type import FeedbackT
from actionkit._threads.waiting import Flag, taken_from


class FeedbackBroadcast(Generic[FeedbackT]):
    """The feedback of one call as it arrives, for any number of readers.

    One thread calls `put` and `end`. It does not wait for any reader.
    """

    def __init__(self) -> None:
        self.count = 0
        self._latest: tuple[int, Callable[[], FeedbackT]] | None = None
        self._streams: list[weakref.ref[FeedbackStream[FeedbackT]]] = []
        """Weak references: a loop that is left early tells nobody, its reader is only freed."""
        self._ended = False

    def put(self, *decodes: Callable[[], FeedbackT]) -> None:
        """Give messages to all readers."""
        first = self.count + 1
        self.count += len(decodes)
        # Before the loop over the streams: a stream that is added too late begins with this one.
        self._latest = (self.count, decodes[-1])
        for stream in self._readers():
            stream._put(enumerate(decodes, first))

    def end(self) -> None:
        """End all streams: no more messages will come."""
        self._ended = True
        for stream in self._readers():
            stream._end()
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
        """Return a reader that begins with the newest message and continues with new ones."""
        stream: FeedbackStream[FeedbackT] = FeedbackStream()
        self._streams.append(weakref.ref(stream, self._forget))
        latest = self._latest
        if latest is not None:
            stream._put([latest])  # `put` may have added it already: readers check its number
        if self._ended:
            stream._end()
        return stream

    def _readers(self) -> list[FeedbackStream[FeedbackT]]:
        streams = [reference() for reference in list(self._streams)]
        return [stream for stream in streams if stream is not None]

    def _forget(self, reference: weakref.ref[FeedbackStream[FeedbackT]]) -> None:
        with contextlib.suppress(ValueError):  # the goal has ended
            self._streams.remove(reference)


class FeedbackStream(Generic[FeedbackT]):
    """Iterates over feedback with `for` or `async for`, until the goal ends.

    It is a limited buffer for one reader. The thread that adds messages never waits.
    """

    def __init__(self) -> None:
        self._buffer: deque[tuple[int, Callable[[], FeedbackT]]] = deque(maxlen=KEPT)
        self._last_taken = 0
        """The number of the last message that the reader got."""
        self._ended = False
        self._more = Flag()
        """Set, and replaced by a new flag, when there is more to read."""

    def __iter__(self) -> Iterator[FeedbackT]:
        """Yield messages; wait for each."""
        while True:
            more, ended = self._more, self._ended  # before reading, or the last could be missed
            yield from self._messages()
            if ended:
                return
            more.wait()

    async def __aiter__(self) -> AsyncIterator[FeedbackT]:
        """Yield messages; await each without blocking the thread of this coroutine."""
        while True:
            more, ended = self._more, self._ended
            for message in self._messages():
                yield message
            if ended:
                return
            await find_driver().wait(more)

    def _messages(self) -> Iterator[FeedbackT]:
        for number, decode in taken_from(self._buffer):
            if number > self._last_taken:
                self._last_taken = number
                with contextlib.suppress(UndecodableError):
                    yield decode()

    def _put(self, numbered: Iterable[tuple[int, Callable[[], FeedbackT]]]) -> None:
        self._buffer.extend(numbered)
        self._wake()

    def _end(self) -> None:
        self._ended = True
        self._wake()

    def _wake(self) -> None:
        more, self._more = self._more, Flag()
        more.set()
