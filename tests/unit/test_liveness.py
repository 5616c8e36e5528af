"""When a server without answers counts as dead, on a clock that the test moves."""

from __future__ import annotations

import pytest

from actionkit._ros.servers_in_sight.liveness import Liveness
from tests.unit.clock import Clock


class World:
    """A server that is probed, and what comes of it."""

    def __init__(self) -> None:
        self.clock = Clock()
        self.in_flight = True
        self.probes: list[float] = []
        self.told: list[tuple[float, object]] = []
        self.liveness = Liveness(
            self.clock,
            probe=lambda: self.probes.append(self.clock.time - 100.0),
            wanted=lambda: self.in_flight,
            on_silence=self.tell,
            on_return=lambda: self.tell("back"),
        )

    def tell(self, what: object) -> None:
        self.told.append((self.clock.time - 100.0, what))


@pytest.fixture
def world() -> World:
    return World()


def test_nothing_is_asked_where_nobody_wants_it(world: World) -> None:
    world.liveness.heard()
    world.clock.advance(100.0)
    assert (world.probes, world.told, len(world.clock.queue)) == ([], [], 0)


def test_silence_is_told_once_and_the_return_once(world: World) -> None:
    world.liveness.start(3.0)
    world.clock.advance(9.5)
    assert world.probes == [float(number) for number in range(10)]
    assert world.told == [(3.0, 3.0)]
    world.liveness.heard()
    world.liveness.heard()
    assert world.told[1:] == [(9.5, "back")]
    world.clock.advance(4.0)
    assert world.told[2:] == [(13.0, 3.0)]  # silent for 3 s again


def test_silence_is_told_again_for_a_goal_that_is_sent_in_it(world: World) -> None:
    world.liveness.start(3.0)
    world.clock.advance(9.5)
    for _ in range(6):  # many do not put it off
        world.liveness.start(3.0)
        world.clock.advance(0.5)
    world.clock.advance(7.0)
    assert world.told == [(3.0, 3.0), (13.0, 3.0)]  # at the first check after 3 s
    world.liveness.heard()
    assert world.told[2:] == [(19.5, "back")]


def test_a_server_that_answers_in_time_is_alive(world: World) -> None:
    world.liveness.start(3.0)
    for _ in range(50):
        world.clock.advance(2.9)
        world.liveness.heard()
    assert world.told == []


def test_the_smallest_limit_counts(world: World) -> None:
    world.liveness.start(30.0)
    world.liveness.start(3.0)
    world.liveness.start(60.0)
    world.clock.advance(30.0)
    assert world.told == [(5.0, 3.0)]  # at the next check, which was 5 s away
    assert world.probes[:4] == [0.0, 5.0, 6.0, 7.0]


def test_it_ends_with_the_last_goal_and_begins_afresh(world: World) -> None:
    world.liveness.start(3.0)
    world.clock.advance(10.0)
    world.in_flight = False
    world.clock.advance(10.0)
    assert len(world.clock.queue) == 0
    probes = len(world.probes)
    world.told.clear()
    world.liveness.heard()  # the silence has ended with the goals: nobody is told
    world.clock.advance(1000.0)
    assert (len(world.probes), world.told) == (probes, [])
    world.in_flight = True
    world.liveness.start(30.0)  # the smaller limit of before is forgotten
    world.clock.advance(29.0)
    assert world.told == []
    world.clock.advance(1.0)
    assert world.told == [(1050.0, 30.0)]
