"""The timers of one goal on one timer of the thread."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Callable

import pytest

from actionkit._calls.sending.goal_timers import GoalTimers
from actionkit._goal.effects import Timer
from tests.unit.clock import Clock


class Counted(Clock):
    """A clock that counts what it is asked for."""

    def __init__(self) -> None:
        super().__init__()
        self.asked = 0

    def call_at(self, at, callback):
        self.asked += 1
        return super().call_at(at, callback)


@pytest.fixture
def clock() -> Counted:
    return Counted()


@pytest.fixture
def fired() -> list[tuple[Timer, float]]:
    return []


class Goal(GoalTimers):
    """Timers of a goal that writes down which were due, and does `then` each time."""

    def __init__(self, clock: Clock, fired: list[tuple[Timer, float]]) -> None:
        super().__init__(clock)
        self.then: Callable[[Timer], None] = lambda timer: None
        self._fired = fired
        self._test = clock

    def told(self) -> None:
        """Have the thread know; what `Attempt` does after each event."""
        self.settle(self._fire)

    def _fire(self) -> None:
        while (timer := self.pop_due()) is not None:
            self._fired.append((timer, self._test.time))
            self.then(timer)
        self.told()


@pytest.fixture
def timers(clock: Counted, fired: list[tuple[Timer, float]]) -> Goal:
    return Goal(clock, fired)


def test_each_fires_once_at_its_time(timers, clock, fired):
    for timer, at in ((Timer.RESULT, 103.0), (Timer.ACCEPT, 101.0), (Timer.REASK, 102.0)):
        timers.arm(timer, at)
    timers.told()
    assert clock.asked == 1
    clock.advance(10.0)
    assert fired == [(Timer.ACCEPT, 101.0), (Timer.REASK, 102.0), (Timer.RESULT, 103.0)]
    assert len(timers) == len(clock.queue) == 0


def test_of_two_at_the_same_time_the_one_armed_first(timers, clock, fired):
    for timer in (Timer.REASK, Timer.RESULT, Timer.ACCEPT, Timer.REASK):  # that one again
        timers.arm(timer, 101.0)
    timers.told()
    clock.advance(1.0)
    assert [timer for timer, _ in fired] == [Timer.RESULT, Timer.ACCEPT, Timer.REASK]


def test_one_that_is_moved_to_later_asks_nothing_of_the_thread(timers, clock, fired):
    timers.arm(Timer.REASK, 101.0)
    timers.told()
    timers.arm(Timer.REASK, 105.0)
    timers.arm(Timer.RESULT, 110.0)
    timers.told()
    assert clock.asked == 1
    clock.advance(4.0)
    assert fired == []
    clock.advance(20.0)
    assert fired == [(Timer.REASK, 105.0), (Timer.RESULT, 110.0)]


def test_one_that_is_moved_to_sooner_fires_then(timers, clock, fired):
    timers.arm(Timer.REASK, 108.0)
    timers.told()
    timers.arm(Timer.REASK, 101.0)
    timers.told()
    assert len(clock.queue) == 1
    clock.advance(1.0)
    assert fired == [(Timer.REASK, 101.0)]


def test_none_fires_that_was_disarmed(timers, clock, fired):
    for timer in Timer:
        timers.arm(timer, 101.0)
    timers.told()
    timers.disarm(Timer.RESULT)
    timers.disarm(Timer.RESULT)
    timers.keep_only(Timer.REASK, Timer.RESULT)
    timers.told()
    clock.advance(10.0)
    assert fired == [(Timer.REASK, 101.0)]
    timers.arm(Timer.REASK, 200.0)
    timers.told()
    timers.keep_only()
    timers.told()
    assert len(timers) == len(clock.queue) == 0  # nothing is left that would keep the goal alive


def test_what_a_timer_does_counts_for_the_others(timers, clock, fired):
    def then(timer: Timer) -> None:
        if timer is Timer.ACCEPT:
            timers.disarm(Timer.STALL)
            timers.arm(Timer.CANCEL, 100.5)  # due by now
            timers.arm(Timer.REASK, 107.0)
        timers.told()

    timers.then = then
    timers.arm(Timer.ACCEPT, 101.0)
    timers.arm(Timer.STALL, 101.0)
    timers.told()
    clock.advance(10.0)
    assert fired == [(Timer.ACCEPT, 101.0), (Timer.CANCEL, 101.0), (Timer.REASK, 107.0)]
    assert len(clock.queue) == 0


def test_a_goal_that_is_over_leaves_no_circle(clock):
    timers = Goal(clock, [])
    timers.arm(Timer.REASK, 101.0)
    timers.arm(Timer.RESULT, 105.0)
    timers.told()
    clock.advance(2.0)
    timers.keep_only()
    timers.told()
    gone = weakref.ref(timers)
    gc.disable()
    try:
        del timers
        assert gone() is None
    finally:
        gc.enable()
