"""What a new goal waits for that is to replace another one (C1.15)."""

from __future__ import annotations

import re
import uuid
from collections.abc import Callable
from typing import Any

import pytest

from actionkit import GoalFate, GoalReport
from actionkit._calls.futures.call_view import GoalsOfCall
from actionkit._calls.sending import replacing
from actionkit._calls.sending.replacing import Replacing, check_replaces, not_stopped, to_replace
from actionkit._goal.facts import GoalFacts
from tests.unit.call_life import CallLife
from tests.unit.clock import Clock


class Earlier:
    """The future of an earlier call, as far as it is looked at."""

    def __init__(self, goals: int = 1, *, to_replace: tuple[Any, ...] = ()) -> None:
        self.facts = [GoalFacts(uuid.uuid4(), accepted=True) for _ in range(goals)]
        self.goals = GoalsOfCall(self.facts)
        self.to_replace = to_replace
        self.over = False
        self.cancels = 0
        self._call = self

    def done(self) -> bool:
        return self.over

    def cancel(self) -> None:
        self.cancels += 1

    def stop(self) -> None:
        """Its call ends, and all its goals have stopped."""
        self.over = True
        for facts in self.facts:
            facts.over = facts.ended = True


class World(Clock):
    """A session, and a new call that is to replace earlier ones."""

    def __init__(self, *earlier: Any) -> None:
        super().__init__()
        self.on_goals_changed: set[Callable[[], None]] = set()
        self.sent = 0
        self.kept: list[tuple[GoalReport, ...]] = []
        self.replacing = Replacing(earlier, self, self.send, self.kept.append)

    def monotonic(self) -> float:
        return self.time

    def call_soon(self, callback: Callable[[], None]) -> None: ...

    def send(self) -> None:
        self.sent += 1

    def goals_change(self) -> None:
        for look in list(self.on_goals_changed):
            look()

    @property
    def waits(self) -> bool:
        return bool(self.on_goals_changed) and len(self.queue) == 1

    @property
    def at_rest(self) -> bool:
        return not self.on_goals_changed and len(self.queue) == 0


@pytest.fixture
def begun(monkeypatch: pytest.MonkeyPatch) -> Callable[..., World]:
    """Begin to replace calls, within two seconds."""

    def begin(*earlier: Any) -> World:
        world = World(*earlier)
        monkeypatch.setattr(replacing, "time", world)
        world.replacing.begin(2.0)
        return world

    return begin


def test_the_new_goal_is_sent_when_all_earlier_ones_have_stopped(
    begun: Callable[..., World],
) -> None:
    first, second = Earlier(), Earlier()
    world = begun(first, second)
    assert (first.cancels, second.cancels) == (1, 1)
    first.stop()
    world.goals_change()
    assert world.waits
    assert not world.sent
    second.stop()
    world.goals_change()
    assert (world.sent, world.kept) == (1, [])
    assert world.at_rest
    world.advance(10.0)
    assert (world.sent, world.kept) == (1, [])


def test_it_is_sent_at_once_if_they_stop_when_they_are_cancelled(
    begun: Callable[..., World],
) -> None:
    earlier = Earlier()
    earlier.cancel = earlier.stop  # type: ignore[method-assign]
    world = begun(earlier)
    assert world.sent == 1
    assert world.at_rest


def test_when_the_time_is_up_the_goals_that_may_run_are_named_and_nothing_is_sent(
    begun: Callable[..., World],
) -> None:
    stopped, first, second = Earlier(), Earlier(goals=2), Earlier()
    stopped.stop()
    first.facts[0].over = first.facts[0].ended = True
    first.over = True  # its call ended, and one of its goals may run
    world = begun(stopped, first, second)
    world.advance(1.9)
    assert world.waits
    world.advance(0.1)
    running = first.facts[1].goal_id, second.facts[0].goal_id
    assert world.kept == [tuple(GoalReport(each, GoalFate.RUNNING) for each in running)]
    assert world.at_rest
    first.stop()
    second.stop()
    world.goals_change()
    assert not world.sent


def test_it_is_sent_if_they_are_seen_to_have_stopped_when_the_time_is_up(
    begun: Callable[..., World],
) -> None:
    earlier = Earlier()
    world = begun(earlier)
    earlier.stop()
    world.advance(2.0)
    assert (world.sent, world.kept) == (1, [])
    assert world.at_rest


def test_who_waits_no_more_is_told_nothing(begun: Callable[..., World]) -> None:
    earlier = Earlier()
    world = begun(earlier)
    look = next(iter(world.on_goals_changed))
    world.replacing.drop()
    assert world.at_rest
    world.replacing.drop()
    earlier.stop()
    look()  # it was about to be told when it was dropped
    world.advance(10.0)
    assert (world.sent, world.kept) == (0, [])
    World(earlier).replacing.drop()  # before it has begun


def test_an_earlier_call_has_stopped_when_it_is_over_and_none_of_its_goals_may_run() -> None:
    calls: Any = [Earlier(), Earlier(goals=2), Earlier(), Earlier()]
    stopped, lives_on, may_send, running = calls
    stopped.stop()
    lives_on.over = True  # one of its goals was lost, or its cancel refused
    lives_on.facts[1].over = True
    may_send.facts[0].over = True  # in the pause before it is tried again
    assert not_stopped(calls) == (lives_on, may_send, running)


def test_what_the_earlier_call_was_to_replace_is_replaced_too() -> None:
    first: Any = Earlier()
    second: Any = Earlier(to_replace=(first,))
    assert to_replace(second) == (second, first)
    assert to_replace(None) == ()


# --- the arguments of a call -------------------------------------------------------------------


@pytest.mark.parametrize("preempt", [False, True])
def test_a_future_of_the_same_client_can_be_replaced(preempt: bool) -> None:
    life = CallLife()
    check_replaces(None, False, life)
    check_replaces(life.call.future, preempt, life)


def test_a_future_of_another_client_cannot() -> None:
    other = CallLife().call.future
    told = f"replaces={other!r} is of another client: give a future of the client that calls"
    with pytest.raises(ValueError, match=f"^{re.escape(told)}$"):
        check_replaces(other, False, CallLife())


@pytest.mark.parametrize(
    ("replaces", "preempt", "error", "text"),
    [
        (None, 1, TypeError, "preempt=1 must be True or False"),
        (None, None, TypeError, "preempt=None must be True or False"),
        (7, False, TypeError, "replaces=7 must be a GoalFuture"),
        (
            None,
            True,
            ValueError,
            "preempt=True needs replaces=, the future of the goal to replace",
        ),
    ],
)
def test_wrong_arguments(
    replaces: object, preempt: object, error: type[Exception], text: str
) -> None:
    with pytest.raises(error) as caught:
        check_replaces(replaces, preempt, None)
    assert str(caught.value) == text
