"""Which goal a request belongs to, and what its answer is worth."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from actionkit._clock import TimerQueue
from actionkit._ros.requests import Requests
from tests.unit.call_life import CallLife

KEY = bytes(range(16))


class Client:
    """Gives each request a number."""

    def __init__(self) -> None:
        self.requests: list[Any] = []

    def send(self, request: Any) -> int:
        self.requests.append(request)
        return len(self.requests)


class Thread:
    """The clock and the sources of a communication thread."""

    def __init__(self) -> None:
        self.clock = 0.0
        self.timers = TimerQueue()
        self.sources: set[object] = set()
        self.enable = self.sources.add
        self.disable = self.sources.discard

    def now(self) -> float:
        return self.clock

    def call_at(self, at: float, callback: Any) -> Any:
        return self.timers.arm(at, callback)

    def advance(self, seconds: float) -> None:
        self.clock += seconds
        while (due := self.timers.pop_due(self.clock)) is not None:
            due()


@pytest.fixture
def thread() -> Thread:
    return Thread()


@pytest.fixture
def requests(thread: Thread) -> Requests:
    entities = SimpleNamespace(goal=Client(), result=Client(), cancel=Client(), feedback=object())
    request = SimpleNamespace(Request=SimpleNamespace)
    impl = SimpleNamespace(SendGoalService=request, GetResultService=request)
    made = Requests(thread, entities, impl)  # type: ignore[arg-type]
    made.send_goal(KEY, object())
    return made


def test_what_was_asked_before_is_outdated_when_asked_anew(
    requests: Requests, thread: Thread
) -> None:
    requests.ask_result(KEY)
    requests.ask_result(KEY)  # at a measured pace, and so not at once
    requests.ask_result(KEY, anew=True)
    thread.advance(1.0)
    assert [requests.is_outdated(seq) for seq in (1, 2, 3)] == [True, False, False]
    # A result counts all the same.
    assert [requests.answered("result", seq) for seq in (1, 2, 3, 4)] == [KEY, KEY, KEY, None]
    assert not requests.is_outdated(1)


def test_a_forgotten_goal_leaves_nothing_behind(requests: Requests, thread: Thread) -> None:
    requests.ask_result(KEY)
    requests.ask_result(KEY, anew=True)
    requests.ask_cancel(KEY)
    requests.forget(KEY, elsewhere=False)
    requests.ask_result(KEY)
    requests.ask_cancel(KEY)
    thread.advance(1.0)
    assert not any(requests.table_sizes().values())


def test_unheard_is_since_the_first_that_was_not_answered(
    requests: Requests, thread: Thread
) -> None:
    assert requests.unheard_since is None
    thread.advance(1.0)
    requests.question()
    thread.advance(1.0)
    requests.ask_cancel(KEY)
    assert requests.unheard_since == 1.0
    requests.heard()
    assert requests.unheard_since is None
    requests.forget(KEY, elsewhere=True)  # a cancel request more
    assert requests.unheard_since == 2.0


@pytest.mark.parametrize("lost", [False, True])
def test_a_late_answer_to_an_early_question_ends_nothing(lost: bool) -> None:
    """A server that did not know the goal yet, and whose word was held up on the way."""
    life = CallLife()
    life.ready()
    life.accepted(0)
    attempt = life.call._attempt
    assert attempt is not None
    if lost:
        life.gone()
    life.does(attempt.on_result, 0, None, outdated=True)
    assert attempt.goal.in_flight
    life.result(0, None)
    assert not attempt.goal.in_flight
