"""The timeline of a call: in order, and with limited memory (contract C6.1)."""

from __future__ import annotations

import itertools
import pickle
import re
import time
import uuid
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from actionkit import (
    CancelReport,
    DeadlineExceededError,
    GoalEvent,
    GoalFate,
    GoalState,
    Outcome,
    Timeline,
)
from actionkit._model.timeline import Recorder

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


def test_what_happens_between_two_messages_of_feedback_is_kept() -> None:
    make, timeline = event_maker(), Recorder()
    states = (GoalState.FEEDBACK, GoalState.FEEDBACK, GoalState.CANCELING, GoalState.FEEDBACK)
    added = [make(state) for state in states]
    for event in added:
        timeline.add(event)
    assert timeline.events() == (added[0], added[2], added[3])


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
    added.append(make(GoalState.RETRYING))
    timeline.add(added[-1])
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


def test_a_call_with_very_many_goals_that_all_send_feedback_is_bounded() -> None:
    make, timeline = event_maker(), Recorder()
    for number in range(20 * MOST):
        for _ in range(3):
            timeline.add(make(GoalState.FEEDBACK, uuid.UUID(int=number)))
    assert len(timeline.events()) <= MOST
    held = sum(len(value) for value in vars(timeline).values() if hasattr(value, "__len__"))
    assert held <= MOST


def test_each_goal_counts_its_feedback_from_one() -> None:
    recorder = Recorder()
    told = ((GOALS[0], 1), (GOALS[0], 2), (GOALS[1], 1))
    counted = [list(recorder.count_feedback(*each)) for each in told]
    assert counted == [[1], [2, 3], [1]]


# --- as text -----------------------------------------------------------------------------------


def event(
    state: GoalState, at: float, attempt: int = 1, goal: int = 0, detail: str = ""
) -> GoalEvent:
    return GoalEvent(GOALS[goal], attempt, state, 100.0 + at, 1_700_000_000.25 + at, detail)


STORY = Timeline(
    [
        event(GoalState.SENDING, 0.0),
        event(GoalState.SENT, 0.0012),
        event(GoalState.FEEDBACK, 0.4, detail="no. 1"),
        event(GoalState.LOST, 12.3456, detail="its server was restarted"),
        event(GoalState.RETRYING, 12.3457, detail="in 0.20 s"),
        event(GoalState.SENDING, 12.6, attempt=2, goal=1),
        event(GoalState.SUCCEEDED, 13.0, attempt=2, goal=1),
    ]
)
TEXT = """\
    0.0 ms  #1  SENDING    goal 00000000-0000-0000-0000-000000000000, at 2023-11-14 22:13:20.250 UTC
    1.2 ms  #1  SENT
  400.0 ms  #1  FEEDBACK   no. 1
12345.6 ms  #1  LOST       its server was restarted
12345.7 ms  #1  RETRYING   in 0.20 s
12600.0 ms  #2  SENDING    goal 00000000-0000-0000-0000-000000000001
13000.0 ms  #2  SUCCEEDED"""


def test_the_text_of_a_timeline(monkeypatch: pytest.MonkeyPatch) -> None:
    assert str(STORY) == TEXT
    printed: list[str] = []
    STORY._repr_pretty_(SimpleNamespace(text=printed.append), False)
    assert printed == [TEXT]
    monkeypatch.setenv("TZ", "XXX-9")  # dates are in UTC everywhere
    try:
        time.tzset()
        assert str(STORY) == TEXT
    finally:
        monkeypatch.undo()
        time.tzset()


def test_the_text_of_nothing() -> None:
    assert str(Timeline()) == "(no events)"


def test_a_timeline_is_a_tuple_and_can_be_pickled() -> None:
    again = pickle.loads(pickle.dumps(STORY))
    assert again == STORY == tuple(STORY)
    assert str(again) == TEXT


TIMES = st.floats(allow_nan=False, allow_infinity=False, width=32)
EVENTS = st.builds(
    GoalEvent,
    goal_id=st.sampled_from(GOALS),
    attempt=st.integers(1, 5),
    state=st.sampled_from(GoalState),
    monotonic=TIMES,
    wall=TIMES,
    detail=st.sampled_from(["", "a reason"]),
)


@given(st.lists(EVENTS, min_size=1, max_size=20))
def test_any_timeline_has_a_line_for_each_event(events: list[GoalEvent]) -> None:
    lines = str(Timeline(events)).split("\n")
    assert len(lines) == len(events)
    for line, each in zip(lines, events, strict=True):
        found = re.match(r" *(-?[0-9.]+) ms  #(\d)  (\w+)", line)
        assert found, line
        assert float(found[1]) == pytest.approx(
            (each.monotonic - events[0].monotonic) * 1000, abs=0.1
        )
        assert (int(found[2]), found[3]) == (each.attempt, each.state.value)
        assert each.detail in line


def test_an_outcome_is_shown_in_one_line() -> None:
    make = event_maker()
    events = Timeline([make(GoalState.SENT)] * 50)
    done = Outcome(
        GoalState.SUCCEEDED, [0] * 1000, None, 1, events, GOALS[0], None, elapsed=1.23456
    )
    assert repr(done) == "<Outcome SUCCEEDED, 1 attempt, 1.235 s>"
    error, confirmed = DeadlineExceededError("too late"), CancelReport.CONFIRMED
    late = Outcome(GoalState.CANCELED, None, error, 2, events, GOALS[0], confirmed, elapsed=3.0)
    told = "<Outcome CANCELED: DeadlineExceededError, 2 attempts, 3.000 s, cancel CONFIRMED>"
    assert repr(late) == told
    assert (done.ok, late.ok) == (True, False)
    assert (done.state, late.state) == (done.status, late.status)


def test_which_states_are_ends_and_which_goals_may_run() -> None:
    ends = {state for state in GoalState if state.is_terminal}
    assert ends == {
        GoalState.REJECTED,
        GoalState.SUCCEEDED,
        GoalState.CANCELED,
        GoalState.ABORTED,
    }
    safe = {fate for fate in GoalFate if not fate.may_run}
    assert safe == {GoalFate.REJECTED, GoalFate.ENDED}


def test_notebooks_get_a_picture_once_something_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    done = Outcome(GoalState.SUCCEEDED, None, None, 1, STORY, GOALS[0], None)
    monkeypatch.setattr("actionkit._model.values.to_html", None)
    assert (STORY._repr_html_(), done._repr_html_()) == (None, None)
    monkeypatch.setattr("actionkit._model.values.to_html", lambda *given: given)
    drawn: tuple[Any, ...] = (STORY._repr_html_(), done._repr_html_())
    assert drawn == ((STORY, None), (STORY, done))
