"""Asking functions of the user's off the communication thread, for a limited time."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import pytest

from actionkit._threads.asking import Asking, Threads, Unanswered, described, name_of
from actionkit._threads.clock import TimerHandle, TimerQueue
from actionkit._threads.pool import in_callback

LONG = 10.0  # the bound of a wait that is over at once when all is well


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


def refuse(thread: threading.Thread) -> None:
    raise RuntimeError("can't create new thread at interpreter shutdown")


# --- the threads -------------------------------------------------------------------------------


def test_each_job_that_runs_has_a_thread_for_itself() -> None:
    threads, gates = Threads(), [Gate() for _ in range(20)]
    for gate in gates:
        assert threads.run(gate) == ""
    assert all(gate.entered.wait(LONG) for gate in gates)
    assert len({gate.thread for gate in gates}) == 20
    for gate in gates:
        assert gate.thread is not None
        assert gate.thread.daemon  # it does not hold up the interpreter's exit
        assert gate.thread.name.startswith("actionkit")
        gate.leave.set()


def test_an_idle_thread_is_used_again_and_ends_when_it_stays_idle() -> None:
    threads, used = Threads(idle=0.2), set[threading.Thread]()
    for _ in range(50):
        gate = Gate()
        gate.leave.set()
        threads.run(gate)
        assert gate.entered.wait(LONG)
        assert gate.thread is not None
        used.add(gate.thread)
    assert len(used) < 10  # on a busy machine one may not be idle again when the next job comes
    for thread in used:
        thread.join(LONG)
        assert not thread.is_alive()
    assert (threads._threads, threads._idle) == (0, 0)


def test_beyond_the_most_a_job_waits_for_its_turn() -> None:
    threads, gates = Threads(most=2), [Gate() for _ in range(3)]
    for gate in gates:
        threads.run(gate)
    assert gates[0].entered.wait(LONG)
    assert gates[1].entered.wait(LONG)
    assert not gates[2].entered.is_set()
    gates[1].leave.set()
    assert gates[2].entered.wait(LONG)
    assert gates[2].thread is gates[1].thread
    gates[0].leave.set()
    gates[2].leave.set()


def test_no_job_is_lost_between_threads_that_come_and_go() -> None:
    threads, done = Threads(most=4, idle=0.0), threading.Semaphore(0)
    for _ in range(3000):
        threads.run(done.release)
    for _ in range(3000):
        assert done.acquire(timeout=LONG)


def test_a_job_that_is_withdrawn_in_time_does_not_run() -> None:
    threads, gate, waiting, last = Threads(most=1), Gate(), Gate(), Gate()
    for job in (gate, waiting, last):
        threads.run(job)
    assert gate.entered.wait(LONG)
    assert threads.withdraw(waiting)
    assert not threads.withdraw(waiting)
    assert not threads.withdraw(gate)  # it runs
    gate.leave.set()
    assert last.entered.wait(LONG)
    assert not waiting.entered.is_set()
    last.leave.set()


def test_where_no_thread_can_be_started_the_job_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """As from Python 3.12 on at the interpreter's exit."""
    threads, gate = Threads(), Gate()
    monkeypatch.setattr(threading.Thread, "start", refuse)
    assert "can't create new thread" in threads.run(gate)
    monkeypatch.undo()
    assert threads.run(gate) == ""
    assert gate.entered.wait(LONG)
    gate.leave.set()


def test_a_job_knows_that_it_is_a_callback() -> None:
    """So that `Client.call` in it raises at once."""
    seen: list[bool] = []
    done = threading.Event()

    def job() -> None:
        seen.append(in_callback.get())
        done.set()

    Threads().run(job)
    assert done.wait(LONG)
    assert seen == [True]


# --- questions ---------------------------------------------------------------------------------


class Thread:
    """A communication thread whose clock and turns are the test's."""

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
    asking = Asking(thread, Threads())
    asking.ask(threading.current_thread, 0.0, None, thread.answers.append)
    assert asking.under_way
    thread.turn()
    assert not asking.under_way
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
    asking = Asking(thread, Threads())
    asking.ask(gate, 5.0, deadline, thread.answers.append)
    assert gate.entered.wait(LONG)
    thread.wait_until(latest - 0.01)
    assert thread.answers == []
    thread.wait_until(latest)
    assert thread.answers == [Unanswered(why)]
    gate.leave.set()
    thread.turn()  # the answer, too late
    assert len(thread.answers) == 1


def test_the_wait_can_be_made_shorter_and_never_longer() -> None:
    thread, gate = Thread(), Gate()
    asking = Asking(thread, Threads())
    asking.end_by(1.0, "nothing is asked")
    asking.ask(gate, 0.0, 8.0, thread.answers.append)
    asking.end_by(9.0, "later")
    asking.end_by(2.0, "sooner")
    asking.end_by(3.0, "later")
    assert len(thread.timers) == 1
    thread.wait_until(2.0)
    assert thread.answers == [Unanswered("sooner")]
    gate.leave.set()


def test_a_question_that_is_dropped_is_not_answered() -> None:
    thread, gate = Thread(), Gate()
    asking = Asking(thread, Threads())
    asking.ask(gate, 0.0, None, thread.answers.append)
    assert gate.entered.wait(LONG)
    asking.drop()
    assert not asking.under_way
    assert len(thread.timers) == 0
    gate.leave.set()
    thread.turn()
    assert thread.answers == []


def test_a_new_question_takes_the_place_of_the_last() -> None:
    thread, gate = Thread(), Gate()
    asking = Asking(thread, Threads())
    asking.ask(gate, 0.0, None, lambda _: thread.answers.append("first"))
    assert gate.entered.wait(LONG)
    asking.ask(lambda: "two", 0.0, None, thread.answers.append)
    thread.turn()
    gate.leave.set()
    thread.turn()
    assert thread.answers == ["two"]


def test_where_nobody_can_be_asked_that_is_the_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threading.Thread, "start", refuse)
    thread = Thread()
    Asking(thread, Threads()).ask(lambda: 1, 0.0, None, thread.answers.append)
    assert thread.answers == []  # not before `ask` has returned
    thread.turn()
    assert isinstance(thread.answers[0], Unanswered)
    assert "could not be asked" in thread.answers[0].why
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

    assert name_of(refuse) == "refuse"
    assert name_of(print) == "print"
    assert name_of(Judge()).endswith("Judge")
    assert name_of(Judge().method).endswith("Judge.method")


def test_values_are_described_in_one_short_line() -> None:
    assert described(3) == "3"
    assert described(ValueError("it broke.\nBadly")) == "ValueError: it broke. Badly"
    assert described(ValueError()) == "ValueError"
    assert len(described("x" * 10_000)) < 250
    assert described(10**5000) == "a value of type int"
