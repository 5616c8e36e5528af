"""The feedback of a call for its readers, blocking and on event loops (C1.7)."""

from __future__ import annotations

import asyncio
import gc
import threading
from collections.abc import Callable
from typing import Any

from call_life import CallLife

from actionkit import GoalState
from actionkit._calls.futures.feedback import KEPT
from actionkit._calls.futures.feedback_broadcast import FeedbackBroadcast, FeedbackStream

LONG = 10.0


def message(number: int) -> Callable[[], int]:
    return lambda: number


def broadcast_of(*numbers: int) -> FeedbackBroadcast[int]:
    broadcast: FeedbackBroadcast[int] = FeedbackBroadcast()
    for number in numbers:
        broadcast.put(message(number))
    return broadcast


class Reader(threading.Thread):
    """Reads a stream to its end."""

    def __init__(self, stream: FeedbackStream[Any]) -> None:
        super().__init__(daemon=True)
        self.got: list[Any] = []
        self.first = threading.Event()
        self._stream = stream
        self.start()

    def run(self) -> None:
        for number in self._stream:
            self.got.append(number)
            self.first.set()

    def result(self) -> list[Any]:
        self.join(LONG)
        assert not self.is_alive()
        return self.got


async def read(stream: FeedbackStream[int]) -> list[int]:
    return [number async for number in stream]


def test_the_latest_and_the_count() -> None:
    broadcast = broadcast_of()
    assert (broadcast.latest, broadcast.count) == (None, 0)
    broadcast = broadcast_of(1, 2)
    broadcast.end()
    assert (broadcast.latest, broadcast.count) == (2, 2)


def test_a_call_shows_acceptance_before_feedback_and_its_end_ends_its_readers() -> None:
    life = CallLife()
    life.happens("ready")
    life.happens("feedback", 0)  # before the server's answer
    states = [event.state.name for event in life.call.future.timeline]
    assert states == ["SENDING", "SENT", "ACCEPTED", "EXECUTING", "FEEDBACK", "FEEDBACK"]
    reader = Reader(life.call.future.feedback())
    life.happens("result", 0, GoalState.SUCCEEDED)
    assert reader.result() == [b""]


def test_readers_that_are_left_early_are_let_go() -> None:
    broadcast = broadcast_of(1)

    async def leave() -> None:
        async for _ in broadcast.stream():
            break

    for _ in broadcast.stream():
        break
    asyncio.run(leave())
    gc.collect()
    assert broadcast._streams == []
    broadcast.put(message(2))
    broadcast.end()


def test_readers_get_what_comes_from_the_newest_so_far_until_the_end() -> None:
    broadcast = broadcast_of(1, 2)
    readers = [Reader(broadcast.stream()) for _ in range(3)]
    broadcast.put(message(3))
    late = Reader(broadcast.stream())
    broadcast.put(message(4))
    broadcast.end()
    assert [reader.result() for reader in readers] == [[2, 3, 4]] * 3
    assert late.result() == [3, 4]
    assert Reader(broadcast.stream()).result() == [4]


def test_a_reader_that_waits_is_woken() -> None:
    broadcast = broadcast_of()
    reader = Reader(broadcast.stream())
    broadcast.put(message(1))
    assert reader.first.wait(LONG)
    broadcast.end()
    assert reader.result() == [1]


def test_a_reader_that_is_far_behind_misses_the_oldest() -> None:
    broadcast = broadcast_of()
    stream = broadcast.stream()
    for number in range(3 * KEPT):
        broadcast.put(message(number))
    broadcast.end()
    assert Reader(stream).result() == list(range(2 * KEPT, 3 * KEPT))


def test_messages_are_decoded_by_whoever_reads_them() -> None:
    threads: list[int] = []
    broadcast = broadcast_of()
    stream = broadcast.stream()
    broadcast.put(lambda: threads.append(threading.get_ident()) or 1)
    assert threads == []
    broadcast.end()
    reader = Reader(stream)
    assert reader.result() == [1]
    assert threads == [reader.ident]


def test_streams_on_an_event_loop() -> None:
    async def main() -> None:
        broadcast = broadcast_of(1)
        readers = [asyncio.create_task(read(broadcast.stream())) for _ in range(3)]
        await asyncio.sleep(0)  # they wait now
        feeder = threading.Thread(
            target=lambda: [broadcast.put(message(n)) for n in range(2, KEPT)]
        )
        feeder.start()
        await asyncio.get_running_loop().run_in_executor(None, feeder.join)
        broadcast.end()
        for reader in readers:
            assert await asyncio.wait_for(reader, LONG) == list(range(1, KEPT))
        assert await asyncio.wait_for(read(broadcast.stream()), LONG) == [KEPT - 1]

    asyncio.run(main())


def test_a_stream_on_an_event_loop_is_bounded_too() -> None:
    async def main() -> None:
        broadcast = broadcast_of()
        stream = broadcast.stream()
        for number in range(3 * KEPT):
            broadcast.put(message(number))
        broadcast.end()
        assert await read(stream) == list(range(2 * KEPT, 3 * KEPT))

    asyncio.run(main())


def test_the_end_wakes_a_reader_on_an_event_loop() -> None:
    async def main() -> None:
        broadcast = broadcast_of()
        reader = asyncio.create_task(read(broadcast.stream()))
        await asyncio.sleep(0)
        threading.Thread(target=broadcast.end).start()
        assert await asyncio.wait_for(reader, LONG) == []

    asyncio.run(main())


def test_a_reader_whose_loop_was_closed_troubles_nobody() -> None:
    broadcast = broadcast_of()
    stream = broadcast.stream()
    loop = asyncio.new_event_loop()
    task = loop.create_task(read(stream))
    loop.run_until_complete(asyncio.sleep(0))
    task.cancel()
    loop.run_until_complete(asyncio.wait([task]))
    loop.close()
    broadcast.put(message(1))
    broadcast.end()
    assert broadcast.latest == 1


def test_a_reader_that_was_cancelled_can_go_on() -> None:
    async def main() -> None:
        troubles: list[object] = []
        asyncio.get_running_loop().set_exception_handler(lambda _, what: troubles.append(what))
        broadcast = broadcast_of()
        stream = broadcast.stream()
        reader = asyncio.create_task(read(stream))
        await asyncio.sleep(0)
        reader.cancel()
        await asyncio.wait([reader])
        broadcast.put(message(1))
        broadcast.end()
        assert await asyncio.wait_for(read(stream), LONG) == [1]
        await asyncio.sleep(0)
        assert troubles == []

    asyncio.run(main())
