"""How many of several servers answer (R1, R14), on a clock that the test moves."""

from __future__ import annotations

from itertools import count

import pytest

from actionkit._ros.servers_in_sight.restarts import RestartDetector
from actionkit._threads.clock import TimerGroup
from tests.unit.clock import Clock


class World:
    """Servers that answer each probe at once."""

    def __init__(self, answers: int) -> None:
        self.clock = Clock()
        self.timers = TimerGroup(self.clock, self.clock.queue.cancel)
        self.answers = answers
        self.numbers = count(1)
        self.sent = 0
        self.sent_at: list[float] = []
        self.verdicts = 0
        self.detector = RestartDetector(self.timers, self.probe, self.on_one_answers)

    def probe(self) -> int:
        self.sent = next(self.numbers)
        self.sent_at.append(self.clock.time - 100.0)
        self.clock.call_at(self.clock.time + 0.001, lambda seq=self.sent: self.answer(seq))  # type: ignore[misc]
        return self.sent

    def answer(self, seq: int) -> None:
        for _ in range(self.answers):
            self.detector.count_answer(seq)

    def on_one_answers(self) -> None:
        self.verdicts += 1


@pytest.mark.parametrize(("answers", "verdicts"), [(0, 0), (1, 1), (2, 0)])
def test_what_the_answers_tell(answers: int, verdicts: int) -> None:
    world = World(answers)
    assert world.detector.running is False
    world.detector.start()
    world.detector.start()  # once is enough
    world.clock.advance(2.0)
    assert (world.sent, world.verdicts) == (3, verdicts)
    assert world.sent_at == pytest.approx([0.0, 0.2, 0.4])  # one who is busy for less answers all
    assert world.detector.running is False
    assert len(world.clock.queue) == 0


def test_probes_that_could_not_be_sent_tell_nothing() -> None:
    world = World(1)

    def fails() -> int:
        raise RuntimeError("the middleware does not send it")

    detector = RestartDetector(world.timers, fails, world.on_one_answers)
    detector.start()
    for _ in range(3):
        with pytest.raises(RuntimeError):
            world.clock.advance(2.0)
    world.clock.advance(2.0)
    assert (detector.running, world.verdicts) == (False, 0)


def test_the_last_answer_has_time_to_come() -> None:
    world = World(0)
    world.detector.start()
    world.clock.advance(0.65)
    assert (world.detector.running, world.verdicts) == (True, 0)
    world.detector.count_answer(3)
    world.clock.advance(0.1)
    assert (world.detector.running, world.verdicts) == (False, 1)


def test_one_probe_with_two_answers_shows_that_both_servers_live() -> None:
    world = World(1)
    world.detector.start()
    world.clock.advance(0.1)
    world.answer(1)  # the second server's; its answers to the others are lost
    world.clock.advance(2.0)
    assert world.verdicts == 0


def test_each_run_counts_anew_and_no_answers_to_others() -> None:
    world = World(2)
    world.detector.start()
    world.clock.advance(2.0)
    world.answers = 1  # one of them has died
    world.detector.start()
    world.clock.advance(0.1)
    for seq in (1, 99):  # late answers to the first run; those to a cancel request
        world.answer(seq)
        world.answer(seq)
    world.clock.advance(2.0)
    assert (world.sent, world.verdicts) == (6, 1)


@pytest.mark.parametrize("after", [0.0, 0.3])
def test_nothing_is_sent_or_told_when_the_timers_have_ended(after: float) -> None:
    world = World(1)
    world.detector.start()
    world.clock.advance(after)
    sent = world.sent
    world.timers.close()
    world.clock.advance(2.0)
    assert (world.sent, world.verdicts) == (sent, 0)
