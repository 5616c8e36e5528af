"""When the status topic is read, on a clock that the test moves."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.exceptions import InvalidHandle

from actionkit._ros.answers.status import StatusWatch
from tests.unit.clock import CommunicationThread
from tests.unit.test_wire import status_array

OURS, THEIRS = bytes([1]) * 16, bytes([2]) * 16
ACCEPTED, EXECUTING, CANCELING, SUCCEEDED, CANCELED = 1, 2, 3, 4, 5


class World:
    """A status topic, and what is told of it."""

    def __init__(self) -> None:
        self.thread = CommunicationThread()
        self.up = True
        self.thread.context = SimpleNamespace(ok=lambda: self.up)  # type: ignore[attr-defined]
        self.told: list[tuple[bytes, int]] = []
        self.goals: dict[bytes, Any] = {OURS: None}
        self.source: Any = None
        self.error: Exception | None = None
        self.reads = 0
        self.awaits_cancels = False
        self.canceled_others = 0
        self.watch = self.make_watch(lambda goal, code: self.told.append((goal, code)))

    def make_watch(self, on_state: Any) -> StatusWatch:
        return StatusWatch(
            self.thread,  # type: ignore[arg-type]
            self,  # type: ignore[arg-type]
            self.goals,
            on_state,
            awaits_cancels=lambda: self.awaits_cancels,
            on_cancels=self.note_cancels,
        )

    def note_cancels(self) -> None:
        self.canceled_others += 1

    # -- the entities --------------------------------------------------------------------------

    def subscribe_status(self, on_status: Any) -> Any:
        if self.error is not None:
            raise self.error
        assert self.source is None
        self.source = SimpleNamespaceWithHash(take=self.take, on_readable=on_status)
        self.queue: list[bytes] = []
        return self.source

    def unsubscribe_status(self, source: Any) -> None:
        assert source is self.source
        assert source not in self.thread.sources
        self.source = None

    def take(self) -> list[bytes]:
        self.reads += 1
        taken, self.queue = self.queue, []
        return taken

    def come(self, *goals: tuple[bytes, int]) -> None:
        """Let a message come, and the thread read it if it waits for it."""
        self.queue = [status_array(goals)]
        if self.source in self.thread.sources:
            self.source.on_readable()


class SimpleNamespaceWithHash(SimpleNamespace):
    __hash__ = object.__hash__


@pytest.fixture
def world() -> World:
    return World()


def test_our_goals_states_are_told_while_it_is_started(world: World) -> None:
    world.watch.take_now()
    assert world.source is None
    world.watch.start()
    world.watch.start()
    world.come((THEIRS, EXECUTING), (OURS, ACCEPTED))
    assert world.told == [(OURS, ACCEPTED)]
    world.watch.stop()
    world.watch.stop()
    assert (world.source, world.thread.sources, len(world.thread.queue)) == (None, set(), 0)
    world.watch.take_now()
    world.watch.start()
    world.watch.stop()  # while it is waited for
    world.watch.start()
    world.come((OURS, EXECUTING))
    assert world.told[1:] == [(OURS, EXECUTING)]


def test_a_busy_server_is_read_ten_times_a_second(world: World) -> None:
    world.watch.start()
    for _ in range(1000):
        world.come((OURS, EXECUTING))
        world.thread.advance(0.001)
    assert 10 <= world.reads <= 11
    world.come((OURS, SUCCEEDED))
    world.thread.advance(0.1)  # a wait set is ready at once for what has come in a pause
    assert world.source in world.thread.sources


def test_what_has_come_can_be_read_within_the_pause(world: World) -> None:
    world.watch.start()
    world.come((OURS, ACCEPTED))
    world.come((OURS, EXECUTING))
    assert world.told == [(OURS, ACCEPTED)]
    world.watch.take_now()
    assert world.told == [(OURS, ACCEPTED), (OURS, EXECUTING)]


def test_each_of_several_messages_counts(world: World) -> None:
    """The second may be of another server, or no longer show that somebody cancels the goal."""
    world.watch.start()
    world.queue = [
        status_array([(OURS, CANCELING)]),
        status_array([(THEIRS, EXECUTING)]),
        status_array([(OURS, CANCELED)]),
    ]
    world.watch.take_now()
    assert world.told == [(OURS, CANCELING), (OURS, CANCELED)]


def test_it_may_be_stopped_by_what_it_tells(world: World) -> None:
    world.goals[THEIRS] = None
    watch = world.make_watch(
        lambda goal, code: (world.told.append((goal, code)), world.goals.clear(), watch.stop())  # type: ignore[func-returns-value]
    )
    watch.start()
    world.come((OURS, SUCCEEDED), (THEIRS, SUCCEEDED))
    assert len(world.told) == 2
    assert (world.source, world.thread.sources, len(world.thread.queue)) == (None, set(), 0)


def test_nothing_can_be_subscribed_to_after_the_shutdown_of_the_context(world: World) -> None:
    world.error, world.up = InvalidHandle("for the test"), False
    world.watch.start()
    world.watch.take_now()
    world.watch.stop()
    assert world.thread.sources == set()
    world.up = True
    with pytest.raises(InvalidHandle):
        world.watch.start()


def canceled(count: int) -> list[tuple[bytes, int]]:
    """Return goals of others, so many of which were cancelled, or are being."""
    codes = [CANCELING, CANCELED] * count + [EXECUTING, SUCCEEDED] * 3
    return [(bytes([n]) * 16, code) for n, code in enumerate(codes[count:], 10)]


def test_a_server_that_goes_on_cancelling_is_told_of_while_ours_await_that(world: World) -> None:
    world.watch.start()

    def come(count: int) -> int:
        world.thread.advance(0.2)
        world.come((OURS, EXECUTING), *canceled(count))
        return world.canceled_others

    assert [come(count) for count in (0, 1, 2)] == [0, 0, 0]  # nobody awaits it
    world.awaits_cancels = True
    assert [come(count) for count in (2, 2, 3, 3, 5)] == [0, 0, 1, 1, 2]
    # Of two servers on one name each tells its own, and a server forgets goals.
    assert [come(count) for count in (1, 5, 1, 6)] == [2, 2, 2, 3]
    world.awaits_cancels = False
    assert come(9) == 3
    world.awaits_cancels = True
    assert [come(count) for count in (9, 10)] == [3, 4]
