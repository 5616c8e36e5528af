"""Jobs that run one after the other: in order, bounded, and never on the thread that puts them."""

from __future__ import annotations

import threading
from collections.abc import Callable

from actionkit._threads.in_hand import Label
from actionkit._threads.pool import Pool, in_callback
from actionkit._threads.serial_queue import SerialQueue

LONG = 10.0  # the bound of a wait that is over at once when all is well
IT = Label("it", None, "the rest")


class Gate:
    """A job that runs until it is let go."""

    def __init__(self) -> None:
        self.entered = threading.Event()
        self.leave = threading.Event()
        self.thread: threading.Thread | None = None

    def __call__(self) -> None:
        self.thread = threading.current_thread()
        self.entered.set()
        assert self.leave.wait(LONG)


def finished(queue: SerialQueue) -> bool:
    """Wait until what is queued has run."""
    done = threading.Event()
    queue.finish(done.set)
    return done.wait(LONG)


def noting(notes: list[int], number: int) -> Callable[[], None]:
    return lambda: notes.append(number)


def test_a_queue_runs_its_jobs_in_order() -> None:
    queue, notes = SerialQueue(Pool(), IT, 10_000), list[int]()
    for number in range(5000):
        queue.put(noting(notes, number))
    assert finished(queue)
    assert notes == list(range(5000))


def test_a_queue_runs_one_job_at_a_time() -> None:
    queue, alone, overlaps = SerialQueue(Pool(), IT, 1000), threading.Lock(), list[int]()

    def job() -> None:
        if not alone.acquire(blocking=False):
            overlaps.append(1)
            return
        alone.release()

    putters = [
        threading.Thread(target=lambda: [queue.put(job) for _ in range(100)]) for _ in range(5)
    ]
    for putter in putters:
        putter.start()
    for putter in putters:
        putter.join()
    assert finished(queue)
    assert overlaps == []


def test_where_the_queue_is_full_the_newest_win() -> None:
    queue, gate, notes = SerialQueue(Pool(), IT, 3), Gate(), list[int]()
    queue.put(gate)
    assert gate.entered.wait(LONG)
    for number in range(10):
        queue.put(noting(notes, number))
    gate.leave.set()
    assert finished(queue)
    assert notes == [7, 8, 9]


def test_finish_waits_for_what_is_queued_and_for_what_runs() -> None:
    queue, gate, notes = SerialQueue(Pool(), IT, 10), Gate(), list[int]()
    done = threading.Event()
    queue.put(gate)
    queue.put(noting(notes, 1))
    assert gate.entered.wait(LONG)
    queue.put(noting(notes, 2))
    queue.finish(done.set)
    assert notes == []
    gate.leave.set()
    assert done.wait(LONG)
    assert notes == [1, 2]


def test_finish_is_at_once_where_nothing_is_queued() -> None:
    queue, notes = SerialQueue(Pool(), IT, 10), list[int]()
    queue.finish(noting(notes, 1))
    assert notes == [1]


def test_a_closed_queue_runs_nothing_more() -> None:
    queue, gate, notes = SerialQueue(Pool(idle=0.01), IT, 10), Gate(), list[int]()
    queue.put(gate)
    queue.put(noting(notes, 1))
    assert gate.entered.wait(LONG)
    queue.close()
    queue.put(noting(notes, 2))
    queue.finish(noting(notes, 3))  # nobody waits for the job that still runs
    assert notes == [3]
    gate.leave.set()
    assert gate.thread is not None
    gate.thread.join(LONG)
    assert notes == [3]


def test_closing_ends_the_wait_for_a_job_that_still_runs() -> None:
    queue, gate, notes = SerialQueue(Pool(), IT, 10), Gate(), list[int]()
    queue.put(gate)
    assert gate.entered.wait(LONG)
    queue.finish(noting(notes, 1))
    assert notes == []
    queue.close()
    gate.leave.set()
    assert notes == [1]


def test_a_queue_can_be_used_again_after_it_ran_dry() -> None:
    queue, notes = SerialQueue(Pool(), IT, 10), list[int]()
    for number in range(50):
        queue.put(noting(notes, number))
        assert finished(queue)
    assert notes == list(range(50))


def test_a_blocked_queue_does_not_block_the_others() -> None:
    pool, gate, notes = Pool(), Gate(), list[int]()
    blocked, free = SerialQueue(pool, IT, 10), SerialQueue(pool, IT, 10)
    blocked.put(gate)
    assert gate.entered.wait(LONG)
    for number in range(10):
        free.put(noting(notes, number))
    assert finished(free)
    assert notes == list(range(10))
    gate.leave.set()


def test_a_job_knows_that_it_is_a_callback() -> None:
    queue, seen = SerialQueue(Pool(), IT, 10), list[bool]()
    queue.put(lambda: seen.append(in_callback.get()))
    assert finished(queue)
    assert seen == [True]
    assert not in_callback.get()
