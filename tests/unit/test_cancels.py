"""Cancel requests are sent a few at a time, and again until they are answered (C1.12, C2.4)."""

from __future__ import annotations

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from actionkit._model.cancel_answer import CancelAnswer
from actionkit._ros.cancelling.cancels import ANSWERED_WITHIN, CancelQueue, CancelWindow
from actionkit._ros.communication.outbox import WINDOW
from tests.unit.clock import Clock


def key(number: int) -> bytes:
    return number.to_bytes(16, "big")


class World:
    """Queues that share a window, and what they have sent."""

    def __init__(self) -> None:
        self.clock = Clock()
        self.window = CancelWindow()
        self.sent: list[tuple[float, bytes]] = []

    def queue(self) -> CancelQueue:
        return CancelQueue(
            self.clock,
            self.window,
            send=lambda key: self.sent.append((self.clock.now(), key)),
            cancel_timer=self.clock.queue.cancel,
        )

    @property
    def keys(self) -> list[bytes]:
        return [key for _, key in self.sent]

    def times(self, key: bytes) -> list[float]:
        return [at - 100.0 for at, each in self.sent if each == key]


@pytest.fixture
def world() -> World:
    return World()


def test_no_more_than_a_window_is_unanswered(world: World) -> None:
    queue = world.queue()
    for number in range(100):
        queue.ask(key(number))
    assert world.keys == [key(number) for number in range(WINDOW)]
    for number in range(100):
        queue.answered(key(number), CancelAnswer.TERMINATED, world.clock.now())
    assert world.keys == [key(number) for number in range(100)]
    assert len(queue) == 0
    assert len(world.clock.queue) == 0


def test_those_in_a_hurry_go_first(world: World) -> None:
    queue, other = world.queue(), world.queue()
    for number in range(20):
        queue.ask(key(number))
    other.ask(key(100), urgent=True)
    queue.ask(key(101), urgent=True)
    queue.ask(key(15), urgent=True)  # its deadline has passed meanwhile
    for number in range(3):
        queue.answered(key(number), CancelAnswer.TERMINATED, world.clock.now())
    assert world.keys[WINDOW:] == [key(100), key(101), key(15)]
    queue.ask(key(19), urgent=True)
    queue.ask(key(19))  # it is accepted, and its caller still has little time left
    for number in (*range(3, 20), 101):
        queue.answered(key(number), CancelAnswer.TERMINATED, world.clock.now())
    assert world.keys[WINDOW + 3] == key(19)
    assert sorted(world.keys) == sorted([*map(key, range(20)), key(100), key(101)])  # each once


def test_what_is_not_answered_is_asked_again_less_and_less_often(world: World) -> None:
    queue = world.queue()
    queue.ask(key(1))
    world.clock.advance(100.0)
    assert world.times(key(1)) == [0, 0.25, 0.5, 1, 2, 4, 8, 16, 32, 62, 92]


def test_a_server_that_does_not_know_the_goal_is_asked_again(world: World) -> None:
    queue = world.queue()
    queue.ask(key(1))
    queue.answered(key(1), CancelAnswer.UNKNOWN_GOAL, world.clock.now())
    world.clock.advance(0.25)
    assert world.times(key(1)) == [0.0, 0.25]
    world.clock.advance(0.1)
    queue.ask(key(1))  # accepted just now: but one is on the way
    world.clock.advance(0.1)
    queue.answered(key(1), CancelAnswer.UNKNOWN_GOAL, world.clock.now())
    queue.ask(key(1))
    assert world.times(key(1)) == pytest.approx([0.0, 0.25, 0.45])
    queue.answered(key(1), CancelAnswer.TERMINATED, world.clock.now())
    world.clock.advance(100.0)
    assert len(world.sent) == 3


def test_a_server_that_never_knows_the_goal_is_asked_seldom_at_last(world: World) -> None:
    queue = world.queue()
    queue.ask(key(1))
    for _ in range(3600):
        if world.sent[-1][0] == world.clock.now():
            queue.answered(key(1), CancelAnswer.UNKNOWN_GOAL, world.clock.now())
        world.clock.advance(1.0)
    assert len(world.sent) < 30  # 128 without that
    world.clock.advance(1000.0)  # it answers nothing any more: it may be busy, and take it yet
    assert len(world.sent) > 50
    queue.ask(key(1))  # it has it after all
    assert world.clock.now() == world.sent[-1][0]


def test_a_refusal_of_what_was_asked_before_ends_nothing(world: World) -> None:
    """It may have been said while the goal was being accepted, and come seconds later (R12)."""
    queue = world.queue()
    for number in range(WINDOW):
        queue.ask(key(number))  # nobody else gets a place in the window
    world.clock.advance(0.2)
    asked = world.clock.now()
    queue.ask(key(100))
    queue.answered(key(100), CancelAnswer.REFUSED, asked - 0.1)
    for number in range(WINDOW):
        queue.answered(key(number), CancelAnswer.ACCEPTED, asked)
    assert world.keys[WINDOW:] == [key(100)]
    queue.answered(key(100), CancelAnswer.REFUSED, world.clock.now())
    assert len(queue) == 0


def test_an_end_that_was_told_before_the_goal_was_accepted_ends_nothing(world: World) -> None:
    """micro-ROS' server tells it of a goal that it has read and not accepted yet."""
    queue = world.queue()
    queue.ask(key(1))
    sent = world.clock.now()
    world.clock.advance(0.0625)
    queue.ask(key(1))  # accepted
    queue.answered(key(1), CancelAnswer.TERMINATED, sent)
    assert world.times(key(1)) == [0.0, 0.0625]
    queue.answered(key(1), CancelAnswer.ACCEPTED, world.clock.now())
    assert len(queue) == 0


def test_a_goal_that_was_accepted_while_a_request_was_on_its_way_is_asked_about_at_once(
    world: World,
) -> None:
    queue = world.queue()
    queue.ask(key(1))
    world.clock.advance(0.0625)
    queue.ask(key(1))  # accepted: what is on its way may have come too early
    assert world.times(key(1)) == [0.0]
    world.clock.advance(0.0625)
    queue.answered(key(1), CancelAnswer.UNKNOWN_GOAL, world.clock.now())
    assert world.times(key(1)) == [0.0, 0.125]
    queue.answered(key(1), CancelAnswer.UNKNOWN_GOAL, world.clock.now())
    world.clock.advance(0.125)
    assert world.times(key(1)) == [0.0, 0.125]
    world.clock.advance(0.125)
    assert world.times(key(1)) == [0.0, 0.125, 0.375]


def test_answers_that_do_not_come_hold_nobody_up_for_long(world: World) -> None:
    queue = world.queue()
    for number in range(WINDOW + 1):
        queue.ask(key(number))
    world.clock.advance(ANSWERED_WITHIN - 0.01)
    assert key(WINDOW) not in world.keys
    world.clock.advance(0.02)
    assert key(WINDOW) in world.keys


@pytest.mark.parametrize("answer", [CancelAnswer.UNKNOWN_GOAL, None])
def test_who_is_asked_again_later_holds_nobody_up_until_then(
    world: World, answer: CancelAnswer | None
) -> None:
    queue, other = world.queue(), world.queue()
    queue.ask(key(1))
    world.clock.advance(2.0)  # unanswered, so that one place is left
    assert world.times(key(1))[-1] == 2.0  # and the next is sent two seconds later
    other.ask(key(2))
    assert not world.times(key(2))
    if answer is not None:
        queue.answered(key(1), answer, world.clock.now())
    world.clock.advance(ANSWERED_WITHIN)
    assert world.times(key(2))[0] == (2.0 if answer else 2.0 + ANSWERED_WITHIN)


def places(window: CancelWindow) -> int:
    """Return how many requests may be sent now."""
    free = 0
    while window.enter(lambda: None):
        free += 1
    for _ in range(free):
        window.leave()
    return free


def test_a_missing_answer_halves_the_window_and_an_answer_widens_it_by_a_part_of_a_place() -> None:
    window = CancelWindow(8)
    seen = []
    for tell in (*3 * [window.unanswered], *13 * [window.answered], window.unanswered):
        tell()
        seen.append(places(window))
    assert seen == [4, 2, 1, 2, 2, 2, 3, 3, 3, 4, 4, 4, 4, 4, 5, 5, 2]


def test_the_window_shrinks_while_answers_do_not_come_and_grows_again(world: World) -> None:
    """Other processes send to the same queue, and nothing else tells of them."""
    queue = world.queue()
    for number in range(100):
        queue.ask(key(number))
    world.clock.advance(ANSWERED_WITHIN + 0.01)
    assert world.window._taken == 1
    for number in range(1000):
        queue.ask(key(number))
        queue.answered(key(number), CancelAnswer.TERMINATED, world.clock.now())
    for number in range(2000, 2100):
        queue.ask(key(number))
    assert world.window._taken == WINDOW


def test_a_deaf_server_is_asked_about_one_goal_at_a_time(world: World) -> None:
    """And each goal has its turn, however many there are."""
    queue = world.queue()
    for number in range(1000):
        queue.ask(key(number))
    world.clock.advance(600.0)
    late = [at for at, _ in world.sent if at > 100.0 + 2 * ANSWERED_WITHIN]
    for at, group in itertools.groupby(late):
        assert len(list(group)) == 1, at
    assert len(late) <= 600.0 / ANSWERED_WITHIN
    assert set(world.keys) == {key(number) for number in range(1000)}


def test_who_ended_is_asked_about_no_more_and_leaves_nothing(world: World) -> None:
    queue = world.queue()
    for number in range(20):
        queue.ask(key(number))
    queue.answered(key(0), CancelAnswer.UNKNOWN_GOAL, world.clock.now())
    for number in range(20):
        queue.stop(key(number))
    sent = len(world.sent)
    world.clock.advance(100.0)
    assert len(world.sent) == sent
    assert len(queue) == 0
    assert len(world.clock.queue) == 0
    world.queue().ask(key(100))  # their places are free
    assert world.keys[-1] == key(100)


def test_one_that_closes_gives_its_places_back(world: World) -> None:
    closing, other = world.queue(), world.queue()
    for number in range(20):
        closing.ask(key(number))
    other.ask(key(100))
    closing.close()
    assert world.keys[WINDOW:] == [key(100)]
    other.answered(key(100), CancelAnswer.TERMINATED, world.clock.now())
    assert len(world.clock.queue) == 0


def test_progress_is_a_confirmation_while_others_wait_for_their_turn(world: World) -> None:
    queue, other = world.queue(), world.queue()
    assert world.window.progressed_at == -math.inf
    queue.ask(key(100))
    # Nobody waits: this goal alone is of no use to others.
    queue.answered(key(100), CancelAnswer.TERMINATED, world.clock.now())
    assert world.window.progressed_at == -math.inf
    for number in range(WINDOW + 2):
        queue.ask(key(number))
    other.ask(key(200))
    world.clock.advance(0.125)
    queue.answered(key(1), CancelAnswer.UNKNOWN_GOAL, world.clock.now())  # it may not even be there
    assert world.window.progressed_at == -math.inf
    queue.answered(key(2), CancelAnswer.TERMINATED, world.clock.now())
    assert world.window.progressed_at == 100.125
    queue.answered(key(300), CancelAnswer.TERMINATED, world.clock.now())  # nobody asked
    assert world.window.progressed_at == 100.125


@pytest.mark.parametrize("urgent", [False, True])
def test_progress_counts_also_where_the_window_has_just_become_wider(
    world: World, urgent: bool
) -> None:
    queue, other = world.queue(), world.queue()
    queue.ask(key(1))
    world.clock.advance(2.0)  # unanswered, so that one place is left
    other.ask(key(2), urgent=urgent)
    queue.answered(key(1), CancelAnswer.TERMINATED, world.clock.now())
    assert world.window.progressed_at == world.clock.now()


def test_progress_counts_while_all_places_are_taken(world: World) -> None:
    queue = world.queue()
    for number in range(WINDOW):
        queue.ask(key(number))
    world.clock.advance(0.125)
    queue.answered(key(0), CancelAnswer.TERMINATED, world.clock.now())
    assert world.window.progressed_at == 100.125


def test_the_progress_of_others_counts(world: World) -> None:
    world.window.note_progress_of_others(100.5)
    assert world.window.progressed_at == 100.5


steps = st.lists(
    st.one_of(
        st.tuples(
            st.sampled_from(["ask", "urgent", "known", "unknown", "forget"]), st.integers(0, 30)
        ),
        st.tuples(st.just("wait"), st.integers(0, 40)),
    ),
    max_size=150,
)


@given(steps)
def test_any_order_of_events(steps: list[tuple[str, int]]) -> None:
    world = World()
    queues = [world.queue(), world.queue()]
    wanted: set[int] = set()
    for what, number in steps:
        queue = queues[number % 2]
        if what == "wait":
            world.clock.advance(number / 4)
        elif what in ("ask", "urgent"):
            queue.ask(key(number), urgent=what == "urgent")
            wanted.add(number)
        elif what == "forget":
            queue.stop(key(number))
            wanted.discard(number)
        else:
            known, now = what == "known", world.clock.now()
            answer = CancelAnswer.TERMINATED if known else CancelAnswer.UNKNOWN_GOAL
            queue.answered(key(number), answer, now)
            if what == "known":
                wanted.discard(number)
        assert (
            world.window._taken == sum(len(each._outbox._unanswered) for each in queues) <= WINDOW
        )
        assert sum(map(len, queues)) == len(wanted)
    before = len(world.sent)
    world.clock.advance(120.0)
    assert {key(number) for number in wanted} == set(world.keys[before:])
    for queue in queues:
        queue.close()
    assert world.window._taken == 0
    assert len(world.clock.queue) == 0
