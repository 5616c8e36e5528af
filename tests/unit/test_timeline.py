"""The story of a call: in order, and bounded in memory (contract C6.1)."""

from __future__ import annotations

import itertools
import uuid
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from actionkit import GoalEvent, GoalState
from actionkit._timeline import Recorder

GOALS = [uuid.UUID(int=number) for number in range(3)]
MOST = 200


def event_maker() -> Callable[..., GoalEvent]:
    times = itertools.count()

    def make(state: GoalState, goal: uuid.UUID = GOALS[0]) -> GoalEvent:
        now = float(next(times))
        return GoalEvent(goal, 1, state, monotonic=now, wall=now)

    return make


def test_events_are_kept_in_order() -> None:
    make, timeline = event_maker(), Recorder()
    added = [make(state) for state in GoalState if state is not GoalState.FEEDBACK]
    for event in added:
        timeline.add(event)
    assert timeline.events() == tuple(added)


@pytest.mark.parametrize("count", [1, 2, 3, 1000])
def test_the_first_and_the_last_feedback_are_kept(count: int) -> None:
    make, timeline = event_maker(), Recorder()
    before = make(GoalState.ACCEPTED)
    timeline.add(before)
    feedback = [make(GoalState.FEEDBACK) for _ in range(count)]
    for event in feedback:
        timeline.add(event)
    after = make(GoalState.SUCCEEDED)
    timeline.add(after)
    kept = feedback if count == 1 else [feedback[0], feedback[-1]]
    assert timeline.events() == (before, *kept, after)


def test_each_goal_of_a_call_keeps_its_own_feedback() -> None:
    make, timeline = event_maker(), Recorder()
    for goal in GOALS:
        for _ in range(5):
            timeline.add(make(GoalState.FEEDBACK, goal))
    assert [event.goal_id for event in timeline.events()] == sorted(GOALS * 2)


def test_what_was_seen_does_not_change() -> None:
    make, timeline = event_maker(), Recorder()
    timeline.add(make(GoalState.SENDING))
    seen = timeline.events()
    timeline.add(make(GoalState.SENT))
    assert len(seen) == 1


def test_a_call_that_goes_on_for_ever_keeps_its_beginning_and_its_end() -> None:
    make, timeline = event_maker(), Recorder()
    added = [make(GoalState.RETRYING) for _ in range(10 * MOST)]
    for event in added:
        timeline.add(event)
    assert timeline.events() == (*added[: MOST // 2], *added[-(MOST // 2) :])


@given(st.lists(st.tuples(st.sampled_from(GoalState), st.sampled_from(GOALS)), max_size=500))
def test_any_story_is_in_order_and_bounded(steps: list[tuple[GoalState, uuid.UUID]]) -> None:
    make, timeline = event_maker(), Recorder()
    for state, goal in steps:
        timeline.add(make(state, goal))
        assert timeline.events()[-1].state is state
    events = timeline.events()
    assert len(events) <= MOST
    times = [event.monotonic for event in events]
    assert times == sorted(set(times))
    for goal in GOALS:
        kept = [e for e in events if e.goal_id == goal and e.state is GoalState.FEEDBACK]
        assert len(kept) <= 2
