"""When the feedback topic is read, and who gets what, on a clock that the test moves."""

from __future__ import annotations

from typing import Any

import pytest

from actionkit._ros.answers.feedback import FeedbackWatch
from tests.unit.clock import CommunicationThread

OURS, ALSO_OURS, THEIRS = (bytes([number]) * 16 for number in (1, 2, 3))


def message(goal: bytes, text: bytes = b"") -> bytes:
    return bytes(4) + goal + text


class Subscription:
    """A queue of messages, of which 64 are taken at a time."""

    def __init__(self) -> None:
        self.queue: list[bytes] = []
        self.reads = 0

    def take(self) -> list[bytes]:
        self.reads += 1
        taken, self.queue = self.queue[:64], self.queue[64:]
        return taken

    def discard(self) -> None:
        self.queue.clear()


class Matched:
    """An event that somebody reads."""

    def __init__(self) -> None:
        self.reads = 0

    def take(self) -> None:
        self.reads += 1


class World:
    """The topic, and what is passed on."""

    def __init__(self, matched: Matched | None) -> None:
        self.thread = CommunicationThread()
        self.topic = Subscription()
        self.matched = matched
        self.passed_on: list[tuple[bytes, list[bytes]]] = []
        self.has_waiters = False
        self.watch = FeedbackWatch(
            self.thread,  # type: ignore[arg-type]
            self.topic,  # type: ignore[arg-type]
            matched,  # type: ignore[arg-type]
            goals={OURS, ALSO_OURS},
            on_feedback=lambda goal, messages: self.passed_on.append((goal, messages)),
            has_waiters=lambda: self.has_waiters,
        )

    @property
    def waits(self) -> bool:
        """Whether the thread waits for the topic; it must wait for all or for nothing."""
        all_sources: set[Any] = {self.topic, self.matched} - {None}
        assert self.thread.sources in (set(), all_sources)
        return bool(self.thread.sources)

    def come(self, *messages: bytes) -> None:
        """Let messages come, and the thread read them if it waits for them."""
        self.topic.queue.extend(messages)
        if self.waits:
            self.watch.look()

    def start(self) -> None:
        self.watch.start()
        self.thread.advance(0.01)
        assert self.waits


@pytest.fixture
def matched() -> Matched:
    return Matched()


@pytest.fixture
def world(matched: Matched) -> World:
    return World(matched)


def test_each_goal_gets_its_own_messages_in_order(world: World) -> None:
    world.start()
    mine, other = [message(OURS, b"1"), message(OURS, b"2")], message(ALSO_OURS, b"1")
    world.come(mine[0], message(THEIRS), other, b"torn", mine[1])
    assert world.passed_on == [(OURS, mine), (ALSO_OURS, [other])]


def test_what_came_before_the_start_is_thrown_away(world: World) -> None:
    world.topic.queue.append(message(OURS))
    world.start()
    assert world.passed_on == []
    world.watch.start()  # for another goal: nothing is thrown away now
    world.come(message(OURS))
    assert len(world.passed_on) == 1


def test_the_first_read_is_put_off_so_that_a_short_goal_costs_none(world: World) -> None:
    world.watch.start()
    assert not world.waits
    world.topic.queue.append(message(OURS))
    world.watch.take_all()  # its result has come
    assert len(world.passed_on) == 1


def test_a_thousand_messages_a_second_cost_a_read_each_two_milliseconds(world: World) -> None:
    world.start()
    reads = world.topic.reads
    for _ in range(1000):
        world.come(message(OURS))
        world.thread.advance(0.001)
    assert len([m for _, messages in world.passed_on for m in messages]) >= 998
    assert world.topic.reads - reads <= 510


def test_messages_that_come_rarely_are_read_at_once(world: World) -> None:
    world.start()
    for number in range(10):
        world.thread.advance(0.1)
        reads = world.topic.reads
        world.come(message(OURS))
        world.thread.advance(0.01)
        assert (len(world.passed_on), world.topic.reads - reads) == (number + 1, 1)


def test_others_feedback_wakes_a_goals_client_less_often(world: World) -> None:
    world.start()
    reads = world.topic.reads
    for _ in range(1000):
        world.come(message(THEIRS))
        world.thread.advance(0.001)
    assert world.topic.reads - reads <= 102
    assert world.passed_on == []


def test_others_feedback_wakes_an_idle_client_once_a_second(world: World) -> None:
    for _ in range(10_000):
        world.come(message(THEIRS))
        world.thread.advance(0.001)
    assert world.topic.reads <= 12
    world.has_waiters = True  # somebody waits for a server: its event must not be late
    world.watch.poll_now()
    reads = world.topic.reads
    for _ in range(1000):
        world.come(message(THEIRS))
        world.thread.advance(0.001)
    assert 90 <= world.topic.reads - reads <= 102


def test_a_flood_cannot_keep_the_thread(world: World) -> None:
    world.start()
    reads = world.topic.reads
    world.topic.queue.extend([message(OURS)] * 100_000)
    world.watch.take_all()
    assert world.topic.reads - reads == 32


def test_the_event_can_be_read_within_a_pause(world: World, matched: Matched) -> None:
    world.come(message(THEIRS))
    assert not world.waits
    world.watch.poll_now()
    assert (matched.reads, world.waits) == (1, True)
    world.watch.poll_now()  # while it is waited for, the thread reads it by itself
    assert matched.reads == 1
    assert len(world.thread.queue) == 0


def test_after_the_last_goal_only_the_event_matters(world: World) -> None:
    world.start()
    world.watch.stop()
    assert world.waits
    world.come(message(OURS))
    assert not world.waits  # for a second


def test_a_middleware_without_the_event_is_not_listened_to_while_idle() -> None:
    world = World(None)
    assert not world.waits
    world.start()
    world.watch.stop()
    assert not world.waits
    world.watch.poll_now()
    assert not world.waits


def test_closing_leaves_neither_a_source_nor_a_timer(world: World) -> None:
    world.watch.start()
    world.watch.close()
    assert not world.waits
    assert len(world.thread.queue) == 0
