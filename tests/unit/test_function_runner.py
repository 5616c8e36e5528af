"""Running users' functions on other threads, for a limited time."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import pytest

from actionkit._threads import in_hand
from actionkit._threads.clock import TimerHandle, TimerQueue
from actionkit._threads.function_runner import (
    FunctionRunner,
    NoAnswer,
    described,
    function_pool,
    short_name_of,
)
from actionkit._threads.in_hand import Label
from actionkit._threads.pool import Pool
from tests.conftest import all_is_logged
from tests.unit.gate import Gate

IT = Label("it", None, "the rest")
LONG = 10.0  # the bound of a wait that is over at once when all is well


def refuse(thread: threading.Thread) -> None:
    raise RuntimeError("can't create new thread at interpreter shutdown")


# --- the threads -------------------------------------------------------------------------------


def test_each_function_that_runs_has_a_thread_for_itself() -> None:
    pool, gates = function_pool("/arm"), [Gate() for _ in range(20)]
    for gate in gates:
        assert pool.submit(gate, IT) == ""
    assert pool._threads == 20  # at once
    assert all(gate.entered.wait(LONG) for gate in gates)
    assert len({gate.thread for gate in gates}) == 20
    for gate in gates:
        assert gate.thread is not None
        assert gate.thread.daemon  # it does not hold up the interpreter's exit
        assert gate.thread.name.startswith("actionkit")
        gate.leave.set()


def test_nobody_warns_of_a_function_that_does_not_return(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """The error of its call tells of it."""
    monkeypatch.setattr(in_hand, "WARN_AFTER", 0.0)
    pool, gates = function_pool("/arm"), [Gate() for _ in range(3)]
    for gate in gates:
        pool.submit(gate, IT)
        assert gate.entered.wait(LONG)
    pool.dues.end()
    for gate in gates:
        gate.leave.set()
    assert all_is_logged()
    assert caplog.records == []


def test_where_no_thread_can_be_started_the_pool_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    """As from Python 3.12 on at the interpreter's exit."""
    pool, gate = function_pool("/arm"), Gate()
    monkeypatch.setattr(threading.Thread, "start", refuse)
    assert "can't create new thread" in pool.submit(lambda: None, IT)
    monkeypatch.undo()
    assert pool.submit(gate, IT) == ""
    assert gate.entered.wait(LONG)
    gate.leave.set()


# --- functions ---------------------------------------------------------------------------------


class Thread:
    """A communication thread with the clock and turns of the test."""

    def __init__(self) -> None:
        self.timers = TimerQueue()
        self.soon: list[Callable[[], None]] = []
        self.came = threading.Semaphore(0)
        self.answers: list[Any] = []

    def call_soon(self, callback: Callable[[], None]) -> None:
        self.soon.append(callback)
        self.came.release()

    def call_at(self, at: float, callback: Callable[[], None]) -> TimerHandle:
        return self.timers.arm(at, callback)

    def cancel_timer(self, handle: TimerHandle) -> None:
        self.timers.cancel(handle)

    def turn(self) -> None:
        """Wait for what comes from another thread."""
        assert self.came.acquire(timeout=LONG)
        self.soon.pop(0)()

    def wait_until(self, now: float) -> None:
        while (due := self.timers.pop_due(now)) is not None:
            due()


def test_an_answer_is_brought_back_to_the_thread() -> None:
    thread = Thread()
    runner = FunctionRunner(thread, function_pool("/arm"))
    runner.run(threading.current_thread, 0.0, None, thread.answers.append)
    assert runner.under_way
    thread.turn()
    assert not runner.under_way
    assert thread.answers != [threading.current_thread()]
    assert len(thread.timers) == 0


@pytest.mark.parametrize(
    ("deadline", "latest", "why"),
    [
        (None, 15.0, "did not answer within 10 s"),
        (99.0, 15.0, "did not answer within 10 s"),
        (7.0, 7.0, "did not answer before the call's deadline"),
        (4.0, 4.0, "did not answer before the call's deadline"),
    ],
)
def test_an_answer_is_waited_for_until_the_deadline_or_for_ten_seconds(
    deadline: float | None, latest: float, why: str
) -> None:
    thread, gate = Thread(), Gate()
    runner = FunctionRunner(thread, function_pool("/arm"))
    runner.run(gate, 5.0, deadline, thread.answers.append)
    assert gate.entered.wait(LONG)
    thread.wait_until(latest - 0.01)
    assert thread.answers == []
    thread.wait_until(latest)
    assert thread.answers == [NoAnswer(why)]
    gate.leave.set()
    thread.turn()  # the answer, too late
    assert len(thread.answers) == 1


def test_the_wait_can_be_made_shorter_and_never_longer() -> None:
    thread, gate = Thread(), Gate()
    runner = FunctionRunner(thread, function_pool("/arm"))
    runner.end_by(1.0, "nothing is asked")
    runner.run(gate, 0.0, 8.0, thread.answers.append)
    runner.end_by(9.0, "later")
    runner.end_by(2.0, "sooner")
    runner.end_by(3.0, "later")
    assert len(thread.timers) == 1
    thread.wait_until(2.0)
    assert thread.answers == [NoAnswer("sooner")]
    gate.leave.set()


def test_the_answer_of_a_function_that_was_dropped_does_not_count() -> None:
    thread, gate = Thread(), Gate()
    runner = FunctionRunner(thread, function_pool("/arm"))
    runner.run(gate, 0.0, None, thread.answers.append)
    assert gate.entered.wait(LONG)
    runner.drop()
    assert not runner.under_way
    assert len(thread.timers) == 0
    gate.leave.set()
    thread.turn()
    assert thread.answers == []


def test_a_new_function_takes_the_place_of_the_last() -> None:
    thread, gate = Thread(), Gate()
    runner = FunctionRunner(thread, function_pool("/arm"))
    runner.run(gate, 0.0, None, lambda _: thread.answers.append("first"))
    assert gate.entered.wait(LONG)
    runner.run(lambda: "two", 0.0, None, thread.answers.append)
    thread.turn()
    gate.leave.set()
    thread.turn()
    assert thread.answers == ["two"]


def test_a_function_that_is_dropped_in_time_does_not_run() -> None:
    thread, gate = Thread(), Gate()
    pool = Pool(most=1, idle=0.01)
    pool.submit(gate, IT)
    assert gate.entered.wait(LONG)
    runner, ran = FunctionRunner(thread, pool), list[int]()
    runner.run(lambda: ran.append(1), 0.0, None, thread.answers.append)
    runner.drop()
    gate.leave.set()
    assert gate.thread is not None
    gate.thread.join(LONG)
    assert ran == []


def test_where_no_thread_can_be_started_that_is_the_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threading.Thread, "start", refuse)
    thread = Thread()
    FunctionRunner(thread, function_pool("/arm")).run(lambda: 1, 0.0, None, thread.answers.append)
    assert thread.answers == []  # not before `run` has returned
    thread.turn()
    assert isinstance(thread.answers[0], NoAnswer)
    assert "could not be called" in thread.answers[0].why
    assert "can't create new thread" in thread.answers[0].why


# --- words -------------------------------------------------------------------------------------


def test_functions_are_named_without_running_code_of_the_users() -> None:
    class Judge:
        def __repr__(self) -> str:
            raise AssertionError("not on the communication thread")

        def __getattr__(self, name: str) -> Any:
            raise AssertionError("not on the communication thread")

        def __call__(self) -> None: ...

        def method(self) -> None: ...

    assert short_name_of(refuse) == "refuse"
    assert short_name_of(print) == "print"
    assert short_name_of(Judge()).endswith("Judge")
    assert short_name_of(Judge().method).endswith("Judge.method")


def test_values_are_described_in_one_short_line() -> None:
    assert described(3) == "3"
    assert described(ValueError("it broke.\nBadly")) == "ValueError: it broke. Badly"
    assert described(ValueError()) == "ValueError"
    assert len(described("x" * 10_000)) < 250
    assert described(10**5000) == "a value of type int"
