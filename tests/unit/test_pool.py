"""Where the user's callables run: in order, apart from each other, and on few threads."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Callable

import pytest

from actionkit._threads.blocked import Label
from actionkit._threads.pool import Pool, Strand, in_callback

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


def finished(strand: Strand) -> bool:
    """Wait until what is queued has run."""
    done = threading.Event()
    strand.finish(done.set)
    return done.wait(LONG)


def noting(notes: list[int], number: int) -> Callable[[], None]:
    return lambda: notes.append(number)


# --- strands -----------------------------------------------------------------------------------


def test_a_strand_runs_its_jobs_in_order() -> None:
    strand, notes = Strand(Pool(), 10_000, IT), list[int]()
    for number in range(5000):
        strand.put(noting(notes, number))
    assert finished(strand)
    assert notes == list(range(5000))
    assert strand.dropped == 0


def test_a_strand_runs_one_job_at_a_time() -> None:
    strand, alone, overlaps = Strand(Pool(), 1000, IT), threading.Lock(), list[int]()

    def job() -> None:
        if not alone.acquire(blocking=False):
            overlaps.append(1)
            return
        alone.release()

    putters = [
        threading.Thread(target=lambda: [strand.put(job) for _ in range(100)]) for _ in range(5)
    ]
    for putter in putters:
        putter.start()
    for putter in putters:
        putter.join()
    assert finished(strand)
    assert overlaps == []


def test_where_the_queue_is_full_the_newest_win() -> None:
    strand, gate, notes = Strand(Pool(), 3, IT), Gate(), list[int]()
    strand.put(gate)
    assert gate.entered.wait(LONG)
    for number in range(10):
        strand.put(noting(notes, number))
    gate.leave.set()
    assert finished(strand)
    assert notes == [7, 8, 9]
    assert strand.dropped == 7


def test_finish_waits_for_what_is_queued_and_for_what_runs() -> None:
    strand, gate, notes = Strand(Pool(), 10, IT), Gate(), list[int]()
    done = threading.Event()
    strand.put(gate)
    strand.put(noting(notes, 1))
    assert gate.entered.wait(LONG)
    strand.put(noting(notes, 2))
    strand.finish(done.set)
    assert notes == []
    gate.leave.set()
    assert done.wait(LONG)
    assert notes == [1, 2]


def test_finish_is_at_once_where_nothing_is_queued() -> None:
    strand, notes = Strand(Pool(), 10, IT), list[int]()
    strand.finish(noting(notes, 1))
    assert notes == [1]


def test_a_closed_strand_runs_nothing_more() -> None:
    strand, gate, notes = Strand(Pool(idle=0.01), 10, IT), Gate(), list[int]()
    strand.put(gate)
    strand.put(noting(notes, 1))
    assert gate.entered.wait(LONG)
    strand.close()
    strand.put(noting(notes, 2))
    strand.finish(noting(notes, 3))  # nobody waits for the job that still runs
    assert notes == [3]
    gate.leave.set()
    assert gate.thread is not None
    gate.thread.join(LONG)
    assert notes == [3]


def test_a_strand_can_be_used_again_after_it_ran_dry() -> None:
    strand, notes = Strand(Pool(), 10, IT), list[int]()
    for number in range(50):
        strand.put(noting(notes, number))
        assert finished(strand)
    assert notes == list(range(50))


def test_a_blocked_strand_does_not_block_the_others() -> None:
    pool, gate, notes = Pool(), Gate(), list[int]()
    blocked, free = Strand(pool, 10, IT), Strand(pool, 10, IT)
    blocked.put(gate)
    assert gate.entered.wait(LONG)
    for number in range(10):
        free.put(noting(notes, number))
    assert finished(free)
    assert notes == list(range(10))
    gate.leave.set()


# --- the pool ----------------------------------------------------------------------------------


def test_a_pool_has_as_many_threads_as_it_needs_and_no_more() -> None:
    pool, gates = Pool(most=3, idle=0.01), [Gate() for _ in range(5)]
    for gate in gates:
        pool.submit(gate, IT)
    for gate in gates[:3]:
        assert gate.entered.wait(LONG)
    assert not gates[3].entered.is_set()
    gates[0].leave.set()
    assert gates[3].entered.wait(LONG)
    assert gates[3].thread is gates[0].thread
    for gate in gates:
        gate.leave.set()
    assert gates[4].entered.wait(LONG)
    for gate in gates:
        assert gate.thread is not None
        gate.thread.join(LONG)
        assert not gate.thread.is_alive()  # they go when there is nothing to do


def test_a_pool_comes_back_after_its_threads_have_gone() -> None:
    pool = Pool(most=2, idle=0.0)
    for _ in range(20):
        gate = Gate()
        gate.leave.set()
        pool.submit(gate, IT)
        assert gate.entered.wait(LONG)
        assert gate.thread is not None
        gate.thread.join(LONG)
        assert not gate.thread.is_alive()


def test_an_idle_thread_is_used_again() -> None:
    pool, threads = Pool(most=8, idle=LONG), set[threading.Thread]()
    for _ in range(100):
        gate = Gate()
        gate.leave.set()
        pool.submit(gate, IT)
        assert gate.entered.wait(LONG)
        assert gate.thread is not None
        threads.add(gate.thread)
    assert len(threads) <= 2  # one that is about to be idle, and one that came meanwhile


def test_jobs_that_come_together_do_not_wait_for_the_same_idle_thread() -> None:
    pool, first, second = Pool(most=8, idle=LONG), Gate(), Gate()
    pool.submit(lambda: None, IT)
    for _ in range(10_000):  # nothing tells that a thread is idle, so look inside
        if not pool._free:
            threading.Event().wait(0.001)
    assert pool._free == 1
    pool.submit(first, IT)
    pool.submit(second, IT)
    assert first.entered.wait(LONG)
    assert second.entered.wait(LONG)
    first.leave.set()
    second.leave.set()


def test_no_job_is_lost_between_threads_that_come_and_go() -> None:
    pool, done = Pool(most=4, idle=0.0), threading.Semaphore(0)
    for _ in range(3000):
        pool.submit(done.release, IT)
    for _ in range(3000):
        assert done.acquire(timeout=LONG)


def test_where_no_thread_can_be_started_the_job_waits_for_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As from Python 3.12 on at the interpreter's exit; what rests on it goes on."""
    pool, gate, notes = Pool(most=8, idle=0.0), Gate(), list[int]()
    pool.submit(gate, IT)
    assert gate.entered.wait(LONG)

    def refuse(thread: threading.Thread) -> None:
        raise RuntimeError("can't create new thread at interpreter shutdown")

    monkeypatch.setattr(threading.Thread, "start", refuse)
    pool.submit(noting(notes, 1), IT)
    monkeypatch.undo()
    assert notes == []
    gate.leave.set()
    assert gate.thread is not None
    gate.thread.join(LONG)
    assert notes == [1]
    assert pool._threads == 0


def test_threads_do_not_hold_up_the_end_of_the_interpreter() -> None:
    gate = Gate()
    Pool().submit(gate, IT)
    assert gate.entered.wait(LONG)
    assert gate.thread is not None
    assert gate.thread.daemon
    assert gate.thread.name.startswith("actionkit")
    gate.leave.set()


def test_a_job_knows_that_it_is_a_callback() -> None:
    strand, seen = Strand(Pool(), 10, IT), list[bool]()
    strand.put(lambda: seen.append(in_callback.get()))
    assert finished(strand)
    assert seen == [True]
    assert not in_callback.get()


FORKED = """
import os, threading
from actionkit._threads import blocked as _blocked, pool as _delivery

entered, forever = threading.Event(), threading.Event()
it = _blocked.Label('it', None, 'nothing')
_delivery.Pool().submit(lambda: (entered.set(), forever.wait()), it)
entered.wait()
child = os.fork()
if child == 0:
    _blocked.after_fork()
    pool, ran = _delivery.Pool(most=1), threading.Event()
    pool.submit(forever.wait, it)
    pool.submit(ran.set, it)  # once the watcher of this process has seen that the first blocks
    os._exit(0 if ran.wait(20) else 1)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there is no fork")
def test_the_child_of_a_fork_has_threads_of_its_own() -> None:
    run = [sys.executable, "-W", "ignore::DeprecationWarning", "-c", FORKED]
    assert subprocess.run(run, capture_output=True, timeout=30, check=True).stdout == b"0\n"
