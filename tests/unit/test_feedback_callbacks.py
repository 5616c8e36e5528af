"""Feedback on its way to callbacks and readers (contract C1.7, C1.8)."""

from __future__ import annotations

import asyncio
import functools
import logging
import sys
import threading
from collections.abc import Callable
from typing import Any

import pytest

from actionkit._calls.futures.feedback import (
    KEPT,
    Callbacks,
    LoopCallbacks,
    ThreadCallbacks,
    callbacks_for,
)
from actionkit._calls.futures.feedback_broadcast import FeedbackBroadcast
from actionkit._messages.lazy import LazyMessage, UndecodableError
from actionkit._threads.pool import Pool, in_callback

LONG = 10.0


def message(number: int) -> Callable[[], int]:
    return lambda: number


def test_a_message_is_decoded_once_and_only_when_looked_at() -> None:
    decoded = list[bytes]()

    def decode(message: bytes) -> str:
        decoded.append(message)
        return message.decode()

    look = LazyMessage(decode, b"far")
    assert decoded == []
    assert [look(), look()] == ["far", "far"]
    assert decoded == [b"far"]


def handed_over(callbacks: Callbacks) -> bool:
    done = threading.Event()
    callbacks.finish(done.set)
    return done.wait(LONG)


async def handed_over_async(callbacks: Callbacks) -> None:
    done = asyncio.Event()
    loop = asyncio.get_running_loop()
    callbacks.finish(lambda: loop.call_soon_threadsafe(done.set) and None)
    await asyncio.wait_for(done.wait(), LONG)


# --- on a thread -------------------------------------------------------------------------------


def test_a_function_gets_its_messages_in_order_on_another_thread() -> None:
    got: list[tuple[int, bool, bool]] = []
    here = threading.get_ident()
    callbacks = ThreadCallbacks(
        lambda number: got.append((number, threading.get_ident() != here, in_callback.get())),
        "/a",
        Pool(),
    )
    for number in range(KEPT):
        callbacks.put(message(number))
    assert handed_over(callbacks)
    assert got == [(number, True, True) for number in range(KEPT)]
    assert callbacks.errors == 0


@pytest.mark.parametrize("error", [ValueError, SystemExit, KeyboardInterrupt])
def test_what_a_function_raises_is_logged_and_counted(
    error: type[BaseException], caplog: pytest.LogCaptureFixture
) -> None:
    got: list[int] = []

    def function(number: int) -> None:
        got.append(number)
        raise error("of the user's")

    callbacks = ThreadCallbacks(function, "/fibonacci", Pool())
    for number in range(3):
        callbacks.put(message(number))
    with caplog.at_level(logging.ERROR, "actionkit"):
        assert handed_over(callbacks)
    assert got == [0, 1, 2]
    assert callbacks.errors == 3
    (record, *_) = caplog.records
    assert (record.name, record.levelname) == ("actionkit", "ERROR")
    assert "/fibonacci" in record.getMessage()
    assert "of the user's" in caplog.text
    assert "in function" in caplog.text  # the traceback


def test_a_message_that_cannot_be_decoded_is_an_error_of_the_callback(
    caplog: pytest.LogCaptureFixture,
) -> None:
    callbacks = ThreadCallbacks(print, "/a", Pool())
    callbacks.put(lambda: 1 // 0)
    assert handed_over(callbacks)
    assert callbacks.errors == 1
    assert "ZeroDivisionError" in caplog.text


def test_a_slow_function_misses_the_oldest() -> None:
    entered, leave, got = threading.Event(), threading.Event(), list[int]()

    def function(number: int) -> None:
        entered.set()
        assert leave.wait(LONG)
        got.append(number)

    callbacks = ThreadCallbacks(function, "/a", Pool())
    callbacks.put(message(-1))
    assert entered.wait(LONG)
    for number in range(3 * KEPT):
        callbacks.put(message(number))
    leave.set()
    assert handed_over(callbacks)
    # `finish` is queued behind them, and takes nobody's place.
    assert got == [-1, *range(2 * KEPT, 3 * KEPT)]


# --- on the caller's loop ----------------------------------------------------------------------


def test_a_coroutine_function_is_awaited_in_order_on_the_callers_loop() -> None:
    async def main() -> None:
        got: list[tuple[int, bool, bool]] = []
        here = threading.get_ident()

        async def function(number: int) -> None:
            await asyncio.sleep(0)
            got.append((number, threading.get_ident() == here, in_callback.get()))

        callbacks = LoopCallbacks(function, "/a", Pool(), asyncio.get_running_loop())
        putter = threading.Thread(target=lambda: [callbacks.put(message(n)) for n in range(KEPT)])
        putter.start()
        putter.join()
        await handed_over_async(callbacks)
        assert got == [(number, True, True) for number in range(KEPT)]
        callbacks.put(message(-1))  # it begins anew after it ran dry
        await handed_over_async(callbacks)
        assert got[-1] == (-1, True, True)
        assert not in_callback.get()

    asyncio.run(main())


def test_what_a_coroutine_function_raises_is_logged_and_counted(
    caplog: pytest.LogCaptureFixture,
) -> None:
    async def main() -> None:
        async def function(number: int) -> None:
            raise ValueError(f"message {number}")

        callbacks = LoopCallbacks(function, "/fibonacci", Pool(), asyncio.get_running_loop())
        for number in range(3):
            callbacks.put(message(number))
        await handed_over_async(callbacks)
        assert callbacks.errors == 3

    asyncio.run(main())
    assert "/fibonacci" in caplog.text
    assert "ValueError: message 0" in caplog.text
    assert "ValueError: message 1" not in caplog.text  # from the second on they are counted


def test_a_slow_coroutine_function_misses_the_oldest_and_nothing_after_close() -> None:
    async def main() -> None:
        got: list[int] = []

        async def function(number: int) -> None:
            got.append(number)

        callbacks = LoopCallbacks(function, "/a", Pool(), asyncio.get_running_loop())
        for number in range(3 * KEPT):
            callbacks.put(message(number))
        await handed_over_async(callbacks)
        assert got == list(range(2 * KEPT, 3 * KEPT))
        callbacks.put(message(-1))
        callbacks.close()
        await handed_over_async(callbacks)
        assert got[-1] == 3 * KEPT - 1

    asyncio.run(main())


def closed_loop() -> asyncio.AbstractEventLoop:
    loop = asyncio.new_event_loop()
    loop.close()
    return loop


async def ignore(number: int) -> None:
    raise AssertionError("there is no loop to run it")


def test_a_loop_that_was_closed_is_nobodys_trouble() -> None:
    callbacks = LoopCallbacks(ignore, "/a", Pool(), closed_loop())
    callbacks.put(message(1))
    callbacks.put(message(2))
    assert callbacks.errors == 0


def test_finish_on_a_closed_loop() -> None:
    callbacks, called = LoopCallbacks(ignore, "/a", Pool(), closed_loop()), list[int]()
    callbacks.put(message(1))
    callbacks.finish(lambda: called.append(1))
    assert called == [1]


def test_nothing_is_handed_over_after_close() -> None:
    async def main() -> None:
        got: list[int] = []

        async def function(number: int) -> None:
            got.append(number)

        callbacks = LoopCallbacks(function, "/a", Pool(), asyncio.get_running_loop())
        callbacks.close()
        callbacks.put(message(1))
        await handed_over_async(callbacks)
        assert got == []

    asyncio.run(main())


def test_a_coroutine_function_that_raises_cancelled_error() -> None:
    async def main() -> None:
        got: list[int] = []

        async def function(number: int) -> None:
            got.append(number)
            raise asyncio.CancelledError

        callbacks = LoopCallbacks(function, "/a", Pool(), asyncio.get_running_loop())
        callbacks.put(message(1))
        callbacks.put(message(2))
        for _ in range(10):
            await asyncio.sleep(0)
        # Python 3.10 cannot tell it from the end of the loop.
        assert got == ([1, 2] if sys.version_info >= (3, 11) else [1])

    asyncio.run(main())


# --- which of the two --------------------------------------------------------------------------


class AsyncCallable:
    async def __call__(self, number: int) -> None: ...

    async def method(self, number: int) -> None: ...


async def coroutine_function(number: int) -> None: ...


COROUTINES = [
    coroutine_function,
    AsyncCallable(),
    AsyncCallable().method,
    functools.partial(coroutine_function),
]


@pytest.mark.parametrize("function", [print, len, lambda number: None, functools.partial(print)])
def test_plain_functions_run_on_a_thread(function: Any) -> None:
    assert isinstance(callbacks_for(function, "/a", Pool()), ThreadCallbacks)


@pytest.mark.parametrize("function", COROUTINES)
def test_coroutine_functions_need_a_running_loop(function: Any) -> None:
    with pytest.raises(TypeError, match=r"on_feedback=.* no event loop is running"):
        callbacks_for(function, "/a", Pool())

    async def main() -> Any:
        return callbacks_for(function, "/a", Pool())

    assert isinstance(asyncio.run(main()), LoopCallbacks)


def test_no_callback_and_no_callable() -> None:
    assert callbacks_for(None, "/a", Pool()) is None
    with pytest.raises(TypeError, match=r"on_feedback=3 must be callable"):
        callbacks_for(3, "/a", Pool())  # type: ignore[arg-type]


# --- messages that cannot be decoded -----------------------------------------------------------


def broken(number: int) -> LazyMessage:
    """Return a message that is cut off."""

    def decode(_: bytes) -> Any:
        raise RuntimeError(f"message {number} is cut off")

    return LazyMessage(decode, b"")


def test_a_message_that_cannot_be_decoded_is_left_out(caplog: pytest.LogCaptureFixture) -> None:
    seen = list[int]()
    callbacks = ThreadCallbacks(seen.append, "/fibonacci", Pool())
    broadcast: FeedbackBroadcast[int] = FeedbackBroadcast()
    stream = broadcast.stream()
    for one in (message(1), broken(2), message(3)):
        callbacks.put(one)
        broadcast.put(one)
    broadcast.end()
    assert handed_over(callbacks)
    assert (seen, callbacks.errors) == ([1, 3], 0)
    assert list(stream) == [1, 3]
    assert broadcast.latest == 3
    assert "message 2 is cut off" in caplog.text
    assert "raised" not in caplog.text  # nothing of the user's did


def test_it_is_told_once_however_many_look(caplog: pytest.LogCaptureFixture) -> None:
    broadcast: FeedbackBroadcast[int] = FeedbackBroadcast()
    streams = [broadcast.stream(), broadcast.stream()]
    one = broken(1)
    broadcast.put(one)
    assert broadcast.latest is None
    broadcast.end()
    assert [list(stream) for stream in streams] == [[], []]
    with pytest.raises(UndecodableError, match=r"^message 1 is cut off$"):
        one()
    told = [(record.levelno, record.getMessage()) for record in caplog.records]
    assert told == [(logging.WARNING, "feedback is left out: message 1 is cut off")]


def test_on_an_event_loop_it_is_left_out_too(caplog: pytest.LogCaptureFixture) -> None:
    seen = list[int]()

    async def main() -> int:
        async def note(number: int) -> None:
            seen.append(number)

        broadcast: FeedbackBroadcast[int] = FeedbackBroadcast()
        stream = broadcast.stream()
        callbacks = LoopCallbacks(note, "/fibonacci", Pool(), asyncio.get_running_loop())
        for one in (message(1), broken(2), message(3)):
            callbacks.put(one)
            broadcast.put(one)
        broadcast.end()
        await handed_over_async(callbacks)
        assert [number async for number in stream] == [1, 3]
        return callbacks.errors

    assert asyncio.run(main()) == 0
    assert seen == [1, 3]
    assert "message 2 is cut off" in caplog.text
