"""Threads for the user's callables: few, apart from each other, and gone when idle."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Callable

import pytest

from actionkit._threads import diagnostics
from actionkit._threads.in_hand import Label
from actionkit._threads.pool import Pool
from tests.unit.gate import Gate

LONG = 10.0  # the bound of a wait that is over at once when all is well
IT = Label("it", None, "the rest")


def noting(notes: list[int], number: int) -> Callable[[], None]:
    return lambda: notes.append(number)


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


FORKED = """
import os, threading
from actionkit._threads import in_hand, pool

entered, forever = threading.Event(), threading.Event()
it = in_hand.Label('it', None, 'nothing')
pool.Pool().submit(lambda: (entered.set(), forever.wait()), it)
entered.wait()
child = os.fork()
if child == 0:
    in_hand.after_fork()
    own, ran = pool.Pool(), threading.Event()
    own.submit(forever.wait, it)
    own.submit(ran.set, it)
    os._exit(0 if ran.wait(20) else 1)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there is no fork")
def test_the_child_of_a_fork_has_threads_of_its_own() -> None:
    run = [sys.executable, "-W", "ignore::DeprecationWarning", "-c", FORKED]
    assert subprocess.run(run, capture_output=True, timeout=30, check=True).stdout == b"0\n"


# --- closing, and the interpreter's exit (contract C1.10) ---------------------------------------


def test_what_is_due_or_running_is_waited_for() -> None:
    pool, gate, notes = Pool(most=1), Gate(), list[int]()
    pool.submit(gate, IT)
    pool.submit(noting(notes, 1), IT)
    assert gate.entered.wait(LONG)
    threading.Timer(0.05, gate.leave.set).start()
    assert pool.dues.finish(time.monotonic() + LONG)
    assert notes == [1]


def test_the_wait_has_an_end_and_nothing_begins_after_it(caplog: pytest.LogCaptureFixture) -> None:
    pool, gate, notes = Pool("/arm", most=1), Gate(), list[int]()
    pool.submit(gate, Label("done callback", noting, "nothing"))
    pool.submit(noting(notes, 1), IT)
    assert gate.entered.wait(LONG)
    assert not pool.dues.finish(time.monotonic() + 0.01)
    pool.dues.end()
    pool.submit(noting(notes, 2), IT)
    gate.leave.set()
    assert gate.thread is not None
    gate.thread.join(LONG)
    assert notes == []
    diagnostics.flush(time.monotonic() + LONG)
    assert "done callback tests.unit" in caplog.text or "noting of action '/arm'" in caplog.text
    assert caplog.text.count("has not returned") == 1
    assert caplog.text.count("has not begun") == 2
    # Where each stands, if it has begun.
    running, *waiting = [record.stack_info for record in caplog.records]
    assert running is not None
    assert "self.leave.wait(" in running
    assert waiting == [None, None]


def test_callbacks_that_wait_for_the_others_do_not_wait_for_each_other() -> None:
    pool, finished = Pool(), list[bool]()

    def close() -> None:
        both.wait(LONG)
        finished.append(pool.dues.finish(time.monotonic() + LONG))

    both = threading.Barrier(2)
    began = time.monotonic()
    for _ in range(2):
        pool.submit(close, IT)
    assert pool.dues.finish(time.monotonic() + LONG)
    assert finished == [True, True]
    assert time.monotonic() - began < LONG / 2
