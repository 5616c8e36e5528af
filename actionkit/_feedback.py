"""Feedback on its way to the user: callbacks, streams and the latest value (contract C1.7, C1.8).

Messages travel as bytes and are decoded where they are used, so that feedback nobody looks at
costs next to nothing, and a slow user costs the communication thread nothing.
"""

from __future__ import annotations

import asyncio
import inspect
import logging
import threading
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterator
from functools import partial
from typing import Any, Generic, Protocol

from actionkit._action_type import FeedbackT
from actionkit._blocked import Label
from actionkit._decode import UndecodableError
from actionkit._delivery import Pool, Strand, in_callback
from actionkit._diagnostics import log_here
from actionkit._waiting import slices

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

    def __init__(self, function: Callable[[Any], object], action_name: str, pool: Pool) -> None:
        self.errors = 0
        self._function = function
        self._action_name = action_name
        label = Label("on_feedback", function, "the further feedback of its goal")
        self._strand = Strand(pool, KEPT, label)
        self.finish = self._strand.finish
        self.close = self._strand.close

    def put(self, *decodes: Callable[[], Any]) -> None:
        """Queue messages."""
        self._strand.put(*(partial(self._call, decode) for decode in decodes))

    def _call(self, decode: Callable[[], Any]) -> None:
        try:
            self._function(decode())
        except UndecodableError:
            return
        except BaseException:  # noqa: BLE001  a user's error must not end the delivery (C1.8)
            self.errors += 1
            _log_error(self._action_name)


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
        self._lock = threading.Lock()
        self._jobs: deque[Callable[[], Any]] = deque(maxlen=KEPT)
        self._then: Callable[[], None] | None = None
        self._task: asyncio.Task[None] | None = None
        self._running = False
        self._closed = False

    def put(self, *decodes: Callable[[], Any]) -> None:
        """Queue messages."""
        with self._lock:
            if self._closed:
                return
            self._jobs.extend(decodes)  # the oldest give way
            if self._running:
                return
            self._running = True
        try:
            self._loop.call_soon_threadsafe(self._begin)
        except RuntimeError:  # the loop was closed: nobody is left to tell
            self._end()

    def finish(self, then: Callable[[], None]) -> None:
        """Call `then` once, when what is queued was handed over."""
        with self._lock:
            if self._running:
                self._then = then
                return
        then()

    def close(self) -> None:
        """Hand over nothing more."""
        with self._lock:
            self._closed = True
            self._jobs.clear()

    def _end(self) -> None:
        """Be closed, with nothing running."""
        with self._lock:
            self._closed = True
            self._running = False
            self._jobs.clear()
            then, self._then = self._then, None
        if then is not None:
            then()

    def _begin(self) -> None:
        self._task = self._loop.create_task(self._drain())  # kept: tasks are held weakly

    async def _drain(self) -> None:
        in_callback.set(True)
        while (decode := self._next()) is not None:
            try:
                await self._function(decode())
            except UndecodableError:
                continue
            except asyncio.CancelledError:
                if _is_being_cancelled():
                    self._end()  # the loop is shutting down
                    raise
                self._failed()
            except Exception:  # noqa: BLE001  a user's error must not end the delivery
                self._failed()
        self._finished()

    def _next(self) -> Callable[[], Any] | None:
        with self._lock:
            if self._jobs:
                return self._jobs.popleft()
            self._running = False
            return None

    def _finished(self) -> None:
        with self._lock:
            then, self._then = self._then, None
        if then is not None:
            then()

    def _failed(self) -> None:
        self.errors += 1
        _log_error(self._action_name)


def _log_error(action_name: str) -> None:
    log_here(logging.ERROR, "on_feedback of action %s raised", action_name, exc_info=True)


def _is_being_cancelled() -> bool:
    """Whether the running task was cancelled, and not just something that it called."""
    task: Any = asyncio.current_task()
    # Before Python 3.11 a task cannot tell; then it is taken to be cancelled.
    return not hasattr(task, "cancelling") or task.cancelling() > 0


def callbacks_for(
    function: Callable[[Any], object] | None, action_name: str, pool: Pool
) -> Callbacks | None:
    """Return what hands feedback to `function`.

    Args:
        function: A plain function, which runs on a thread of ActionKit's, or a coroutine
            function, which runs on the event loop of the caller.
        action_name: For the log.
        pool: Where a plain function runs.

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
        return ThreadCallbacks(function, action_name, pool)
    try:
        loop = asyncio.get_running_loop()
    except RuntimeError:
        raise TypeError(
            f"on_feedback={function!r} is a coroutine function, but no event loop is running in"
            " this thread: pass a plain function, or call from inside a coroutine"
        ) from None
    return LoopCallbacks(function, action_name, loop)


class FeedbackTape(Generic[FeedbackT]):
    """The feedback of one call as it comes, for any number of readers."""

    def __init__(self) -> None:
        self.count = 0
        self._lock = threading.Lock()
        self._latest: Callable[[], FeedbackT] | None = None
        self._streams: list[_Stream[FeedbackT]] = []
        self._ended = False

    def put(self, *decodes: Callable[[], FeedbackT]) -> None:
        """Add messages."""
        with self._lock:  # or a stream that is made just now gets the last of them twice
            self.count += len(decodes)
            self._latest = decodes[-1]
            for stream in self._streams:
                stream.put(*decodes)

    def end(self) -> None:
        """No more will come."""
        with self._lock:
            self._ended = True
            streams, self._streams = self._streams, []
        for stream in streams:
            stream.end()

    @property
    def latest(self) -> FeedbackT | None:
        """The newest message, or `None`."""
        decode = self._latest
        try:
            return None if decode is None else decode()
        except UndecodableError:
            return None

    def stream(self) -> FeedbackStream[FeedbackT]:
        """Return a reader of what comes from now on, beginning with the newest so far."""
        stream: _Stream[FeedbackT] = _Stream()
        with self._lock:
            if self._latest is not None:
                stream.put(self._latest)
            if self._ended:
                stream.end()
            else:
                self._streams.append(stream)
        return FeedbackStream(stream)


class _Stream(Generic[FeedbackT]):
    """A bounded buffer with one reader, blocking or on an event loop."""

    def __init__(self) -> None:
        self._condition = threading.Condition()
        self._buffer: deque[Callable[[], FeedbackT]] = deque(maxlen=KEPT)
        self._ended = False
        self._wakes: list[Callable[[], None]] = []

    def put(self, *decodes: Callable[[], FeedbackT]) -> None:
        with self._condition:
            self._buffer.extend(decodes)
            self._notify()

    def end(self) -> None:
        with self._condition:
            self._ended = True
            self._notify()

    def _notify(self) -> None:
        self._condition.notify_all()
        wakes, self._wakes = self._wakes, []
        for wake in wakes:
            wake()

    def take(self) -> Callable[[], FeedbackT] | None:
        """Wait for a message; `None` when no more will come."""
        with self._condition:
            for seconds in slices(None):
                if self._condition.wait_for(lambda: self._buffer or self._ended, seconds):
                    break
            return self._buffer.popleft() if self._buffer else None

    async def take_async(self) -> Callable[[], FeedbackT] | None:
        """Wait for a message without blocking the loop; `None` when no more will come."""
        loop = asyncio.get_running_loop()
        while True:
            with self._condition:
                if self._buffer:
                    return self._buffer.popleft()
                if self._ended:
                    return None
                woken: asyncio.Future[None] = loop.create_future()
                self._wakes.append(partial(wake_future, loop, woken))
            await woken


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


def wake_future(loop: asyncio.AbstractEventLoop, future: asyncio.Future[None]) -> None:
    """Complete `future` from another thread, whatever has become of its loop (R11)."""

    def complete() -> None:
        if not future.done():
            future.set_result(None)

    try:
        loop.call_soon_threadsafe(complete)
    except RuntimeError:  # the loop was closed by now
        return
