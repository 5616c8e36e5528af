"""Callbacks that run for long hold up no others, and the log names them when more comes (C1.8)."""

from __future__ import annotations

import functools
import threading
import time
from collections.abc import Callable, Iterator

import pytest

from actionkit._threads import in_hand
from actionkit._threads import pool as pool_module
from actionkit._threads.in_hand import WARN_AFTER, Dues, InHand, Label, name_of
from actionkit._threads.pool import Pool
from actionkit._threads.serial_queue import SerialQueue
from tests.conftest import NEVER, all_is_logged

LONG = 20.0
NOW = 1000.0


class Gate:
    """A callback that runs until it is let go."""

    def __init__(self) -> None:
        self.entered, self.leave = threading.Event(), threading.Event()

    def __call__(self) -> None:
        self.entered.set()
        assert self.leave.wait(LONG)


@pytest.fixture
def gates() -> Iterator[list[Gate]]:
    gates: list[Gate] = []
    yield gates
    for gate in gates:
        gate.leave.set()


def blocked_in(pool: Pool, count: int, gates: list[Gate]) -> None:
    new = [Gate() for _ in range(count)]
    gates += new
    for gate in new:
        pool.submit(gate, IT)
    for gate in new:
        assert gate.entered.wait(LONG)


def user_function() -> None:
    """Stands for a callback of the user's."""


IT = Label("on_feedback", user_function, "the further feedback of its goal")


# --- who is named ------------------------------------------------------------------------------


@pytest.fixture
def dues() -> Dues:
    return Dues("/fibonacci", awaited=False)


def running(dues: Dues, since: float) -> InHand:
    """Return what runs on this thread since then."""
    due = dues.begin(IT)
    due.thread, due.since = threading.get_ident(), since
    return due


def named(caplog: pytest.LogCaptureFixture) -> int:
    assert all_is_logged()
    return len(caplog.records)


def test_it_is_named_once_with_its_place(dues: Dues, caplog: pytest.LogCaptureFixture) -> None:
    running(dues, since=NOW)
    dues.look(NOW + WARN_AFTER - 0.01)
    assert named(caplog) == 0
    dues.look(NOW + WARN_AFTER)
    for later in (0.1, 1.0, 100.0, 10_000.0):
        dues.look(NOW + WARN_AFTER + later)
    assert named(caplog) == 1
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


def test_each_callback_of_a_long_queue_counts_for_itself(
    gates: list[Gate], caplog: pytest.LogCaptureFixture
) -> None:
    pool = Pool("/fibonacci", idle=0.0)
    first, second = Gate(), Gate()
    gates += [first, second]
    SerialQueue(pool, IT, 10).put(first, second)
    assert first.entered.wait(LONG)
    (due,) = pool.dues._in_hand
    began = due.since
    first.leave.set()
    assert second.entered.wait(LONG)
    assert due.since > began
    pool.dues.look((began + due.since) / 2 + WARN_AFTER)
    assert named(caplog) == 0
    pool.dues.look(due.since + 1.001 * WARN_AFTER)
    assert named(caplog) == 1


def test_each_is_named_at_the_first_look_after_its_time(
    dues: Dues, caplog: pytest.LogCaptureFixture
) -> None:
    """Most looks end at once, because nothing can have been running for long by then."""
    dues.look(NOW)
    for number in range(5):
        running(dues, since=NOW + number)
        dues.look(NOW + number)
    for number in range(5):
        dues.look(NOW + number + WARN_AFTER)
        assert named(caplog) == number + 1


def test_what_waits_or_has_returned_is_not_named(
    dues: Dues, caplog: pytest.LogCaptureFixture
) -> None:
    dues.begin(IT)
    dues.done(running(dues, since=NOW))
    dues.look(NOW + 2 * WARN_AFTER)
    assert named(caplog) == 0


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


# --- when --------------------------------------------------------------------------------------


@pytest.fixture
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever runs has been running for long."""
    monkeypatch.setattr(in_hand, "WARN_AFTER", 0.0)


@pytest.mark.usefixtures("at_once")
def test_another_callback_of_the_client_is_the_time(
    gates: list[Gate], caplog: pytest.LogCaptureFixture
) -> None:
    pool = Pool("/fibonacci", idle=0.0)
    blocked_in(pool, 1, gates)
    assert named(caplog) == 0
    pool.submit(lambda: None, IT)
    assert named(caplog) == 1
    assert "self.leave.wait(" in (caplog.records[0].stack_info or "")


@pytest.mark.usefixtures("at_once")
def test_the_next_of_its_queue_is_too(gates: list[Gate], caplog: pytest.LogCaptureFixture) -> None:
    queue, gate = SerialQueue(Pool("/fibonacci", idle=0.0), IT, 10), Gate()
    gates.append(gate)
    queue.put(gate)
    assert gate.entered.wait(LONG)
    assert named(caplog) == 0
    queue.put(lambda: None)
    assert named(caplog) == 1


# --- threads -----------------------------------------------------------------------------------


def comes_true(condition: Callable[[], bool]) -> bool:
    """Wait for what nothing tells of."""
    until = time.monotonic() + LONG
    while not condition():
        if time.monotonic() > until:
            return False
        NEVER.wait(0.005)
    return True


def test_callbacks_that_compute_get_no_more_than_a_few_threads(
    gates: list[Gate], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each further one would take the communication thread's turns."""
    monkeypatch.setattr(pool_module, "_LOOK", 0.001)
    pool, waiting = Pool("/fibonacci", busy=2, idle=0.0), Gate()
    blocked_in(pool, 2, gates)
    looks = counted(pool, monkeypatch)
    gates.append(waiting)
    pool.submit(waiting, IT)
    pool.submit(lambda: None, IT)
    for _ in range(20):
        assert looks.acquire(timeout=LONG)
    assert not waiting.entered.is_set()
    assert pool._threads == 3  # the two, and a spare one
    gates[0].leave.set()
    assert waiting.entered.wait(LONG)
    for gate in gates:
        gate.leave.set()
    assert comes_true(lambda: not pool._threads)
    assert (pool._free, pool._has_spare) == (0, False)


def counted(pool: Pool, monkeypatch: pytest.MonkeyPatch) -> threading.Semaphore:
    """Count the looks of the spare thread."""
    looks, real = threading.Semaphore(0), pool.dues.running_for

    def look(seconds: float) -> int:
        looks.release()
        return real(seconds)

    monkeypatch.setattr(pool.dues, "running_for", look)
    return looks


def test_blocked_threads_are_replaced_up_to_a_limit(gates: list[Gate]) -> None:
    pool = Pool("/fibonacci", busy=2, most=5, idle=0.0)
    blocked_in(pool, 5, gates)  # two, two more after a second, and so on
    queue, notes, done = SerialQueue(pool, IT, 10), list[int](), threading.Event()
    queue.put(lambda: notes.append(1))
    queue.finish(done.set)
    assert comes_true(lambda: pool.dues.running_for(pool_module.BLOCKED_AFTER) == 5)
    assert notes == []
    assert pool._threads == 5
    gates[2].leave.set()
    assert done.wait(LONG)
    assert notes == [1]
    for gate in gates:
        gate.leave.set()
    assert comes_true(lambda: not pool._threads)
    assert (pool._free, pool._has_spare) == (0, False)


def test_who_comes_back_is_one_too_many_and_goes(gates: list[Gate]) -> None:
    pool = Pool("/fibonacci", busy=1, idle=10 * LONG)
    blocked_in(pool, 1, gates)
    blocked_in(pool, 1, gates)  # on a thread that took the place of the first
    gates[1].leave.set()
    assert comes_true(lambda: pool._free == 1)
    gates[0].leave.set()
    assert comes_true(lambda: pool._threads == 1)  # it does not wait for work as the other does
    pool._idle_seconds = 0.0
    pool.submit(lambda: None, IT)
    assert comes_true(lambda: not pool._threads)


def test_a_job_is_followed_by_the_next_of_its_queue_however_long_it_took(
    gates: list[Gate],
) -> None:
    pool, gate, notes = Pool("/fibonacci", busy=1, idle=0.0), Gate(), list[int]()
    gates.append(gate)
    queue = SerialQueue(pool, IT, 10)
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


def test_a_spare_thread_that_cannot_start_is_tried_again(
    gates: list[Gate], monkeypatch: pytest.MonkeyPatch
) -> None:
    pool, late = Pool("/fibonacci", busy=1, idle=0.0), Gate()
    blocked_in(pool, 1, gates)
    gates.append(late)

    def refuse(thread: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    with monkeypatch.context() as patch:
        patch.setattr(threading.Thread, "start", refuse)
        assert "can't start" in pool.submit(late, IT)
    assert pool.submit(lambda: None, IT) == ""
    assert late.entered.wait(LONG)
