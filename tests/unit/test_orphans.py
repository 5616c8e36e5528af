"""Goals that ended here and may be running on another server (R14)."""

from __future__ import annotations

from collections import Counter
from itertools import count, pairwise

import pytest

from actionkit._ros.orphans import OrphanedGoals
from actionkit._ros.outbox import Window
from tests.conftest import all_is_logged
from tests.unit.clock import Clock

KEY = bytes(range(16))
STILL_RUNNING = "MAY STILL BE RUNNING"


class World:
    """A clock, and the cancel requests that are sent by it."""

    def __init__(self, window: Window | None = None) -> None:
        self.clock = Clock()
        self.servers = 1
        self.numbers = count(1)
        self.sent: list[tuple[float, bytes, int]] = []
        self.orphans = OrphanedGoals(
            self.clock,
            "/arm",
            count_servers=lambda: self.servers,
            window=window or Window(),
            cancel=self.cancel,
            on_change=lambda: None,
        )
        self.none_confirmed = 0
        self.orphans.on_none_confirmed = self.on_none_confirmed

    def on_none_confirmed(self) -> None:
        assert not self.orphans.confirmed
        self.none_confirmed += 1

    def cancel(self, key: bytes) -> int:
        seq = next(self.numbers)
        self.sent.append((self.clock.now(), key, seq))
        return seq

    def ended(self, seq: int = 1, key: bytes = KEY, *, accepted: int = 1) -> None:
        self.orphans.ended(seq, key, accepted=accepted)

    def canceling(self) -> None:
        self.orphans.answered(self.sent[-1][2], {KEY}, over=False)

    def over(self) -> None:
        self.orphans.answered(self.sent[-1][2], set(), over=True)

    def unknown(self) -> None:
        self.orphans.answered(self.sent[-1][2], set(), over=False)

    def refused(self) -> None:
        self.orphans.answered(self.sent[-1][2], set(), over=False)

    @property
    def keys(self) -> list[bytes]:
        """The goals that were to be cancelled, in order."""
        return [key for _, key, _ in self.sent]

    @property
    def at_rest(self) -> bool:
        """Whether nothing is done, awaited or kept for any of them any more."""
        before = len(self.sent)
        self.clock.advance(100)
        left = len(self.orphans) + len(self.orphans.requests) + len(self.clock.queue)
        return len(self.sent) == before and left == 0


@pytest.fixture
def world() -> World:
    return World()


def test_what_ended_on_one_server_is_cancelled_where_it_is_accepted_late(world: World) -> None:
    world.ended()
    world.clock.advance(5)
    assert not world.sent  # one server, one acceptance: the usual case costs nothing
    world.orphans.accepted_late(1)
    assert world.orphans.confirmed
    world.clock.advance(0.1)
    assert world.keys == [KEY]
    world.over()  # says the one on which it has ended
    assert world.orphans.confirmed
    assert world.none_confirmed == 0
    world.canceling()
    assert not world.orphans.confirmed
    assert world.none_confirmed == 1  # so a client that is closed may go
    assert world.at_rest


def test_a_lost_cancel_is_sent_again_and_what_comes_of_it_is_told(
    world: World, caplog: pytest.LogCaptureFixture
) -> None:
    world.ended()
    world.orphans.accepted_late(1)
    world.clock.advance(3)
    assert len(world.sent) == 3
    world.over()
    world.refused()
    world.clock.advance(100)
    times = [at for at, _, _ in world.sent]
    pauses = [b - a for a, b in pairwise(times)]
    assert pauses == [0.5, 1.0, 2.0, 4.0]
    assert all_is_logged()
    assert [record.getMessage() for record in caplog.records] == [
        "goal 00010203-0405-0607-0809-0a0b0c0d0e0f of action /arm was accepted by a server after it"
        " had ended for its caller, and that server did not confirm its cancellation: IT"
        " MAY STILL BE RUNNING. Two servers on one name both run every goal: keep one of them"
    ]
    assert world.at_rest


def test_where_it_has_ended_everywhere_nothing_is_sent_again(
    world: World, caplog: pytest.LogCaptureFixture
) -> None:
    world.ended()
    world.orphans.accepted_late(1)
    world.clock.advance(0.1)
    world.over()
    world.over()
    assert world.at_rest
    assert len(world.sent) == 1
    assert all_is_logged()
    assert not caplog.records


def test_the_same_answer_to_two_requests_is_not_taken_for_two_servers(world: World) -> None:
    world.ended()
    world.orphans.accepted_late(1)
    world.clock.advance(0.1)
    world.over()
    world.clock.advance(0.6)
    world.over()
    assert world.orphans.confirmed


def test_with_two_servers_both_are_asked_until_both_have_answered(world: World) -> None:
    world.servers = 2
    world.ended()
    assert len(world.sent) == 1
    world.over()
    world.clock.advance(1)
    assert len(world.sent) == 2  # one answer was lost, or the request
    world.over()
    assert len(world.orphans) == 1
    world.unknown()
    assert len(world.orphans) == 0  # both have answered the same request
    assert world.at_rest
    assert len(world.sent) == 2


def test_late_acceptances_are_waited_for_where_there_are_several_servers(world: World) -> None:
    world.ended()
    assert not world.orphans.awaited
    world.servers = 2
    assert len(world.orphans.awaited) == 1


def test_each_of_two_late_servers_must_stop_it(world: World) -> None:
    world.ended()
    for _ in range(2):
        world.orphans.accepted_late(1)
    world.clock.advance(0.1)
    world.canceling()
    assert world.orphans.confirmed
    world.canceling()
    assert world.at_rest


def test_it_has_ended_everywhere_only_where_all_that_accepted_it_say_so(world: World) -> None:
    world.ended()
    for _ in range(2):
        world.orphans.accepted_late(1)
    world.clock.advance(0.1)
    world.over()
    world.canceling()
    assert world.orphans.confirmed  # the third has not answered
    world.over()
    assert world.at_rest


def test_the_late_acceptance_of_the_only_server(world: World) -> None:
    world.ended(accepted=0)
    world.orphans.accepted_late(1)
    world.clock.advance(0.1)
    world.over()
    assert world.at_rest


def test_a_server_that_comes_is_asked_to_cancel_what_ended_lately(
    world: World, caplog: pytest.LogCaptureFixture
) -> None:
    old, recent = keys(range(2))
    world.ended(1, old)
    world.clock.advance(0.5)
    world.ended(2, recent)
    world.clock.advance(20)
    world.ended(3)
    world.orphans.server_came()
    assert not world.orphans.confirmed
    world.clock.advance(100)
    assert Counter(world.keys) == {recent: 2, KEY: 2}
    assert all_is_logged()
    assert not caplog.records  # nothing shows that it ever had the goal
    assert world.at_rest


@pytest.mark.parametrize("servers", [1, 2])
def test_what_it_says_it_cancels_is_not_asked_for_again(world: World, servers: int) -> None:
    world.ended()
    world.servers = servers
    world.orphans.server_came()
    world.clock.advance(0.1)
    world.canceling()
    assert world.at_rest
    assert len(world.sent) == 1


def test_what_was_guessed_and_is_then_proven_is_asked_for_in_earnest(world: World) -> None:
    world.ended()
    world.orphans.server_came()
    world.clock.advance(0.6)
    assert len(world.sent) == 2
    world.orphans.accepted_late(1)
    world.clock.advance(100)
    assert len(world.sent) == 7
    assert world.at_rest


def keys(numbers: range) -> list[bytes]:
    return [number.to_bytes(16, "big") for number in numbers]


def test_no_more_is_asked_for_than_fits_into_a_servers_queue(world: World) -> None:
    for number, key in enumerate(keys(range(256))):
        world.ended(number, key)
    for number in range(256):
        world.orphans.accepted_late(number)
    # As many are on the way as are unanswered, and one that is not answered is lost some day.
    assert world.keys == keys(range(4))
    world.orphans.answered(world.sent[0][2], {world.sent[0][1]}, over=False)
    assert world.keys == keys(range(5))
    world.clock.advance(0.3)
    assert world.keys == keys(range(9))
    world.clock.advance(100)
    assert set(world.keys) == set(keys(range(256)))
    later = [at for at, _, _ in world.sent[5:]]
    assert max(Counter(later).values()) == 4
    assert world.at_rest


def test_what_is_over_while_it_waits_for_its_turn_takes_no_place() -> None:
    window = Window(1)
    world = World(window)
    world.servers = 3
    world.ended(accepted=2)
    world.orphans.accepted_late(1)  # it must be asked for again, and waits for its own request
    world.canceling()
    world.canceling()  # a second server, to the same request
    assert world.at_rest
    assert window.enter(lambda: None)  # else nobody could cancel anything in this process any more


def test_what_all_servers_have_answered_holds_nobody_up() -> None:
    window = Window(1)
    world = World(window)
    world.ended()
    world.orphans.accepted_late(1)
    world.refused()
    assert world.orphans.confirmed
    assert window.enter(lambda: None)


def test_what_is_proven_before_its_turn_comes_is_asked_for_once() -> None:
    window = Window(1)
    assert window.enter(lambda: None)
    world = World(window)
    world.servers = 2
    world.ended()
    world.orphans.accepted_late(1)
    window.leave()
    world.clock.advance(0.4)
    assert world.keys == [KEY]


def test_the_newest_are_remembered(world: World) -> None:
    for number, key in enumerate(keys(range(1000))):
        world.ended(number, key)
    for number in range(1000):
        world.orphans.accepted_late(number)
    world.clock.advance(100)
    assert set(world.keys) == set(keys(range(1000 - 256, 1000)))


def test_what_is_proven_goes_before_what_is_guessed(world: World) -> None:
    for number, key in enumerate(keys(range(100))):
        world.ended(number, key)
    world.orphans.server_came()
    world.orphans.accepted_late(99)
    world.clock.advance(0.3)
    proven = keys(range(99, 100))
    assert world.keys[4:6] == proven + keys(range(4, 5))
    world.clock.advance(5)
    assert [at for at, key, _ in world.sent if [key] == proven][:2] == pytest.approx([100.2, 100.8])
    guessed = [key for key in world.keys if [key] != proven]
    assert guessed[:99] == keys(range(99))  # each has its turn before any is asked for again


def test_what_is_guessed_does_not_pile_up(world: World) -> None:
    world.servers = 2  # one of which is dead, and answers nothing
    for number, key in enumerate(keys(range(1000))):
        world.ended(number, key)
    assert len(world.orphans) == 256 + 4
    world.clock.advance(100)
    assert world.at_rest


def test_closing_tells_of_what_may_be_running(
    world: World, caplog: pytest.LogCaptureFixture
) -> None:
    for number, key in enumerate(keys(range(10))):
        world.ended(number, key)
        world.orphans.accepted_late(number)
    world.orphans.close()
    assert all_is_logged()
    assert caplog.text.count(STILL_RUNNING) == 10
    assert world.at_rest
    world.ended()
    world.orphans.accepted_late(1)
    assert len(world.sent) == 4  # as before it closed


def test_who_has_closed_waits_for_no_turn() -> None:
    window = Window(1)
    assert window.enter(lambda: None)
    world = World(window)
    world.ended()
    world.orphans.accepted_late(1)
    world.orphans.close()
    assert not any(window._waiting)
    assert world.at_rest
