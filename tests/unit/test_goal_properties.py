"""The life of a goal under every order of events.

What must hold is in goal_life, and is checked after each event. Here the events come: each
one in each reachable situation for the first steps, and at random for long lives.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from goal_life import UNTIL_ACCEPTED, UNTIL_SENT, Life
from hunting import examples, steps
from hypothesis import given
from hypothesis import strategies as st

from actionkit._goal.effects import AskCancel, Release
from actionkit._goal.stages import CancelReason, Stage
from actionkit._model.cancel_answer import CancelAnswer
from actionkit._model.values import CancelReport, GoalState

Event = tuple[Any, ...]

RESULT = object()
EVENTS: list[Event] = [
    ("server_ready",),
    ("server_back",),
    ("accepted",),
    ("rejected",),
    ("feedback",),
    ("cancel",),
    ("server_lost", "gone"),
    ("fail", "broken", RuntimeError()),
    ("close", True),
    ("close", False),
    ("attach again",),
    *(
        ("status", GoalState(name))
        for name in ("ACCEPTED", "EXECUTING", "CANCELING", "SUCCEEDED", "CANCELED", "ABORTED")
    ),
    *(("result", GoalState(name), RESULT) for name in ("SUCCEEDED", "CANCELED", "ABORTED")),
    ("result", None, RESULT),
    *(("cancel_answered", answer) for answer in CancelAnswer),
    ("late", "result", None, RESULT),
    ("late", "cancel_answered", CancelAnswer.REFUSED),
]
LIMITS: list[dict[str, Any]] = [
    {},
    {"server": None, "accept": None},
    {"feedback": 3.0},
    {"deadline": 6.0},
    {"deadline": 6.0, "accept": 1.0, "feedback": 3.0},
    {"deadline": 1.0, "cancel": 0.0},
]

SUBTLE: dict[str, tuple[dict[str, float | None], list[Event]]] = {
    # Orders of events that are easily got wrong: the promise at stake, the limits, and what
    # happens once the goal was sent.
    "the machine takes every event": (
        {},
        [("cancel",), *2 * [("cancel_answered", CancelAnswer.REFUSED)]],
    ),
    "the limit Timer.STALL is kept": (
        {"feedback": 3.0},
        [("cancel",), ("cancel_answered", CancelAnswer.REFUSED)],
    ),
    "a caller that left has no timers": (
        {"feedback": 3.0},
        [("server_lost", "gone"), ("accepted",), ("feedback",)],
    ),
    "UNKNOWN means that no terminal state was seen": (
        {},
        [("cancel",), ("status", GoalState.CANCELED), ("server_lost", "gone")],
    ),
    "our cancel is nobody else's": (
        {},
        [
            ("cancel",),
            ("cancel_answered", CancelAnswer.ACCEPTED),
            ("cancel_answered", CancelAnswer.REFUSED),
            ("result", GoalState.CANCELED, RESULT),
        ],
    ),
}


def happens(life: Life, event: Event) -> None:
    name, *args = event
    if name == "accepted" and life.goal.facts.yeses:
        return  # it would be the answer of a second server
    if name == "attach again":
        life.attach_again()
    elif name == "close":
        life.tell("close", abandon=args[0])
    elif name == "fire":
        life.fire(args[0])
    elif name == "wait":
        life.wait_until(life.now + args[0])
    elif name == "late":  # the answer to a request of a while ago
        if life.cancel_asked or args[0] == "result":
            life.tell(*args, asked_at=life.now - 1.0)
    elif name == "others":
        life.others_confirmed_at = life.now
    elif name != "cancel_answered" or life.cancel_asked:  # nobody answers what was not asked
        life.tell(name, *args)


@pytest.mark.parametrize("promise", SUBTLE)
def test_subtle_orders(promise: str) -> None:
    limits, events = SUBTLE[promise]
    life = Life(**limits)
    life.see(*UNTIL_SENT)
    for event in events:
        happens(life, event)


# --- every order -------------------------------------------------------------------------------


def next_lives(life: Life) -> Iterator[Life]:
    """Yield what becomes of a life with each event, and with the timer that is due first."""
    first = min(life.timers.values(), default=None)
    due = [("fire", timer) for timer, at in life.timers.items() if at == first]
    for event in [*EVENTS, *due]:
        if event == ("server_back",) and not life.server.lost:
            continue  # the same as server_ready
        twin = life.copy()
        happens(twin, event)
        yield twin


@pytest.mark.parametrize(
    "limits",
    [
        each if each in LIMITS[::4] else pytest.param(each, marks=pytest.mark.long)
        for each in LIMITS
    ],
    ids=str,
)
def test_every_order_of_the_first_events(limits: dict[str, float | None]) -> None:
    life = Life(**limits)
    life.see("sent")
    seen = {life.situation()}
    frontier = [life]
    reached: set[Stage] = set()
    for _ in range(steps(4)):
        found = []
        for each in frontier:
            for twin in next_lives(each):
                reached.add(twin.goal.stage)
                situation = twin.situation()
                if situation not in seen:
                    seen.add(situation)
                    found.append(twin)
        frontier = found
    assert reached == set(Stage) - {Stage.ANOTHER_MAY_RUN}


# --- long lives --------------------------------------------------------------------------------

seconds = st.sampled_from([0.0, 0.125, 0.5, 1.0, 3.0, 10.0])
limits = st.one_of(st.none(), seconds)
orders = st.lists(
    st.one_of(st.sampled_from([*EVENTS, ("others",)]), st.tuples(st.just("wait"), seconds)),
    max_size=60,
)
begun = st.sampled_from([UNTIL_SENT, UNTIL_ACCEPTED])


def lead(life: Life, beginning: tuple[str, ...], events: list[Event]) -> None:
    life.see(*beginning)
    for event in events:
        happens(life, event)


@examples(500)
@given(limits, limits, limits, limits, seconds, begun, orders)
def test_long_lives(
    deadline: float | None,
    server: float | None,
    accept: float | None,
    feedback: float | None,
    cancel: float,
    beginning: tuple[str, ...],
    events: list[Event],
) -> None:
    life = Life(deadline, server=server, accept=accept, feedback=feedback, cancel=cancel)
    lead(life, beginning, events)
    if life.deadline is not None:
        life.wait_until(life.deadline + cancel)
        assert life.ending is not None  # (C2.3)
    assert life.count(Release) <= 1


@examples(300)
@given(begun, orders)
def test_silence_ends_every_goal_with_limits(
    beginning: tuple[str, ...], events: list[Event]
) -> None:
    """Whatever happened so far: when nobody says anything more, the limits end it.

    But what a server is cancelling, for others or for an earlier call, is waited for: the call's
    deadline ends that.
    """
    life = Life(server=5.0, accept=5.0, feedback=5.0, cancel=2.0)
    lead(life, beginning, events)
    life.wait_until(life.now + 30.0)
    is_cancelled = life.server.others_cancel or life.cancelled_before
    assert life.ending is not None or is_cancelled


@examples(300)
@given(orders, st.sampled_from([GoalState.SUCCEEDED, GoalState.CANCELED, GoalState.ABORTED]))
def test_whatever_happened_the_result_of_a_goal_in_flight_ends_it(
    events: list[Event], status: GoalState
) -> None:
    life = Life(10.0)
    lead(life, UNTIL_SENT, events)
    if life.in_flight:
        life.tell("result", status, RESULT)
        assert life.ending is not None
        assert life.goal.stage is Stage.OVER
        assert life.timers == {}


@examples(300)
@given(begun, orders)
def test_a_goal_given_up_in_flight_is_watched_until_it_is_known_to_run_no_more(
    beginning: tuple[str, ...], events: list[Event]
) -> None:
    life = Life(1.0)
    lead(life, beginning, events)
    if life.ending is not None and life.ending.cancel in (
        CancelReport.UNKNOWN,
        CancelReport.REFUSED,
    ):
        over = life.left_alone or life.server.ended or not life.server.has_it
        forgotten = ("cancel_answered", CancelAnswer.UNKNOWN_GOAL) in life.told
        assert life.count(Release) <= (over or forgotten or life.server.rejected)


def test_known_reasons_to_give_up_are_all_reachable() -> None:
    reasons = set()
    for event in (("cancel",), ("wait", 5.0), ("close", False)):
        for beginning in (UNTIL_SENT, UNTIL_ACCEPTED):
            life = Life(None, feedback=4.0)
            life.see(*beginning)
            happens(life, event)
            reasons.add(life.goal.cancel_reason)
    life = Life(1.0)
    life.see(*UNTIL_ACCEPTED)
    life.wait_until(1.0)
    assert AskCancel() in life.all
    assert reasons | {life.goal.cancel_reason} == set(CancelReason)
