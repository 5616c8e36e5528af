"""Callbacks that run for long hold up no others, and the log names them when more comes (C1.8)."""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable, Iterator

import pytest

from actionkit._calls.futures.feedback import ThreadCallbacks
from actionkit._threads import in_hand
from actionkit._threads.in_hand import (
    FUNCTIONS,
    WARN_AFTER,
    DueWork,
    Label,
    WorkOfPool,
    full_name_of,
)
from actionkit._threads.pool import Pool
from tests.conftest import all_is_logged
from tests.unit.gate import Gate

LONG = 20.0
NOW = 1000.0


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


def in_order(pool: Pool) -> ThreadCallbacks:
    """Return what calls gates one after the other."""
    return ThreadCallbacks(Gate.__call__, "/fibonacci", pool)


def user_function() -> None:
    """Stands for a callback of the user's."""


IT = Label("on_feedback", user_function, "the further feedback of its goal")


# --- who is named ------------------------------------------------------------------------------


@pytest.fixture
def dues() -> WorkOfPool:
    return WorkOfPool("/fibonacci", FUNCTIONS)


def running(dues: WorkOfPool, since: float) -> DueWork:
    """Return what runs on this thread since then."""
    due = dues.begin(IT)
    due.thread, due.since = threading.get_ident(), since
    return due


def named(caplog: pytest.LogCaptureFixture) -> int:
    assert all_is_logged()
    return len(caplog.records)


def test_it_is_named_once_with_its_place(
    dues: WorkOfPool, caplog: pytest.LogCaptureFixture
) -> None:
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
    in_order(pool).put(lambda: first, lambda: second)
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
    dues: WorkOfPool, caplog: pytest.LogCaptureFixture
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
    dues: WorkOfPool, caplog: pytest.LogCaptureFixture
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
    assert full_name_of(function) in (name, f"{__name__}.{name}")


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
    queue, gate = in_order(Pool("/fibonacci", idle=0.0)), Gate()
    gates.append(gate)
    queue.put(lambda: gate)
    assert gate.entered.wait(LONG)
    assert named(caplog) == 0
    queue.put(lambda: gate)
    assert named(caplog) == 1
