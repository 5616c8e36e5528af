"""Items that are handled one after the other: in order, and never by the thread that puts them."""

from __future__ import annotations

import threading
from collections.abc import Callable

from actionkit._threads.in_hand import Label
from actionkit._threads.pool import Pool, in_callback
from actionkit._threads.serial_queue import SerialQueue
from tests.unit.gate import Gate

LONG = 10.0  # the bound of a wait that is over at once when all is well


class Jobs(SerialQueue[Callable[[], object]]):
    """Functions that a pool calls."""

    label = Label("it", None, "the rest")

    def __init__(self, most: int | None = None, pool: Pool | None = None) -> None:
        super().__init__(most)
        self._pool = pool or Pool()

    def _begin(self) -> None:
        self._pool.run(self)

    def step(self) -> bool:
        job = self._take()
        if job is not None:
            job()
        return job is not None


def finished(queue: Jobs) -> bool:
    """Wait until what is queued has run."""
    done = threading.Event()
    queue.finish(done.set)
    return done.wait(LONG)


def noting(notes: list[int], number: int) -> Callable[[], None]:
    return lambda: notes.append(number)


def test_a_queue_runs_its_jobs_in_order() -> None:
    queue, notes = Jobs(), list[int]()
    for number in range(5000):
        queue.put(noting(notes, number))
    assert finished(queue)
    assert notes == list(range(5000))


def test_a_queue_runs_one_job_at_a_time_and_loses_none() -> None:
    queue, alone, overlaps, done = Jobs(), threading.Lock(), list[int](), list[int]()

    def job() -> None:
        if not alone.acquire(blocking=False):
            overlaps.append(1)
            return
        done.append(1)
        alone.release()

    putters = [
        threading.Thread(target=lambda: [queue.put(job) for _ in range(500)]) for _ in range(5)
    ]
    for putter in putters:
        putter.start()
    for putter in putters:
        putter.join()
    assert finished(queue)
    assert overlaps == []
    assert len(done) == 2500


def test_where_the_queue_is_full_the_newest_win() -> None:
    queue, gate, notes = Jobs(3), Gate(), list[int]()
    queue.put(gate)
    assert gate.entered.wait(LONG)
    for number in range(10):
        queue.put(noting(notes, number))
    gate.leave.set()
    assert finished(queue)
    assert notes == [7, 8, 9]


def test_finish_waits_for_what_is_queued_and_for_what_runs() -> None:
    queue, gate, notes = Jobs(), Gate(), list[int]()
    done = threading.Event()
    queue.put(gate)
    queue.put(noting(notes, 1))
    assert gate.entered.wait(LONG)
    queue.finish(done.set)
    queue.put(noting(notes, 2))
    assert notes == []
    gate.leave.set()
    assert done.wait(LONG)
    assert notes == [1, 2]


def test_finish_is_at_once_where_nothing_is_queued() -> None:
    queue, notes = Jobs(), list[int]()
    queue.finish(noting(notes, 1))
    assert notes == [1]


def test_finish_waits_for_what_was_put_while_an_earlier_one_was_called() -> None:
    queue, notes, done = Jobs(), list[int](), threading.Event()

    def then() -> None:
        queue.put(noting(notes, 1))
        queue.finish(lambda: (notes.append(2), done.set()))

    queue.finish(then)
    assert done.wait(LONG)
    assert notes == [1, 2]


def test_what_comes_just_as_a_queue_runs_dry_is_not_forgotten() -> None:
    queue, notes = Jobs(), list[int]()
    for number in range(500):
        queue.put(noting(notes, number))
        assert finished(queue)
    assert notes == list(range(500))


def test_a_blocked_queue_does_not_block_the_others() -> None:
    pool, gate, notes = Pool(), Gate(), list[int]()
    blocked, free = Jobs(pool=pool), Jobs(pool=pool)
    blocked.put(gate)
    assert gate.entered.wait(LONG)
    for number in range(10):
        free.put(noting(notes, number))
    assert finished(free)
    assert notes == list(range(10))
    gate.leave.set()


def test_a_job_knows_that_it_is_a_callback() -> None:
    queue, seen = Jobs(), list[bool]()
    queue.put(lambda: seen.append(in_callback.get()))
    assert finished(queue)
    assert seen == [True]
    assert not in_callback.get()
