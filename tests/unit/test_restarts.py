"""How many of several servers answer (R1, R14), over a clock that the test moves."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count

import pytest

from actionkit._ros.servers.restarts import RestartDetector
from actionkit._threads.clock import TimerHandle, TimerQueue


class World:
    """A communication thread's clock, and the questions asked on it."""

    def __init__(self) -> None:
        self.clock = 0.0
        self.timers = TimerQueue()
        self.numbers = count(1)
        self.asked: list[int] = []
        self.found_one = 0
        self.restarts = RestartDetector(self, self.ask, self.on_one)

    def now(self) -> float:
        return self.clock

    def call_at(self, at: float, callback: Callable[[], None]) -> TimerHandle:
        return self.timers.arm(at, callback)

    def ask(self) -> int:
        self.asked.append(next(self.numbers))
        return self.asked[-1]

    def on_one(self) -> None:
        self.found_one += 1

    def advance(self, seconds: float, answers: int = 0) -> None:
        """Let time pass; each question is answered by so many servers at once."""
        until = self.clock + seconds
        while (due := self.timers.next_due()) is not None and due <= until:
            self.clock = due
            before = len(self.asked)
            run = self.timers.pop_due(due)
            assert run is not None
            run()
            for question in self.asked[before:]:
                for _ in range(answers):
                    self.restarts.answered(question)
        self.clock = until


@pytest.mark.parametrize(("answers", "found"), [(0, 0), (1, 1), (2, 0)])
def test_what_the_answers_tell(answers: int, found: int) -> None:
    world = World()
    world.restarts.begin()
    world.restarts.begin()  # once is enough
    world.advance(2.0, answers)
    assert world.found_one == found
    assert not world.restarts.running


@pytest.mark.parametrize("after", [0.0, 0.3])
def test_a_closed_client_asks_and_tells_nothing_any_more(after: float) -> None:
    world = World()
    world.restarts.begin()
    world.advance(after, answers=1)
    asked = len(world.asked)
    world.restarts.close()
    world.advance(2.0, answers=1)
    assert len(world.asked) == asked
    assert world.found_one == 0
