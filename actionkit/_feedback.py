"""Feedback on its way to the user: callbacks, streams and the latest value (contract C1.7, C1.8).

Messages travel as bytes and are decoded where they are used, so that feedback nobody looks at
costs next to nothing, and a slow user costs the communication thread nothing.
"""

from __future__ import annotations

import asyncio
import contextlib
import inspect
import logging
import threading
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, Generic, Protocol

from actionkit._action_type import FeedbackT
from actionkit._delivery import Strand, in_callback, pool
from actionkit._waiting import Flag, taken_from, wake_future

_log = logging.getLogger("actionkit")
KEPT = 100
"""Feedback messages that a slow callback or reader may be behind; then the newest win."""


class Callbacks(Protocol):
    """Hands feedback to a callback of the user's, in order."""

    errors: int

    def put(self, *decodes: Callable[[], Any]) -> None:
        """Queue messages."""

    def finish(self, then: Callable[[], None]) -> None:
        """Call `then` once, when what is queued was handed over."""

    def close(self) -> None:
        """Hand over nothing more."""


class ThreadCallbacks:
    """Calls a plain function on a thread of the pool."""

    def __init__(self, function: Callable[[Any], object], action_name: str) -> None:
        self.errors = 0
        self._function = function
        self._action_name = action_name
        self._strand = Strand(pool, KEPT)
        self.finish = self._strand.finish
        self.close = self._strand.close

    def put(self, *decodes: Callable[[], Any]) -> None:
        """Queue messages."""
        self._strand.put(*(partial(self._call, decode) for decode in decodes))

    def _call(self, decode: Callable[[], Any]) -> None:
        try:
            self._function(decode())
        except BaseException:  # noqa: BLE001  a user's error must not end the delivery (C1.8)
            self.errors += 1
            _log.exception("on_feedback of action %s raised", self._action_name)


@dataclass(frozen=True)
class _Last:
    """Stands behind the last message, to be called in its turn."""

    then: Callable[[], None]


class LoopCallbacks:
    """Awaits a coroutine function on the caller's event loop."""

    def __init__(
        self,
        function: Callable[[Any], Any],
        action_name: str,
        loop: asyncio.AbstractEventLoop,
    ) -> None:
        self.errors = 0
        self._function = function
        self._action_name = action_name
        self._loop = loop
        self._jobs: deque[Callable[[], Any] | _Last] = deque()
        self._task: asyncio.Task[None] | None = None
        self._running = threading.Lock()
        """Nobody waits for it: whoever gets it sees to what is queued."""
        self._closed = False

    def put(self, *decodes: Callable[[], Any]) -> None:
        """Queue messages."""
        if self._closed:
            return
        self._jobs.extend(decodes)
        for _ in range(len(self._jobs) - KEPT):
            self._jobs.popleft()  # the oldest give way
        if self._running.acquire(blocking=False):
            self._run()
        # Otherwise the task looks once more before it ends.

    def finish(self, then: Callable[[], None]) -> None:
        """Call `then` once, when what is queued was handed over."""
        self._jobs.append(_Last(then))
        if not self._running.acquire(blocking=False):
            return
        if len(self._jobs) > 1:
            self._run()
        else:
            self._end()

    def close(self) -> None:
        """Hand over nothing more."""
        self._closed = True
        self._jobs.clear()

    def _run(self) -> None:
        try:
            self._loop.call_soon_threadsafe(self._begin)
        except RuntimeError:  # the loop was closed: nobody is left to tell
            self._closed = True
            self._end()

    def _end(self) -> None:
        """Leave out what is queued; nothing is running any more."""
        for job in taken_from(self._jobs):
            if isinstance(job, _Last):
                job.then()
        self._running.release()

    def _begin(self) -> None:
        self._task = self._loop.create_task(self._drain())  # kept: tasks are held weakly

    async def _drain(self) -> None:
        in_callback.set(True)
        while (decode := self._next()) is not None:
            try:
                await self._function(decode())
            except asyncio.CancelledError:
                if _is_being_cancelled():
                    self._closed = True  # the loop is shutting down
                    self._end()
                    raise
                self._failed()
            except Exception:  # noqa: BLE001  a user's error must not end the delivery
                self._failed()

    def _next(self) -> Callable[[], Any] | None:
        """Return what is to be handed over next; `None` where nothing is running any more."""
        while True:
            for job in taken_from(self._jobs):
                if not isinstance(job, _Last):
                    return job
                job.then()
            self._running.release()
            # Something may have been queued just before, in the belief that this goes on.
            if not self._jobs or not self._running.acquire(blocking=False):
                return None

    def _failed(self) -> None:
        self.errors += 1
        _log.exception("on_feedback of action %s raised", self._action_name)


def _is_being_cancelled() -> bool:
    """Whether the running task was cancelled, and not just something that it called."""
    task: Any = asyncio.current_task()
    # Before Python 3.11 a task cannot tell; then it is taken to be cancelled.
    return not hasattr(task, "cancelling") or task.cancelling() > 0


def callbacks_for(function: Callable[[Any], object] | None, action_name: str) -> Callbacks | None:
    """Return what hands feedback to `function`.

    Args:
        function: A plain function, which runs on a thread of ActionKit's, or a coroutine
            function, which runs on the event loop of the caller.
        action_name: For the log.

    Raises:
        TypeError: `function` cannot be called, or is a coroutine function while no event loop
            runs in the calling thread.
    """
    if function is None:
        return None
    if not callable(function):
        raise TypeError(f"on_feedback={function!r} must be callable with the feedback message")
    if not inspect.iscoroutinefunction(function) and not inspect.iscoroutinefunction(
        getattr(function, "__call__", None)  # noqa: B004  an object with `async def __call__`
    ):
        return ThreadCallbacks(function, action_name)
    try:
        loop = asyncio.get_running_loop()
    except RuntimeError:
        raise TypeError(
            f"on_feedback={function!r} is a coroutine function, but no event loop is running in"
            " this thread: pass a plain function, or call from inside a coroutine"
        ) from None
    return LoopCallbacks(function, action_name, loop)


class DecodeOnce:
    """Decodes a message at most once, for all who look at it."""

    __slots__ = ("_pending", "_value")

    def __init__(self, decode: Callable[[bytes], Any], message: bytes) -> None:
        self._pending: tuple[Callable[[bytes], Any], bytes] | None = (decode, message)
        self._value: Any = None

    def __call__(self) -> Any:
        """Return the message."""
        pending = self._pending
        if pending is not None:
            # Two threads may both decode: the second value is as good as the first.
            decode, message = pending
            self._value = decode(message)
            self._pending = None
        return self._value


class FeedbackTape(Generic[FeedbackT]):
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
        return None if latest is None else latest[1]()

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
            yield decode()

    async def __aiter__(self) -> AsyncIterator[FeedbackT]:
        """Yield messages, awaiting each."""
        while (decode := await self._stream.take_async()) is not None:
            yield decode()
