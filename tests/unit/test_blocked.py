"""Callbacks that do not return: their threads are replaced, and the log names them."""

from __future__ import annotations

import functools
import threading
import time
from collections.abc import Callable

import pytest

from actionkit._threads import blocked as _blocked
from actionkit._threads.blocked import (
    BLOCKED_AFTER,
    WARN_AFTER,
    Label,
    Turn,
    Worker,
    look_at,
    name_of,
)
from actionkit._threads.pool import Pool
from actionkit._threads.serial_queue import SerialQueue
from tests.conftest import NEVER, all_is_logged

LONG = 20.0


def comes_true(condition: Callable[[], bool]) -> bool:
    """Wait for what nothing tells of."""
    until = time.monotonic() + LONG
    while not condition():
        if time.monotonic() > until:
            return False
        NEVER.wait(0.005)
    return True


class Once:
    """Work that the tests do by hand."""

    def __init__(self, label: Label) -> None:
        self.label = label

    def step(self) -> bool:
        return False


class Gate:
    """A callback that runs until it is let go."""

    def __init__(self) -> None:
        self.entered, self.leave = threading.Event(), threading.Event()
        self.thread: threading.Thread | None = None

    def __call__(self) -> None:
        self.thread = threading.current_thread()
        self.entered.set()
        assert self.leave.wait(LONG)


def user_function() -> None:
    """Stands for a callback of the user's."""


IT = Label("on_feedback", user_function, "the further feedback of its goal")


# --- looking at one thread ---------------------------------------------------------------------


def made() -> tuple[Worker, list[Turn]]:
    replaced: list[Turn] = []

    def replace(worker: Worker, turn: Turn) -> None:
        worker.replaced = turn
        replaced.append(turn)

    return Worker("/fibonacci", replace), replaced


def test_a_thread_is_replaced_after_a_second_and_once() -> None:
    worker, replaced = made()
    look_at(worker, time.monotonic() + 100)
    assert replaced == []  # it does nothing
    worker.begin(Once(IT))
    assert worker.turn is not None
    since = worker.turn[1]
    look_at(worker, since + BLOCKED_AFTER / 2)
    assert replaced == []
    for later in (1.0, 2.0, 3.0):
        look_at(worker, since + BLOCKED_AFTER * later)
    assert replaced == [worker.turn]


def test_each_callback_of_a_long_queue_counts_for_itself() -> None:
    worker, replaced = made()
    work = Once(IT)
    for _ in range(3):
        worker.begin(work)
        assert worker.turn is not None
        look_at(worker, worker.turn[1] + BLOCKED_AFTER / 2)
        worker.end()
    assert replaced == []


def test_it_is_named_once_with_its_place_and_again_when_it_returns(
    caplog: pytest.LogCaptureFixture,
) -> None:
    worker, _ = made()
    worker.begin(Once(IT))
    assert worker.turn is not None
    since = worker.turn[1]
    for later in (0.5, 1.0, 1.5, 10.0):
        look_at(worker, since + WARN_AFTER * later)
    assert all_is_logged()
    (warning,) = caplog.records
    assert (warning.name, warning.levelname) == ("actionkit", "WARNING")
    text = warning.getMessage()
    assert text.startswith(
        f"on_feedback {__name__}.user_function of action '/fibonacci' was called at "
    )
    assert ", 5 s ago, and has not returned" in text
    assert "it holds up the further feedback of its goal" in text
    # This very test is what the thread is doing.
    assert warning.stack_info is not None
    assert "test_it_is_named_once_with_its_place" in warning.stack_info
    worker.end()
    worker.begin(Once(IT))
    worker.end()
    assert all_is_logged()
    (_, returned) = caplog.records
    assert "has returned after" in returned.getMessage()
    assert returned.levelname == "WARNING"


class Callable_:
    def __call__(self) -> None: ...

    def method(self) -> None: ...

    def __repr__(self) -> str:
        raise AssertionError("nothing of the user's is run")


@pytest.mark.parametrize(
    ("function", "name"),
    [
        (user_function, "user_function"),
        (functools.partial(functools.partial(user_function), 1), "user_function"),
        (Callable_(), "Callable_"),
        (Callable_().method, "Callable_.method"),
        (Callable_, "Callable_"),
        (print, "builtins.print"),
        ([].append, "list.append"),
        (lambda: None, "<lambda>"),
    ],
)
def test_callables_go_by_their_names_in_the_source(
    function: Callable[..., object], name: str
) -> None:
    assert name_of(function) in (name, f"{__name__}.{name}")


# --- pools -------------------------------------------------------------------------------------


def blocked_in(pool: Pool, count: int) -> list[Gate]:
    gates = [Gate() for _ in range(count)]
    for gate in gates:
        pool.submit(gate, IT)
    return gates


def let_go(gates: list[Gate]) -> None:
    for gate in gates:
        gate.leave.set()
    for gate in gates:
        if gate.thread is not None:
            gate.thread.join(LONG)


def test_blocked_threads_are_replaced_up_to_a_limit(caplog: pytest.LogCaptureFixture) -> None:
    pool = Pool("/fibonacci", most=2, limit=5, idle=0.05)
    gates = blocked_in(pool, 5)
    for gate in gates:  # two, two more after a second, and so on
        assert gate.entered.wait(LONG)
    queue, notes = SerialQueue(pool, IT, 10), list[int]()
    queue.put(lambda: notes.append(1))
    assert comes_true(lambda: pool._warned_of_limit)  # when all of them have blocked for a second
    assert notes == []
    gates[0].leave.set()
    done = threading.Event()
    queue.finish(done.set)
    assert done.wait(LONG)
    assert notes == [1]
    let_go(gates)
    assert all_is_logged()
    full = [r.getMessage() for r in caplog.records if "no more threads" in r.getMessage()]
    assert len(full) == 1
    assert "callbacks of a client of action '/fibonacci' do not return" in full[0]
    assert comes_true(lambda: not pool._threads)
    assert (pool._blocked, pool._free) == (0, 0)


def test_who_comes_back_is_one_too_many_and_goes() -> None:
    pool, other = Pool("/fibonacci", most=1, idle=LONG), Gate()
    (gate,) = blocked_in(pool, 1)
    assert gate.entered.wait(LONG)
    other.leave.set()
    pool.submit(other, IT)
    assert other.entered.wait(LONG)  # on a thread that took the place of the first
    let_go([gate])
    assert gate.thread is not None
    assert not gate.thread.is_alive()  # it does not wait for work as the other does
    assert (pool._threads, pool._blocked) == (1, 0)
    end_of(pool)


def end_of(pool: Pool) -> None:
    """Have an idle thread of a pool end at once, or it would be seen by other tests."""
    pool._idle_seconds = 0.0
    pool.submit(lambda: None, IT)
    assert comes_true(lambda: not pool._threads)


def test_a_job_is_followed_by_the_next_of_its_queue_however_long_it_took() -> None:
    pool = Pool("/fibonacci", most=1)
    queue, gate, notes = SerialQueue(pool, IT, 10), Gate(), list[int]()
    queue.put(gate)
    assert gate.entered.wait(LONG)
    for number in range(3):
        queue.put(lambda n=number: notes.append(n))  # type: ignore[misc]
    other = threading.Event()
    pool.submit(other.set, IT)
    assert other.wait(LONG)  # on a thread that took the place of the first
    assert notes == []
    done = threading.Event()
    queue.finish(done.set)
    gate.leave.set()
    assert done.wait(LONG)
    assert notes == [0, 1, 2]


def test_a_job_that_returns_just_when_it_is_given_up_counts_again() -> None:
    pool = Pool("/fibonacci")
    worker = Worker("/fibonacci", pool._replace)
    worker.begin(Once(IT))
    turn = worker.turn
    assert turn is not None
    worker.end()
    pool._replace(worker, turn)
    assert (pool._blocked, worker.replaced) == (0, None)


def watchers() -> int:
    return [thread.name for thread in threading.enumerate()].count("actionkit-watcher")


def test_the_watcher_is_there_only_while_callback_threads_are() -> None:
    assert comes_true(lambda: watchers() == 0)  # when the threads of earlier tests have ended
    gates = [gate for _ in range(3) for gate in blocked_in(Pool("/fibonacci", idle=0.0), 1)]
    for gate in gates:
        assert gate.entered.wait(LONG)
    assert watchers() == 1
    let_go(gates)
    assert comes_true(lambda: watchers() == 0)


def test_the_watcher_survives_an_error_of_its_own(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    worker, _ = made()

    def fail(worker: Worker, now: float) -> None:
        raise ValueError("ours")

    monkeypatch.setattr(_blocked, "look_at", fail)
    _blocked._look_at_all([worker, worker])
    assert all_is_logged()
    assert ["ActionKit itself" in r.getMessage() for r in caplog.records] == [True, True]
