"""Cancelling, closing and reading wait for no lock that an interrupted main thread may hold (C2.9).

What is interrupted is played by this thread: it holds what the interrupted code would hold, and
does what the handler would do. `tests/client/test_signal_handlers.py` interrupts the real code.
"""

from __future__ import annotations

import concurrent.futures
import threading
import time
import uuid
from collections import deque
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import pytest

from actionkit import GoalEvent, GoalState, Outcome
from actionkit._calls.futures.call_view import GoalsOfCall
from actionkit._calls.futures.feedback_broadcast import FeedbackBroadcast
from actionkit._calls.futures.future import GoalFuture
from actionkit._calls.sending.session import Session, open_sessions
from actionkit._goal.effects import End
from actionkit._model.timeline import Recorder
from actionkit._model.values import Timeline
from actionkit._threads.pool import Pool
from actionkit._threads.waiting import Flag, taken_from

BOUND = 20.0
"""Seconds for what takes microseconds."""


def elsewhere(function: Any, *args: Any) -> threading.Thread:
    """Do it as the communication thread would; it must come to its end all the same."""
    thread = threading.Thread(target=function, args=args, daemon=True)
    thread.start()
    thread.join(BOUND)
    assert not thread.is_alive(), "it waits for a lock of the interrupted thread"
    return thread


# --- flags -------------------------------------------------------------------------------------


def test_a_flag_wakes_all_who_wait() -> None:
    flag = Flag()
    heard: list[bool] = []
    waiting = [threading.Thread(target=lambda: heard.append(flag.wait(BOUND))) for _ in range(5)]
    for thread in waiting:
        thread.start()
    assert not flag.is_set()
    flag.set()
    for thread in waiting:
        thread.join()
    assert heard == [True] * 5
    assert flag.wait(0)


@pytest.mark.parametrize("timeout", [0, -1.0, 0.01])
def test_a_wait_for_a_flag_ends_in_time(timeout: float) -> None:
    assert not Flag().wait(timeout)


def test_who_no_longer_waits_is_forgotten() -> None:
    flag = Flag()
    for _ in range(10):
        flag.wait(0)
    assert len(flag._waiting) == 0


def test_a_flag_is_waited_for_by_a_handler_that_interrupted_the_same_wait(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """`threading.Event` would hang here: its own lock is held."""
    flag = Flag()
    real, seen = threading.Lock, list[bool]()

    def handler() -> Any:
        monkeypatch.setattr(threading, "Lock", real)
        elsewhere(flag.set)
        seen.append(flag.wait(BOUND))
        return real()

    monkeypatch.setattr(threading, "Lock", handler)  # in the midst of the outer wait
    assert flag.wait(BOUND)
    assert seen == [True]


def test_what_several_take_out_is_taken_once() -> None:
    queue = deque(range(20_000))
    taken: list[int] = []
    threads = [threading.Thread(target=lambda: taken.extend(taken_from(queue))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(taken) == list(range(20_000))


# --- futures -----------------------------------------------------------------------------------


def a_future() -> GoalFuture[Any, Any]:
    call = SimpleNamespace(
        goal_id=uuid.uuid4(),
        state=GoalState.SUCCEEDED,
        timeline=Recorder(),
        cancel_grace=1.0,
        goals=GoalsOfCall(),
        to_replace=(),
        request_cancel=lambda: None,
    )
    return GoalFuture(call, FeedbackBroadcast(), Pool(), SimpleNamespace())


def outcome(error: Exception | None = None) -> Outcome[Any]:
    return Outcome(
        status=GoalState.SUCCEEDED,
        result="result",
        error=error,
        attempts=1,
        timeline=Timeline(()),
        goal_id=uuid.uuid4(),
        cancel=None,
    )


def test_a_future_is_settled_while_its_lock_is_held() -> None:
    """`concurrent.futures.wait` and `as_completed` hold it for a moment, in the main thread."""
    future = a_future()
    called = Flag()
    future.add_done_callback(lambda _: called.set())
    with future._condition:
        elsewhere(future._settle, outcome(), End.SUCCEEDED)
        assert future.done()
        assert future.result(0) == "result"
        assert future.outcome(0).ok
        assert called.wait(BOUND)
    assert concurrent.futures.wait([future], BOUND).done == {future}


@pytest.mark.parametrize("how", [concurrent.futures.ALL_COMPLETED, "FIRST_COMPLETED"])
def test_whoever_waits_for_several_futures_is_told(how: str) -> None:
    futures = [a_future() for _ in range(3)]
    found: list[int] = []

    def wait() -> None:
        found.append(len(concurrent.futures.wait(futures, BOUND, return_when=how).done))

    waiting = threading.Thread(target=wait)
    waiting.start()
    while not futures[-1]._waiters:
        assert waiting.is_alive()
    errors = [None, ValueError("for the test"), None]
    ends = [End.SUCCEEDED, End.ABORTED, End.CANCELLED_BY_CALLER]
    for future, error, end in zip(futures, errors, ends, strict=True):
        elsewhere(future._settle, outcome(error), end)
    waiting.join(BOUND)
    assert found[0] == 3 if how == concurrent.futures.ALL_COMPLETED else found[0] >= 1
    assert len(list(concurrent.futures.as_completed(futures, BOUND))) == 3


def test_a_goal_whose_acceptance_was_never_seen_is_accepted_when_it_has_succeeded() -> None:
    """A goal that was lost before its acceptance came may turn out to have finished."""
    future = a_future()
    end = GoalEvent(future.goal_id, 1, GoalState.SUCCEEDED, 1.0, 2.0)
    future._call.timeline.add(end)  # type: ignore[attr-defined]
    elsewhere(future._settle, outcome(), End.SUCCEEDED)
    assert future.wait_accepted(0) == end


def test_a_callback_that_is_added_just_as_the_goal_ends_is_called_once() -> None:
    made = [a_future() for _ in range(500)]
    called: deque[Any] = deque()
    flags = [Flag() for _ in made]
    settling = threading.Thread(
        target=lambda: [future._settle(outcome(), End.SUCCEEDED) for future in made]
    )
    settling.start()
    for future, flag in zip(made, flags, strict=True):
        future.add_done_callback(lambda done, flag=flag: (called.append(done), flag.set()))  # type: ignore[misc]
    settling.join()
    assert all(flag.wait(BOUND) for flag in flags)
    assert len(called) == len(set(called)) == len(made)


def test_closing_waits_for_done_callbacks_before_it_sees_that_the_call_is_over() -> None:
    future, seen = a_future(), list[tuple[bool, bool]]()
    dues = future._pool.dues
    future.add_done_callback(lambda _: None)
    look = lambda: seen.append((future.done(), dues.finish(time.monotonic())))  # noqa: E731
    future._settle(outcome(), End.SUCCEEDED, look)
    assert seen == [(False, False)]
    assert dues.finish(time.monotonic() + BOUND)


# --- the rest ----------------------------------------------------------------------------------


class Connection(SimpleNamespace):
    """A connection on a thread that comes to what it is given when the test says so."""

    def __init__(self) -> None:
        self.soon: list[Any] = []
        freed = Flag()
        super().__init__(
            identity=SimpleNamespace(action_name="/arm", type_name="some/action/Arm", label=""),
            link=SimpleNamespace(),
            runtime=SimpleNamespace(
                failure=None,
                was_shut_down=False,
                on_failure=[],
                on_shutdown=[],
                call_soon=self.soon.append,
                call_at=lambda at, callback: None,
                cancel_timer=None,
            ),
            freed=freed,
            free=freed.set,
            decode_feedback=None,
            why_unusable=lambda: "",
            has_node=False,
            end_waits=lambda: None,
        )

    def turn(self) -> None:
        while self.soon:
            self.soon.pop(0)()


def session_over(connection: Connection) -> Session:
    session = Session(connection, "cancel", 1.0)  # type: ignore[arg-type]
    open_sessions.discard(session)  # nothing here is to be ended at the interpreter's exit
    return session


class Begun:
    """A call that notes what becomes of it."""

    def __init__(self) -> None:
        self.notes: list[str] = []

    def start(self) -> None:
        self.notes.append("started")

    def close(self, *, abandon: bool, because: str) -> None:
        self.notes.append("closed")

    def fail(self, reason: str, error: BaseException) -> None:
        self.notes.append("failed")


def test_a_call_that_slips_in_behind_the_closing_sends_nothing() -> None:
    connection = Connection()
    session = session_over(connection)
    before, behind = Begun(), Begun()
    session.begin(before)  # type: ignore[arg-type]
    # In a signal handler, after the look whether it is closed.
    with patch.object(session, "check", session.close_calls):
        session.begin(behind)  # type: ignore[arg-type]
    connection.turn()
    assert before.notes == ["started", "closed"]
    assert behind.notes[0] == "closed"
    assert "started" not in behind.notes


def test_a_call_that_comes_to_a_port_that_is_gone_does_not_hang() -> None:
    connection = Connection()
    session = session_over(connection)
    call = Begun()

    def slip_in() -> None:
        session.release()
        connection.turn()
        assert connection.freed.is_set()

    with patch.object(session, "check", slip_in):
        session.begin(call)  # type: ignore[arg-type]
    connection.turn()
    assert call.notes == ["closed"]


def test_a_call_on_a_thread_that_died_fails() -> None:
    connection = Connection()
    session = session_over(connection)
    before, behind = Begun(), Begun()
    session.begin(before)  # type: ignore[arg-type]
    connection.turn()
    connection.runtime.failure = SystemExit("for the test")
    session.begin(behind)  # type: ignore[arg-type]
    connection.turn()
    assert behind.notes == ["failed"]
    session._on_failure(connection.runtime.failure)
    assert before.notes == ["started", "failed"]


def test_a_future_whose_making_was_interrupted_is_dropped_quietly() -> None:
    """Ctrl-C in the constructor: `__del__` must not look for what is not there."""
    GoalFuture.__new__(GoalFuture).__del__()
