"""What is known of a goal on its server: it runs, it does not, or nobody knows."""

from __future__ import annotations

import uuid
from typing import Any

import pytest

from actionkit import GoalFate, GoalState, Timeouts
from actionkit._calls.futures.call_view import GoalsOfCall
from actionkit._goal.effects import Timer
from actionkit._goal.facts import GoalFacts
from actionkit._goal.machine import Goal
from actionkit._goal.stages import CancelReason
from actionkit._model.cancel_answer import CancelAnswer
from actionkit._model.values import GoalReport

TWO_SENT: dict[str, Any] = {"servers": 2}
TWO: dict[str, Any] = {**TWO_SENT, "accepted": True, "yeses": 1}
"""One of two servers has accepted the goal."""
ENDED: dict[str, Any] = {"ended": True, "ends": 1}
FACTS: list[tuple[dict[str, Any], bool, bool | None, GoalFate]] = [
    # What is known; whether it is certain that no server runs it, and whether one is known to.
    ({}, False, None, GoalFate.UNANSWERED),
    ({"noes": 1, "rejected": True}, True, False, GoalFate.REJECTED),
    ({"accepted": True, "yeses": 1}, False, True, GoalFate.RUNNING),
    ({"accepted": True, "refused": True}, False, True, GoalFate.RUNNING),
    ({"accepted": True}, False, True, GoalFate.RUNNING),  # the answer itself was lost
    ({"accepted": True, **ENDED, "over": True}, True, False, GoalFate.ENDED),
    ({"accepted": True, "lost": True}, False, None, GoalFate.LOST),
    ({"lost": True}, False, None, GoalFate.LOST),
    ({"accepted": True, "left": True}, False, None, GoalFate.LEFT),
    ({"accepted": True, "lost": True, "left": True}, False, None, GoalFate.LEFT),
    ({"accepted": True, **ENDED, "over": True, "left": True}, True, False, GoalFate.ENDED),
    # Two servers may have got it.
    (TWO_SENT, False, None, GoalFate.UNANSWERED),
    ({**TWO_SENT, "noes": 1}, False, None, GoalFate.UNANSWERED),
    ({**TWO_SENT, "noes": 2, "rejected": True}, True, False, GoalFate.REJECTED),
    # One has rejected it; that of the other would only be a guess, until the caller relies on it.
    ({**TWO_SENT, "noes": 1, "rejected": True}, False, False, GoalFate.REJECTED),
    ({**TWO_SENT, "noes": 1, "rejected": True, "given_up": True}, False, None, GoalFate.UNANSWERED),
    ({**TWO, "noes": 1}, False, True, GoalFate.RUNNING),
    ({**TWO, **ENDED}, False, False, GoalFate.ENDED),
    ({**TWO, **ENDED, "given_up": True}, False, None, GoalFate.UNANSWERED),
    # Both have answered.
    ({**TWO, **ENDED, "noes": 1, "given_up": True}, False, False, GoalFate.ENDED),
    ({**TWO, **ENDED, "yeses": 2}, False, True, GoalFate.RUNNING),
    ({**TWO, **ENDED, "yeses": 2, "lost": True}, False, None, GoalFate.LOST),
    # One acceptance was lost, and both ends have come.
    ({**TWO, **ENDED, "ends": 2, "given_up": True}, False, False, GoalFate.ENDED),
    # Somebody else has sent it: nobody tells us whether a server has accepted it.
    ({"accepted": True, **ENDED, "servers": 2, "attached": True}, False, None, GoalFate.UNANSWERED),
    ({**ENDED, "over": True, "attached": True}, True, False, GoalFate.ENDED),
]  # fmt: skip


@pytest.mark.parametrize(("known", "over", "runs", "fate"), FACTS, ids=str)
def test_what_follows_from_the_facts(
    known: dict[str, Any], over: bool, runs: bool | None, fate: GoalFate
) -> None:
    facts = GoalFacts(uuid.uuid4(), **known)
    assert facts.is_over is over
    assert facts.known_to_run is runs
    assert facts.may_run is fate.may_run
    assert facts.fate is fate
    assert facts.report == GoalReport(facts.goal_id, fate, cancel_refused=facts.refused)


def test_only_one_of_several_servers_that_has_not_answered_is_undecided() -> None:
    goal_id = uuid.uuid4()
    assert not GoalFacts(goal_id, servers=1).undecided
    assert GoalFacts(goal_id, servers=2, yeses=1).undecided
    assert not GoalFacts(goal_id, servers=2, yeses=1, noes=1).undecided
    assert not GoalFacts(goal_id, servers=2, yeses=1, attached=True).undecided


def test_only_a_goal_whose_server_has_left_was_lost_with_it() -> None:
    goal_id = uuid.uuid4()
    assert GoalFacts(goal_id, lost=True, servers_gone=True).is_lost_with_server
    assert not GoalFacts(goal_id, lost=True).is_lost_with_server  # its server is only silent
    assert not GoalFacts(goal_id, servers_gone=True).is_lost_with_server  # it was not found out yet
    # Before its server left.
    looked_away = GoalFacts(goal_id, lost=True, servers_gone=True, left=True)
    assert not looked_away.is_lost_with_server


def sent() -> Goal:
    goal = Goal(uuid.uuid4(), Timeouts())
    goal.sent(0.0)
    return goal


def accepted() -> Goal:
    goal = sent()
    goal.accepted(1.0)
    return goal


def test_one_that_was_sent_may_run_until_its_server_says_so() -> None:
    goal = sent()
    assert goal.facts.known_to_run is None
    goal.accepted(1.0)
    assert goal.facts.known_to_run is True


def test_a_caller_who_gives_up_changes_nothing() -> None:
    goal = accepted()
    goal.give_up(CancelReason.CANCELLED, 2.0)
    assert goal.facts.known_to_run is True
    goal.cancel_answered(CancelAnswer.ACCEPTED, 2.1, asked_at=2.0)
    assert goal.facts.known_to_run is True
    goal.result(GoalState.CANCELED, None, 2.2, asked_at=1.0)
    assert goal.facts.known_to_run is False


def test_the_status_topic_tells_the_end_before_the_result() -> None:
    goal = accepted()
    goal.status(GoalState.CANCELED, 2.0, ours=True)
    assert goal.facts.known_to_run is False
    assert not goal.may_run


def test_of_one_whose_server_is_gone_nothing_is_known_until_that_denies_it() -> None:
    goal = accepted()
    goal.server_lost("gone", 2.0)
    assert goal.facts.known_to_run is None
    goal.server_ready(3.0)
    assert goal.facts.known_to_run is None
    goal.result(None, None, 4.0, asked_at=3.0)
    assert goal.facts.known_to_run is None
    goal.server_back(5.0)
    assert goal.facts.known_to_run is goal.may_run is True
    goal.result(None, None, 6.0, asked_at=5.0)
    assert goal.facts.known_to_run is False


def test_a_server_that_does_not_know_it_so_far_may_take_it_yet() -> None:
    goal = sent()
    goal.give_up(CancelReason.CANCELLED, 1.0)
    goal.cancel_answered(CancelAnswer.UNKNOWN_GOAL, 2.0, asked_at=1.0)
    goal.result(None, None, 100.0, asked_at=2.0)
    assert goal.facts.known_to_run is None  # its callback may decide yet
    goal.accepted(60.0)
    assert goal.facts.known_to_run is True


@pytest.mark.parametrize("make", [sent, accepted])
@pytest.mark.parametrize("how", ["abandoned", "broken", "given up, then broken", "out of reach"])
def test_of_one_that_nobody_looks_after_any_more_nothing_is_known(make: Any, how: str) -> None:
    """It may run on: to say that it runs no more would have a tree start it a second time."""
    goal = make()
    goals = GoalsOfCall([goal.facts])
    if how.startswith("given up"):
        goal.give_up(CancelReason.CANCELLED, 2.0)
        goal.timer(Timer.CANCEL, 5.0, others_confirmed_at=0.0)
    if how == "abandoned":
        goal.give_up(CancelReason.CLOSED, 2.0, abandon=True)
    elif how == "out of reach":
        goal.lose_touch()
    else:
        goal.fail("the thread died", RuntimeError("x"), 6.0)
    assert goals.known_to_run is None
    assert goals.left().known_to_run is None


def test_one_that_had_ended_before_that_runs_no_more() -> None:
    goal = accepted()
    goal.result(GoalState.SUCCEEDED, None, 2.0, asked_at=1.0)
    goal.fail("the thread died", RuntimeError("x"), 6.0)
    assert goal.facts.known_to_run is False


@pytest.mark.parametrize(
    ("goals", "known"),
    [
        ([], False),
        ([accepted(), sent()], True),
        ([sent()], None),
    ],
)
def test_of_several_the_worst_counts(goals: list[Goal], known: bool | None) -> None:
    assert GoalsOfCall(goal.facts for goal in goals).known_to_run is known


def test_each_goal_that_may_run_is_kept_and_a_hundred_of_the_others() -> None:
    goals, ids = GoalsOfCall(), [uuid.uuid4() for _ in range(300)]
    for goal_id in ids:
        goal = accepted()
        goal.facts.goal_id = goal_id
        goals.add(goal.facts)
        if goal_id not in ids[::100]:
            goal.result(GoalState.SUCCEEDED, None, 2.0, asked_at=1.0)
    assert goals.may_run == tuple(ids[::100])
    over = [report.goal_id for report in goals.reports if report.fate is GoalFate.ENDED]
    assert over == [goal_id for goal_id in ids if goal_id not in ids[::100]][-100:]


def attached(servers: int, *, left_alone: bool) -> Goal:
    goal = Goal(uuid.uuid4(), Timeouts())
    goal.attached(0.0, servers, left_alone=left_alone)
    goal.status(GoalState.EXECUTING, 1.0, ours=True)
    return goal


@pytest.mark.parametrize("left_alone", [False, True])
def test_what_others_have_sent_may_run_until_each_server_denies_it(left_alone: bool) -> None:
    """They tell nobody else whether they have accepted it."""
    goal = attached(2, left_alone=left_alone)
    goal.give_up(CancelReason.CANCELLED, 2.0)
    goal.result(GoalState.CANCELED, None, 2.1, asked_at=1.0, everybody=False)
    assert goal.facts.known_to_run is None
    assert goal.in_flight
    goal.result(None, None, 3.0, asked_at=2.5, everybody=True)
    assert goal.facts.known_to_run is False


def test_what_others_have_sent_to_one_server_has_ended_where_it_says_so() -> None:
    goal = attached(1, left_alone=True)
    goal.result(GoalState.SUCCEEDED, None, 2.1, asked_at=1.0)
    assert goal.facts.known_to_run is False


def test_what_is_only_followed_is_left_where_another_server_may_have_it() -> None:
    goal = attached(2, left_alone=True)
    effects = goal.result(GoalState.SUCCEEDED, None, 2.1, asked_at=1.0, everybody=False)
    assert goal.settled
    assert not any(type(each).__name__ == "AskCancel" for each in effects)
    assert goal.facts.fate is GoalFate.LEFT
