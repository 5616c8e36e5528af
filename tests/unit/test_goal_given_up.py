"""A goal that its caller gives up on: cancelled, out of time, or left behind by close()."""

from __future__ import annotations

import uuid
from dataclasses import replace
from typing import Any

import pytest
from goal_life import UNTIL_ACCEPTED, UNTIL_SENT, Life, endings, on_two, sent_to

from actionkit._goal.effects import (
    Arm,
    AskCancel,
    AskResult,
    Disarm,
    Effect,
    End,
    Ending,
    LastNews,
    LateResult,
    Record,
    Release,
    Settle,
    StopCancel,
    Timer,
    WatchStatus,
)
from actionkit._goal.machine import Goal
from actionkit._goal.stages import CONFIRMED_AFTER, CancelReason, Stage
from actionkit._model.cancel_answer import CancelAnswer
from actionkit._model.settings import LONGEST_GRACE, Timeouts
from actionkit._model.values import CancelReport, GoalFate, GoalReport, GoalState

REFUSED = "the server refused to cancel; the goal runs on"


def refusals(effects: list[Effect]) -> list[GoalState]:
    return [each.state for each in effects if isinstance(each, Record) and each.cancel_refused]


def refuse(life: Life, times: int = 2) -> None:
    """Let the server refuse to cancel, so often that it is believed unless told otherwise."""
    for _ in range(times):
        life.tell("cancel_answered", CancelAnswer.REFUSED)
        life.wait_until(life.now + CONFIRMED_AFTER)


def refused(times: int = 2, deadline: float | None = 60.0, **timeouts: float | None) -> Life:
    """Return a goal whose caller has cancelled it, which its server has refused."""
    life = Life(deadline, **timeouts).after(*UNTIL_ACCEPTED, "cancel")
    refuse(life, times)
    return life


# --- what its caller is told of it -------------------------------------------------------------


@pytest.mark.parametrize(
    ("facts", "report"),
    [
        ({}, None),
        ({"refused": True}, CancelReport.REFUSED),
        ({"given_up": True, "ended_as": GoalState.ABORTED}, CancelReport.CONFIRMED),
        ({"given_up": True}, CancelReport.NOT_NEEDED),
        ({"given_up": True, "news": LastNews.NOTHING}, CancelReport.UNKNOWN),
        ({"given_up": True, "news": LastNews.NOTHING, "refused": True}, CancelReport.REFUSED),
    ],
)
def test_what_became_of_the_cancel_of_a_goal(
    facts: dict[str, Any], report: CancelReport | None
) -> None:
    ending = Ending(End.DEADLINE, GoalState.TIMED_OUT, **facts)
    assert ending.own_cancel is report
    assert ending.cancel is report


@pytest.mark.parametrize(
    ("fate", "goal_refused", "refused", "report"),
    [
        (GoalFate.RUNNING, False, False, CancelReport.UNKNOWN),
        (GoalFate.RUNNING, True, False, CancelReport.REFUSED),
        (GoalFate.RUNNING, False, True, CancelReport.REFUSED),
        (GoalFate.LOST, True, False, CancelReport.UNKNOWN),  # it may have ended with its server
        (GoalFate.ENDED, True, False, CancelReport.CONFIRMED),
    ],
)
def test_of_several_goals_of_a_call_those_that_may_run_count(
    fate: GoalFate, goal_refused: bool, refused: bool, report: CancelReport
) -> None:
    """The last one has ended; the fate is that of an earlier one."""
    earlier = GoalReport(uuid.uuid4(), fate, cancel_refused=goal_refused)
    last = GoalReport(uuid.uuid4(), GoalFate.ENDED)
    ending = Ending(
        End.DEADLINE,
        GoalState.TIMED_OUT,
        given_up=True,
        refused=refused,
        ended_as=GoalState.CANCELED,
        goals=(earlier, last),
    )
    assert ending.cancel is report
    assert ending.own_cancel is CancelReport.CONFIRMED
    assert ending.may_run == ((earlier.goal_id,) if fate.may_run else ())


# --- the deadline ------------------------------------------------------------------------------


@pytest.mark.parametrize(("events", "phase"), [(UNTIL_SENT, "accept"), (UNTIL_ACCEPTED, "execute")])
def test_the_deadline_passes_in_flight(events: tuple[str, ...], phase: str) -> None:
    life = Life(3.0).after(*events, until=3.0)
    assert AskCancel() in life.all
    assert Record(GoalState.TIMED_OUT, "waiting for the result") in life.all
    assert not life.goal.settled
    life.wait_until(5.0)
    assert (life.end, life.report) == (End.DEADLINE, CancelReport.UNKNOWN)
    assert life.ended.phase == phase
    assert life.count(Release) == 0  # it is watched on (C2.4)


@pytest.mark.parametrize(
    ("status", "late"), [("CANCELED", None), ("ABORTED", None), ("SUCCEEDED", "result")]
)
def test_the_result_comes_in_the_grace_after_the_deadline(status: str, late: str | None) -> None:
    life = Life(3.0).after(*UNTIL_ACCEPTED, until=3.0)
    life.tell("result", GoalState(status), "result")
    assert (life.end, life.report) == (End.DEADLINE, CancelReport.CONFIRMED)
    assert (life.ended.result, life.ended.status) == (late, GoalState(status))


def test_a_goal_that_has_ended_is_not_cancelled_at_the_deadline() -> None:
    """Only its result is missing."""
    life = Life(3.0).after(*UNTIL_ACCEPTED)
    life.tell("status", GoalState.SUCCEEDED)
    before = len(life.all)
    life.wait_until(3.0)
    assert AskResult() in life.all[before:]
    life.wait_until(5.0)
    assert AskCancel() not in life.all
    assert (life.end, life.report) == (End.DEADLINE, CancelReport.CONFIRMED)
    assert life.ended.ended_first


@pytest.mark.parametrize("times", [1, 2, 3])
def test_the_server_refuses_to_cancel_after_the_deadline(times: int) -> None:
    life = Life(3.0).after(*UNTIL_ACCEPTED, until=3.0)
    refuse(life, times)
    life.wait_until(4.9)
    assert life.end is None  # its success may come yet
    life.wait_until(5.0)
    assert (life.end, life.report) == (End.DEADLINE, CancelReport.REFUSED)
    told = Record(GoalState.ACCEPTED, REFUSED, cancel_refused=True)
    assert life.all.count(told) == 1
    life.tell("result", GoalState.SUCCEEDED, 1)
    assert life.count(Release) == 1


@pytest.mark.parametrize("refusals", [1, 2])
def test_a_success_that_was_refused_a_cancel_is_not_thrown_away(refusals: int) -> None:
    life = Life(3.0).after(*UNTIL_ACCEPTED, until=3.0)
    refuse(life, refusals)
    life.wait_until(4.9)
    life.tell("result", GoalState.SUCCEEDED, 1)
    assert (life.end, life.report) == (End.DEADLINE, CancelReport.CONFIRMED)
    assert life.ended.result == 1


@pytest.mark.parametrize("accepted", [1, 2])
@pytest.mark.parametrize(
    ("why", "end"),
    [(CancelReason.DEADLINE, End.DEADLINE), (CancelReason.CANCELLED, End.SUCCEEDED)],
)
def test_a_success_is_not_lost_where_another_server_does_not_confirm(
    accepted: int, why: CancelReason, end: End
) -> None:
    """It was held back until the other server would have stopped the goal, too."""
    goal = on_two(accepted=accepted, at=0.1)
    goal.give_up(why, 3.0)
    effects = goal.result(GoalState.SUCCEEDED, "result", 3.5, asked_at=0.1, everybody=False)
    assert Settle not in map(type, effects)
    (ending,) = endings(goal.timer(Timer.CANCEL, 5.0))
    assert (ending.end, ending.result) == (end, "result")
    assert ending.cancel is CancelReport.UNKNOWN
    assert ending.news is LastNews.NOTHING
    assert AskCancel() in goal.timer(Timer.REASK, 6.0)


def test_a_refusal_is_asked_about_once_more() -> None:
    """rclpy refuses in the same words where the goal has just ended (R12)."""
    life = Life(3.0).after(*UNTIL_ACCEPTED, until=3.0)
    assert life.all.count(AskCancel()) == 1
    life.tell("cancel_answered", CancelAnswer.REFUSED)
    life.wait_until(3.0 + CONFIRMED_AFTER)
    assert life.all.count(AskCancel()) == 2
    life.tell("cancel_answered", CancelAnswer.TERMINATED)
    life.wait_until(5.0)
    assert (life.end, life.report) == (End.DEADLINE, CancelReport.UNKNOWN)


def test_a_second_refusal_counts_only_where_it_was_asked_for_after_the_first() -> None:
    """Where packets are lost, what was asked in one moment may be answered seconds apart."""
    life = Life().after(*UNTIL_ACCEPTED, "cancel", until=1.0)
    life.tell("cancel_answered", CancelAnswer.REFUSED, asked_at=0.1)
    life.wait_until(1.0 + 2 * CONFIRMED_AFTER)
    life.tell("cancel_answered", CancelAnswer.REFUSED, asked_at=0.2)
    assert life.goal.cancel_reason is CancelReason.CANCELLED
    life.tell("cancel_answered", CancelAnswer.REFUSED)
    assert life.goal.cancel_reason is None  # it runs on, and its caller waits on


def test_a_goal_is_lost_only_where_that_was_said_after_it_was_first_said() -> None:
    life = Life().after(*UNTIL_ACCEPTED, until=1.0)
    life.tell("result", None, None, asked_at=0.1)
    life.wait_until(1.0 + 2 * CONFIRMED_AFTER)
    life.tell("result", None, None, asked_at=0.2)
    assert life.end is None
    life.tell("result", None, None)
    assert life.end is End.RESULT_LOST


def test_a_refusal_of_a_server_that_is_gone_says_nothing_of_now() -> None:
    life = Life(3.0).after(*UNTIL_ACCEPTED, until=3.0)
    life.tell("cancel_answered", CancelAnswer.REFUSED)
    life.tell("server_lost", "gone")
    assert (life.end, life.report) == (End.DEADLINE, CancelReport.UNKNOWN)


def test_a_refusal_is_not_told_of_a_later_cancel_that_nobody_answers() -> None:
    life = Life()
    life.goal.facts.goal_id = uuid.uuid4()
    life.see(*UNTIL_ACCEPTED, "cancel")
    life.tell("cancel_answered", CancelAnswer.REFUSED)
    life.wait_until(life.now + CONFIRMED_AFTER)
    life.tell("cancel_answered", CancelAnswer.REFUSED)
    assert life.goal.facts.refused
    life.tell("close", abandon=False)
    life.wait_until(life.now + 3.0)
    assert life.report is CancelReport.UNKNOWN
    report = life.goal.facts.report
    assert report == GoalReport(life.goal.facts.goal_id, GoalFate.RUNNING, cancel_refused=False)
    assert replace(life.ending, goals=(report,)).cancel is CancelReport.UNKNOWN


def test_the_goal_is_rejected_after_the_deadline() -> None:
    life = Life(3.0).after(*UNTIL_SENT, until=3.0)
    life.see("rejected")
    assert (life.end, life.report) == (End.DEADLINE, CancelReport.NOT_NEEDED)


def test_the_rejection_of_a_goal_whose_caller_has_left_is_told_of() -> None:
    life = Life(3.0).after(*UNTIL_SENT, until=5.0)
    late = LateResult(GoalState.REJECTED, None)
    assert life.see("rejected") == [Record(GoalState.REJECTED), late, Release()]


def test_the_server_is_lost_after_the_deadline() -> None:
    life = Life(3.0).after(*UNTIL_ACCEPTED, until=3.0)
    life.tell("server_lost", "gone")
    assert (life.end, life.report) == (End.DEADLINE, CancelReport.UNKNOWN)


# --- no acceptance -----------------------------------------------------------------------------


def test_the_server_does_not_answer_and_accepts_after_all() -> None:
    life = Life().after(*UNTIL_SENT, until=5.0)
    assert Record(GoalState.TIMED_OUT, "waiting for acceptance") in life.all
    assert life.goal.stage is Stage.SENT
    life.wait_until(7.0)
    assert (life.end, life.report) == (End.NO_ACCEPTANCE, CancelReport.UNKNOWN)
    assert life.ended.status is GoalState.TIMED_OUT
    assert life.ended.news is LastNews.NOTHING
    life.wait_until(100.0)
    assert AskCancel() in life.see("accepted")
    life.tell("cancel_answered", CancelAnswer.ACCEPTED)
    assert life.tell("result", GoalState.CANCELED, None)[1] == LateResult(GoalState.CANCELED, None)
    assert life.count(Release) == 1


def test_a_goal_whose_request_was_dropped_is_asked_for_less_and_less_and_forgotten() -> None:
    life = Life().after(*UNTIL_SENT, until=8.0)
    while not life.count(Release):
        life.tell("result", None, None)  # the server lives, and does not know it
        life.wait_until(min(life.timers.values()))
        assert life.now < 3600.0
    assert 800.0 < life.now < 900.0
    assert life.count(AskResult) < 15
    assert life.goal.facts.may_run  # it is told of as such, and nobody looks after it any more
    assert life.goal.facts.left
    again = Goal(life.goal.facts.goal_id, Timeouts())
    assert AskCancel() in again.taken_back(life.goal.facts, 1, life.now)
    assert not again.facts.left
    again.cancel_answered(CancelAnswer.ACCEPTED, 1000.0, asked_at=999.0)
    assert again.result(GoalState.CANCELED, None, 1001.0, asked_at=1000.0)[-1] == Release()


def test_a_goal_of_a_server_that_denied_it_and_fell_silent_is_not_forgotten() -> None:
    """It may be busy, with the request in its queue behind others."""
    life = Life().after(*UNTIL_SENT, until=8.0)
    for _ in range(8):
        life.tell("result", None, None)
        life.wait_until(min(life.timers.values()))
    assert life.now > 300.0
    life.wait_until(7200.0)
    assert life.count(Release) == 0
    assert life.count(AskResult) > 200  # asked as often as ever
    assert AskCancel() in life.see("accepted")


def test_a_goal_of_a_silent_server_is_not_forgotten() -> None:
    life = Life().after(*UNTIL_SENT, until=7200.0)
    assert life.count(Release) == 0
    assert AskCancel() in life.see("accepted")


@pytest.mark.parametrize("answer", ["cancel", "result"])
def test_an_unanswered_goal_that_the_server_does_not_know_is_waited_for_no_more(
    answer: str,
) -> None:
    life = Life().after(*UNTIL_SENT)
    life.tell("result", None, None)  # in good time: it may be taken yet (R6)
    assert life.end is None
    life.wait_until(5.0)
    assert life.end is None  # what counts is what is said from now on
    if answer == "cancel":
        life.tell("cancel_answered", CancelAnswer.UNKNOWN_GOAL)
    else:
        life.tell("result", None, None)
    assert (life.end, life.report) == (End.NO_ACCEPTANCE, CancelReport.UNKNOWN)
    assert life.ended.news is LastNews.UNKNOWN_TO_SERVER
    life.wait_until(100.0)
    assert life.count(Release) == 0  # it may be accepted yet, and is cancelled then (R6)
    assert AskCancel() in life.see("accepted")
    late = life.tell("result", GoalState.SUCCEEDED, 1)
    assert LateResult(GoalState.SUCCEEDED, 1) in late
    assert life.count(Release) == 1


@pytest.mark.parametrize(
    ("status", "end"), [("SUCCEEDED", End.SUCCEEDED), ("CANCELED", End.NO_ACCEPTANCE)]
)
def test_acceptance_comes_while_the_unanswered_goal_is_cancelled(status: str, end: End) -> None:
    life = Life().after(*UNTIL_SENT, until=5.0)
    life.see("accepted")
    life.tell("result", GoalState(status), "result")
    assert life.end is end
    assert life.report is CancelReport.CONFIRMED


def test_an_unanswered_goal_is_rejected_after_all() -> None:
    life = Life().after(*UNTIL_SENT, until=5.0)
    life.see("rejected")
    assert life.end is End.REJECTED


def test_an_unanswered_goal_may_be_lost_with_its_server() -> None:
    life = Life().after(*UNTIL_SENT, until=5.0)
    life.tell("server_lost", "gone")
    assert life.end is End.LOST


def test_an_unanswered_goal_that_is_accepted_and_not_cancelled_is_waited_for() -> None:
    life = Life().after(*UNTIL_SENT, until=5.0)
    life.see("accepted")
    refuse(life)
    life.wait_until(100.0)
    assert life.end is None
    life.tell("result", GoalState.SUCCEEDED, 1)
    assert (life.end, life.report) == (End.SUCCEEDED, CancelReport.REFUSED)


# --- silence -----------------------------------------------------------------------------------


def test_feedback_stalls() -> None:
    life = Life(feedback=1.0).after(*UNTIL_ACCEPTED)
    for second in (0.9, 1.8, 2.7):
        life.wait_until(second)
        life.see("feedback")
    life.wait_until(3.6)
    assert AskCancel() not in life.all
    life.wait_until(3.7)
    assert life.all.count(AskCancel()) == 1
    assert Record(GoalState.TIMED_OUT, "waiting for feedback") in life.all
    life.tell("cancel_answered", CancelAnswer.ACCEPTED)
    life.see("feedback")
    assert Timer.STALL not in life.timers
    life.tell("result", GoalState.CANCELED, None)
    assert (life.end, life.report) == (End.STALLED, CancelReport.CONFIRMED)


def test_a_goal_that_stalled_and_is_refused_its_cancel_is_waited_for_no_longer() -> None:
    life = Life(feedback=1.0).after(*UNTIL_ACCEPTED, until=1.0)
    refuse(life)
    life.wait_until(2.9)
    assert life.end is None
    life.wait_until(3.0)
    assert (life.end, life.report) == (End.STALLED, CancelReport.REFUSED)
    assert life.ended.status is GoalState.TIMED_OUT


@pytest.mark.parametrize("lost", [("server_lost", "gone"), ("result", None, None)])
def test_a_goal_that_stalled_and_is_lost_is_lost(lost: tuple[Any, ...]) -> None:
    life = Life(feedback=1.0).after(*UNTIL_ACCEPTED, until=1.0)
    for _ in range(2):
        life.tell(*lost)
        life.wait_until(life.now + CONFIRMED_AFTER)
    assert life.end is (End.LOST if lost[0] == "server_lost" else End.RESULT_LOST)


# --- the caller cancels ------------------------------------------------------------------------


def test_a_cancelled_goal_is_cancelled() -> None:
    life = Life(feedback=2.0).after(*UNTIL_ACCEPTED)
    assert life.goal.cancelled_at == 0.0
    life.wait_until(1.5)
    assert AskCancel() in life.see("cancel")
    assert life.goal.cancelled_at == 1.5
    assert life.end is None
    life.tell("cancel_answered", CancelAnswer.ACCEPTED)
    assert life.states[-1] is GoalState.CANCELING
    life.tell("result", GoalState.CANCELED, None)
    assert (life.end, life.report) == (End.CANCELLED_BY_CALLER, CancelReport.CONFIRMED)
    assert life.states == [
        GoalState.SENT,
        GoalState.ACCEPTED,
        GoalState.CANCELING,
        GoalState.CANCELED,
    ]


def test_a_cancelled_goal_that_was_not_accepted_so_far_is_cancelled_on_acceptance() -> None:
    life = Life().after(*UNTIL_SENT, "cancel")
    assert life.tell("cancel_answered", CancelAnswer.UNKNOWN_GOAL) == []
    assert AskCancel() in life.see("accepted")
    life.tell("result", GoalState.CANCELED, None)
    assert life.end is End.CANCELLED_BY_CALLER


def test_a_cancelled_goal_is_rejected() -> None:
    life = Life().after(*UNTIL_SENT, "cancel", "rejected")
    assert (life.end, life.report) == (End.CANCELLED_BY_CALLER, CancelReport.NOT_NEEDED)


@pytest.mark.parametrize(
    ("status", "end"), [("SUCCEEDED", End.SUCCEEDED), ("ABORTED", End.ABORTED)]
)
def test_a_cancelled_goal_ends_in_another_way(status: str, end: End) -> None:
    life = Life().after(*UNTIL_ACCEPTED, "cancel")
    life.tell("cancel_answered", CancelAnswer.ACCEPTED)  # accepted, and not heeded (R12)
    life.tell("result", GoalState(status), 1)
    assert (life.end, life.report) == (end, CancelReport.CONFIRMED)


def test_an_unanswered_cancel_ends_in_time() -> None:
    life = Life().after(*UNTIL_ACCEPTED, "cancel")
    assert life.all.count(AskCancel()) == 1  # who carries it out repeats it
    life.wait_until(1.9)
    assert life.end is None
    life.wait_until(2.0)
    assert (life.end, life.report) == (End.DEADLINE, CancelReport.UNKNOWN)
    assert life.ended.phase == "cancel"


@pytest.mark.parametrize(("deadline", "end"), [(None, 6.0), (3.0, 5.0)])
def test_the_grace_goes_on_while_other_cancellations_are_confirmed(
    deadline: float | None, end: float
) -> None:
    life = Life(deadline).after(*UNTIL_ACCEPTED, "cancel")
    life.others_confirmed_at = 1.0
    life.wait_until(2.9)
    life.others_confirmed_at = 2.9
    life.wait_until(4.0)
    life.others_confirmed_at = 4.0
    life.wait_until(end - 0.1)
    assert life.end is None
    life.wait_until(end)
    assert (life.end, life.report) == (End.DEADLINE, CancelReport.UNKNOWN)


def test_a_goal_that_had_its_turn_does_not_wait_for_others() -> None:
    life = Life().after(*UNTIL_SENT, "cancel")
    life.tell("cancel_answered", CancelAnswer.UNKNOWN_GOAL)
    life.others_confirmed_at = 1e6
    life.wait_until(2.0)
    assert (life.end, life.report) == (End.DEADLINE, CancelReport.UNKNOWN)


def test_the_grace_has_an_end_though_others_are_confirmed_for_ever() -> None:
    life = Life().after(*UNTIL_ACCEPTED, "cancel")
    life.others_confirmed_at = 1e6
    life.wait_until(1.9 + LONGEST_GRACE)
    assert life.end is None
    life.wait_until(2.0 + LONGEST_GRACE)
    assert life.end is End.DEADLINE


def test_the_grace_after_a_deadline_is_never_longer() -> None:
    life = Life(3.0).after(*UNTIL_ACCEPTED)
    life.others_confirmed_at = 4.9
    life.wait_until(5.0)
    assert (life.end, life.report) == (End.DEADLINE, CancelReport.UNKNOWN)


def test_a_cancelled_goal_whose_end_is_known_without_its_result() -> None:
    life = Life().after(*UNTIL_ACCEPTED, "cancel")
    life.tell("status", GoalState.CANCELED)
    life.wait_until(2.0)
    assert (life.end, life.report) == (End.CANCELLED_BY_CALLER, CancelReport.CONFIRMED)


def test_a_refused_cancel_leaves_the_goal_to_its_caller() -> None:
    life = Life(60.0).after(*UNTIL_ACCEPTED, "cancel")
    life.tell("cancel_answered", CancelAnswer.REFUSED)
    life.wait_until(CONFIRMED_AFTER)
    effects = life.tell("cancel_answered", CancelAnswer.REFUSED)
    assert effects[0] == Disarm(Timer.CANCEL)
    assert refusals(effects) == [GoalState.ACCEPTED]
    assert life.tell("cancel_answered", CancelAnswer.REFUSED) == []  # it was told of
    life.wait_until(50.0)
    assert life.end is None
    life.tell("result", GoalState.SUCCEEDED, 1)
    assert life.end is End.SUCCEEDED


@pytest.mark.parametrize(
    ("event", "end", "report"),
    [
        (("result", GoalState.SUCCEEDED, 1), End.SUCCEEDED, CancelReport.REFUSED),
        (("result", GoalState.ABORTED, 1), End.ABORTED, CancelReport.REFUSED),
        (("result", GoalState.CANCELED, 1), End.CANCELED_BY_OTHER, CancelReport.REFUSED),
        (("result", None, None), End.RESULT_LOST, CancelReport.REFUSED),
        (("server_lost", "gone"), End.LOST, None),  # it ran on, but who knows for how long
    ],
)
def test_a_refusal_is_told_with_the_end_of_a_goal_that_ended_by_itself(
    event: tuple[Any, ...], end: End, report: CancelReport | None
) -> None:
    life = refused()
    for _ in range(2):  # what is unknown only counts when it is said again
        life.tell(*event)
        life.wait_until(life.now + CONFIRMED_AFTER)
    assert (life.end, life.report) == (end, report)


@pytest.mark.parametrize("seen", [("feedback",), ("status", GoalState.EXECUTING)])
@pytest.mark.parametrize("until", [UNTIL_SENT, UNTIL_ACCEPTED])
def test_a_goal_that_is_just_being_accepted_is_not_refused_its_cancel(
    until: tuple[str, ...], seen: tuple[str, ...]
) -> None:
    """rclpy's servers refuse in the same words while they accept a goal, and then run it (R12)."""
    life = Life(60.0).after(*until, "cancel")
    life.tell("cancel_answered", CancelAnswer.REFUSED)
    life.tell("result", None, None)  # for the same moment they do not know it
    life.tell("cancel_answered", CancelAnswer.REFUSED)  # what was asked at once comes too early
    life.tell(*seen)
    asked = life.all.count(AskCancel())
    life.wait_until(CONFIRMED_AFTER)
    assert life.all.count(AskCancel()) == asked + 1
    life.tell("cancel_answered", CancelAnswer.ACCEPTED)
    life.tell("result", GoalState.CANCELED, None)
    assert (life.end, life.report) == (End.CANCELLED_BY_CALLER, CancelReport.CONFIRMED)


def test_a_refusal_is_asked_about_once_more_when_nobody_waits_any_more() -> None:
    life = Life(3.0).after(*UNTIL_SENT, until=10.0)
    assert life.end is End.DEADLINE
    life.tell("cancel_answered", CancelAnswer.REFUSED)
    life.tell("cancel_answered", CancelAnswer.REFUSED)
    asked = life.all.count(AskCancel())
    life.wait_until(10.0 + CONFIRMED_AFTER)
    assert life.all.count(AskCancel()) == asked + 1
    life.tell("cancel_answered", CancelAnswer.REFUSED)  # now it is believed
    life.wait_until(30.0)
    assert life.all.count(AskCancel()) == asked + 1


def test_a_refusal_that_comes_just_before_the_end_of_the_wait_is_asked_about_once_more() -> None:
    """One refusal says little, also when it was all that there was time for (R12)."""
    life = Life(3.0, cancel=0.1).after(*UNTIL_ACCEPTED, until=3.0)
    life.tell("cancel_answered", CancelAnswer.REFUSED)
    life.wait_until(3.1)
    assert (life.end, life.report) == (End.DEADLINE, CancelReport.REFUSED)
    asked = life.all.count(AskCancel())
    life.wait_until(3.0 + CONFIRMED_AFTER)
    assert life.all.count(AskCancel()) == asked + 1


def test_a_refusal_that_was_believed_for_want_of_time_is_asked_about_once_more() -> None:
    """The caller cancelled a goal that was just being accepted, and waits for less than that."""
    life = Life(60.0, cancel=0.05).after(*UNTIL_SENT, "cancel")
    life.tell("cancel_answered", CancelAnswer.REFUSED)
    asked = life.all.count(AskCancel())
    life.wait_until(CONFIRMED_AFTER)
    assert life.end is None
    assert life.all.count(AskCancel()) == asked + 1
    life.tell("cancel_answered", CancelAnswer.ACCEPTED)
    life.tell("result", GoalState.CANCELED, None)
    assert (life.end, life.report) == (End.CANCELLED_BY_CALLER, CancelReport.CONFIRMED)


def test_a_server_that_accepts_after_the_refusal_of_another_one_is_asked_to_cancel() -> None:
    goal = on_two()
    goal.give_up(CancelReason.CANCELLED, 1.0)
    goal.accepted(1.1)
    goal.cancel_answered(CancelAnswer.REFUSED, 1.2, asked_at=1.0)
    goal.timer(Timer.CANCEL, 4.0)
    assert not goal.settled  # its caller waits for its end
    assert AskCancel() in goal.accepted(5.0)


@pytest.mark.parametrize("answered_first", [True, False])
def test_what_another_server_cancels_after_a_refusal_was_cancelled_by_its_caller(
    answered_first: bool,
) -> None:
    """Also if the result comes before the answer to the request to cancel it."""
    goal = on_two()
    goal.give_up(CancelReason.CANCELLED, 1.0)
    goal.accepted(1.1)
    goal.cancel_answered(CancelAnswer.REFUSED, 1.2, asked_at=1.0)
    goal.timer(Timer.CANCEL, 4.0)
    goal.accepted(5.0)
    if answered_first:
        goal.cancel_answered(CancelAnswer.ACCEPTED, 5.1, asked_at=5.0)
    effects = goal.result(GoalState.CANCELED, None, 5.1, asked_at=5.0, everybody=False)
    assert not goal.settled  # the one that has refused runs it
    assert answered_first or Arm(Timer.CANCEL, 7.1) in effects
    (ended,) = goal.timer(Timer.CANCEL, 7.1)
    assert isinstance(ended, Settle)
    assert ended.ending.end is End.CANCELLED_BY_CALLER
    assert ended.ending.elsewhere


def test_a_caller_who_cancels_again_after_a_refusal_asks_again() -> None:
    life = refused()
    assert life.goal.cancel_reason is None
    assert AskCancel() in life.see("cancel")
    refuse(life)
    assert len(refusals(life.all)) == 2  # each cancel has its answer
    life.see("cancel")
    life.tell("cancel_answered", CancelAnswer.ACCEPTED)
    life.tell("result", GoalState.CANCELED, None)
    assert (life.end, life.report) == (End.CANCELLED_BY_CALLER, CancelReport.CONFIRMED)


def test_a_refusal_that_was_told_of_is_not_told_of_again_as_the_client_closes() -> None:
    life = refused()
    life.tell("close", abandon=False)
    life.tell("cancel_answered", CancelAnswer.REFUSED)
    life.wait_until(life.now + 2.0)
    assert (life.end, life.report) == (End.CLOSED, CancelReport.REFUSED)
    assert len(refusals(life.all)) == 1


@pytest.mark.parametrize("times", [1, 2])
def test_the_feedback_of_a_goal_that_is_not_cancelled_may_stall_again(times: int) -> None:
    life = refused(times, feedback=5.0)
    life.wait_until(2.0)
    believed = 2.0 if times == 1 else CONFIRMED_AFTER
    assert life.timers[Timer.STALL] == believed + 5.0


def test_a_cancel_that_is_accepted_after_its_refusal_is_waited_for() -> None:
    life = refused(feedback=5.0)
    life.wait_until(4.0)
    life.tell("cancel_answered", CancelAnswer.ACCEPTED)
    goal_id = life.goal.facts.goal_id
    assert life.goal.facts.report == GoalReport(goal_id, GoalFate.RUNNING, cancel_refused=False)
    life.wait_until(5.9)
    assert life.end is None
    life.wait_until(6.0)
    assert (life.end, life.report) == (End.DEADLINE, CancelReport.UNKNOWN)


def test_closing_waits_no_longer_when_the_cancel_is_accepted() -> None:
    """Of a goal whose cancel was refused when its caller asked for it."""
    life = refused(deadline=None)
    life.wait_until(10.0)
    life.tell("close", abandon=False)
    life.wait_until(11.0)
    life.tell("cancel_answered", CancelAnswer.ACCEPTED)
    life.wait_until(12.0)
    assert (life.end, life.report) == (End.CLOSED, CancelReport.UNKNOWN)


@pytest.mark.parametrize("final", ["cancel accepted", "ended", "not given up"])
def test_a_refusal_that_cannot_matter_is_not_heeded(final: str) -> None:
    life = Life().after(*UNTIL_ACCEPTED)
    if final != "not given up":
        life.see("cancel")
    if final == "cancel accepted":
        life.tell("cancel_answered", CancelAnswer.ACCEPTED)
    elif final == "ended":
        life.tell("status", GoalState.CANCELED)
    life.wait_until(1.0)
    assert life.tell("cancel_answered", CancelAnswer.REFUSED) == []


def test_a_cancel_that_this_call_has_not_asked_for_limits_nothing() -> None:
    """An earlier call of the client had asked for it."""
    life = Life().after(*UNTIL_ACCEPTED)
    effects = life.tell("cancel_answered", CancelAnswer.ACCEPTED)
    assert effects == [Record(GoalState.CANCELING)]


@pytest.mark.parametrize("why", [CancelReason.DEADLINE, CancelReason.CLOSED])
def test_a_refused_cancel_of_what_is_left_alone_is_asked_for_again(why: CancelReason) -> None:
    """It was to be left alone, until its caller cancelled it."""
    goal = Goal(uuid.uuid4(), Timeouts())
    goal.attached(0.0, 1, left_alone=True)
    goal.give_up(CancelReason.CANCELLED, 1.0)
    for now in (1.1, 2.0):
        goal.cancel_answered(CancelAnswer.REFUSED, now, asked_at=now)
    assert AskCancel() in goal.give_up(why, 3.0)


# --- another call attaches to it ---------------------------------------------------------------

ACCEPTED = Record(GoalState.ACCEPTED)
SILENCE = [Arm(Timer.REASK, 4.0), Arm(Timer.STALL, 13.0)]


@pytest.mark.parametrize(
    ("events", "effects"),
    [
        ([], [Arm(Timer.ACCEPT, 8.0), Arm(Timer.REASK, 4.0)]),
        ([("accepted",)], [ACCEPTED, *SILENCE]),
        ([("accepted",), ("feedback",)], [ACCEPTED, Record(GoalState.EXECUTING), *SILENCE]),
        ([("accepted",), ("server_lost", "gone"), ("server_back",)], [ACCEPTED, *SILENCE]),
        (
            [("accepted",), ("cancel",), ("status", GoalState.CANCELED)],
            [ACCEPTED, Arm(Timer.RESULT, 63.0), Arm(Timer.REASK, 4.0)],
        ),
    ],
    ids=["sent", "accepted", "executing", "lost and back", "ended"],
)
def test_what_is_taken_over_is_followed_as_if_it_began_now(
    events: list[tuple[str, ...]], effects: list[Effect]
) -> None:
    life = Life(result=60.0, feedback=10.0).after("sent")
    for event in events:
        life.tell(*event)
    life.see("cancel")
    life.wait_until(3.0)
    before = len(life.all)
    life.attach_again()
    asks = [StopCancel(), WatchStatus(), AskResult(anew=True)]
    assert life.all[before:] == [*asks, *effects]
    life.tell("result", GoalState.SUCCEEDED, 1)
    assert life.ending == Ending(
        End.SUCCEEDED, GoalState.SUCCEEDED, result=1, ended_as=GoalState.SUCCEEDED
    )


@pytest.mark.parametrize("cancelled", [False, True])
@pytest.mark.parametrize("taken_over", [False, True])
def test_what_an_earlier_call_had_cancelled_says_so(cancelled: bool, taken_over: bool) -> None:
    life = Life().after(*UNTIL_ACCEPTED)
    if taken_over:
        life.see("cancel")
        if cancelled:
            life.tell("cancel_answered", CancelAnswer.ACCEPTED)
        life.wait_until(3.0)
        life.attach_again()
    elif cancelled:
        life.tell("status", GoalState.CANCELING)
    life.tell("result", GoalState.CANCELED, None)
    why = "an earlier call of this client had cancelled it" if cancelled and taken_over else ""
    assert (life.end, life.ended.lost_because) == (End.CANCELED_BY_OTHER, why)


def taken_over(
    why: CancelReason,
    *,
    servers: int = 1,
    accepted: int = 1,
    cancelled: bool = False,
    left_alone: bool = True,
    **timeouts: float,
) -> tuple[Goal, list[Effect]]:
    """Return a goal that one call has given up and another attaches to, and what that asks for."""
    goal = sent_to(servers, accepted=accepted, at=0.1)
    goal.give_up(why, 0.5)
    if cancelled:
        goal.cancel_answered(CancelAnswer.ACCEPTED, 0.6, asked_at=0.5)
    goal.timer(Timer.CANCEL, 3.0)
    now = Timeouts(**timeouts)
    return goal, goal.attached_again(now, 4.0, servers, left_alone=left_alone)


def test_what_an_earlier_call_had_cancelled_may_run_on_another_server() -> None:
    goal, _ = taken_over(
        CancelReason.CANCELLED, servers=2, accepted=2, cancelled=True, left_alone=False
    )
    effects = goal.result(GoalState.CANCELED, None, 5.0, asked_at=4.0, everybody=False)
    (ending,) = endings(effects)
    why = "an earlier call of this client had cancelled it"
    assert (ending.end, ending.lost_because) == (End.CANCELED_BY_OTHER, why)
    assert AskCancel() in effects


def test_what_others_have_cancelled_before_this_call_could_says_nothing_of_earlier_ones() -> None:
    goal = Goal(goal_id := uuid.uuid4(), Timeouts())
    assert goal.facts.report.goal_id == goal_id
    goal.sent(0.0)
    goal.accepted(0.1)
    goal.give_up(CancelReason.STALLED, 0.5)
    goal.cancel_answered(CancelAnswer.ACCEPTED, 0.6, asked_at=0.5)
    effects = goal.result(GoalState.CANCELED, None, 1.0, asked_at=0.1, ours=False)
    (ending,) = endings(effects)
    assert (ending.end, ending.lost_because) == (End.CANCELED_BY_OTHER, "")


@pytest.mark.parametrize(
    ("status", "end"),
    [(GoalState.CANCELED, End.CANCELLED_BY_CALLER), (GoalState.SUCCEEDED, End.SUCCEEDED)],
)
def test_what_is_taken_over_and_cancelled_again_ends_by_that(status: GoalState, end: End) -> None:
    life = Life().after(*UNTIL_ACCEPTED, "cancel", until=3.0)
    life.attach_again()
    life.see("cancel")
    life.tell("cancel_answered", CancelAnswer.ACCEPTED)
    life.tell("result", status, 1)
    assert (life.end, life.ended.lost_because) == (end, "")


def test_what_is_taken_over_is_asked_no_more_to_cancel() -> None:
    life = Life(3.0).after(*UNTIL_ACCEPTED, until=9.0)
    assert life.end is End.DEADLINE
    life.attach_again()
    assert StopCancel() in life.all
    assert life.states[-1] is GoalState.ACCEPTED  # the new call shows it from here on
    asked = life.all.count(AskCancel())
    life.wait_until(100.0)
    assert life.all.count(AskCancel()) == asked
    life.tell("result", GoalState.SUCCEEDED, 1)
    assert life.end is End.SUCCEEDED


def test_what_was_not_accepted_yet_and_is_taken_over_is_cancelled_again_if_that_is_given_up() -> (
    None
):
    life = Life(3.0).after(*UNTIL_SENT, until=9.0)
    life.attach_again()
    life.wait_until(life.now + 5.0)
    assert life.all[-5:].count(AskCancel()) == 1  # not accepted in time: the new call ends, too
    life.wait_until(life.now + 2.0)
    assert life.end is End.NO_ACCEPTANCE
    assert AskCancel() in life.see("accepted")


def test_what_was_not_accepted_yet_and_is_taken_over_is_not_left_to_run() -> None:
    goal, _ = taken_over(CancelReason.DEADLINE, accepted=0, accept=1.0)
    effects = goal.timer(Timer.ACCEPT, 5.0)
    assert AskCancel() in effects
    assert Release() not in effects


@pytest.mark.parametrize("why", [CancelReason.CANCELLED, CancelReason.DEADLINE])
def test_what_was_accepted_and_is_taken_over_is_left_to_run(why: CancelReason) -> None:
    """A call that only follows it leaves it at its deadline."""
    goal, _ = taken_over(why)
    effects = goal.give_up(CancelReason.DEADLINE, 5.0)
    assert AskCancel() not in effects
    assert effects[-1] == Release()


def test_the_silence_of_what_is_taken_over_while_it_is_cancelled_is_no_stall() -> None:
    _, effects = taken_over(CancelReason.DEADLINE, cancelled=True, feedback=1.0)
    assert not any(isinstance(each, Arm) and each.timer is Timer.STALL for each in effects)


def test_what_is_lost_is_not_taken_over_and_is_cancelled_when_its_server_is_back() -> None:
    life = Life(3.0).after(*UNTIL_ACCEPTED)
    life.tell("server_lost", "gone")
    life.attach_again()
    assert (life.end, life.ended.lost_because) == (End.LOST, "its action server is gone")
    assert AskCancel() in life.see("server_back")


def test_what_runs_on_another_server_is_not_taken_over_and_is_cancelled_there() -> None:
    goal = on_two(accepted=2, at=0.1)
    goal.result(GoalState.ABORTED, None, 1.0, asked_at=0.2, everybody=False)
    assert goal.stage is Stage.ANOTHER_MAY_RUN
    (settled,) = goal.attached_again(Timeouts(), 2.0, 2, left_alone=True)
    assert isinstance(settled, Settle)
    assert settled.ending.end is End.RESULT_LOST
    why = "one server has ended it, and another one is asked to cancel it"
    assert settled.ending.lost_because == why
    assert AskCancel() in goal.timer(Timer.REASK, 3.0)


def test_a_refusal_that_nothing_contradicts_counts_when_the_grace_ends() -> None:
    life = Life(60.0).after(*UNTIL_ACCEPTED, "cancel")
    life.tell("cancel_answered", CancelAnswer.REFUSED)
    life.wait_until(50.0)
    assert life.end is None
    assert refusals(life.all)


def test_a_refusal_while_another_client_cancels_is_told_of() -> None:
    life = Life(60.0).after(*UNTIL_ACCEPTED)
    life.tell("status", GoalState.CANCELING)
    life.see("cancel")
    life.tell("cancel_answered", CancelAnswer.REFUSED)
    life.wait_until(CONFIRMED_AFTER)
    effects = life.tell("cancel_answered", CancelAnswer.REFUSED)
    assert refusals(effects) == [GoalState.CANCELING]


def test_terminated_confirms_nothing_and_the_result_is_asked_for() -> None:
    life = Life().after(*UNTIL_ACCEPTED, "cancel")
    # What rclpy also answers for a goal that is being cancelled already.
    assert AskResult() in life.tell("cancel_answered", CancelAnswer.TERMINATED)
    assert life.end is None


def test_an_end_that_was_told_before_the_acceptance_asks_for_no_second_result() -> None:
    """micro-ROS' server never frees a goal whose result is asked for again as it ends."""
    life = Life().after("sent", "cancel", until=0.125)
    assert AskResult(anew=True) in life.tell("accepted")
    assert life.tell("cancel_answered", CancelAnswer.TERMINATED, asked_at=0.0) == []

    life = Life().after("sent", "cancel", until=0.125)
    effects = life.tell("cancel_answered", CancelAnswer.TERMINATED, asked_at=0.0)
    assert AskResult(anew=True) in effects
    assert AskResult() not in effects


def test_a_goal_unknown_to_a_cancel_is_asked_for_its_result() -> None:
    life = Life().after(*UNTIL_ACCEPTED, "cancel")
    assert AskResult() in life.tell("cancel_answered", CancelAnswer.UNKNOWN_GOAL)
    life.tell("result", None, None)
    life.wait_until(CONFIRMED_AFTER)
    life.tell("result", None, None)
    assert (life.end, life.report) == (End.RESULT_LOST, CancelReport.NOT_NEEDED)


def test_a_goal_unknown_to_two_cancels_has_ended() -> None:
    """micro-ROS' server answers no request for the result of a goal that has ended."""
    life = Life(3.0).after(*UNTIL_ACCEPTED, until=3.0)
    life.tell("cancel_answered", CancelAnswer.UNKNOWN_GOAL)
    life.tell("cancel_answered", CancelAnswer.UNKNOWN_GOAL)  # asked in the same moment
    assert life.end is None
    life.wait_until(3.0 + CONFIRMED_AFTER)
    life.tell("cancel_answered", CancelAnswer.UNKNOWN_GOAL)
    assert (life.end, life.ended.news) == (End.DEADLINE, LastNews.STOPPED)
    assert life.report is CancelReport.NOT_NEEDED


def test_that_a_goal_was_unknown_before_it_was_accepted_does_not_count() -> None:
    life = Life(3.0).after(*UNTIL_ACCEPTED)
    assert life.tell("cancel_answered", CancelAnswer.UNKNOWN_GOAL, asked_at=-0.1) == []
    life.wait_until(3.0)
    life.tell("cancel_answered", CancelAnswer.UNKNOWN_GOAL)
    assert life.end is None


def test_a_success_that_was_shown_is_waited_for_though_its_goal_is_forgotten() -> None:
    life = Life(3.0).after(*UNTIL_ACCEPTED, until=3.0)
    life.tell("status", GoalState.SUCCEEDED)
    for _ in range(3):
        life.tell("cancel_answered", CancelAnswer.UNKNOWN_GOAL)
        life.wait_until(life.now + CONFIRMED_AFTER)
    assert life.end is None
    life.tell("result", GoalState.SUCCEEDED, "result")
    assert (life.end, life.ended.result) == (End.DEADLINE, "result")


@pytest.mark.parametrize("answer", ["cancel", "result"])
def test_what_another_server_does_not_know_may_run_on_its_own(answer: str) -> None:
    life = Life(3.0).after(*UNTIL_ACCEPTED, until=3.0)
    for _ in range(3):
        life.wait_until(life.now + CONFIRMED_AFTER)
        if answer == "cancel":
            life.tell("cancel_answered", CancelAnswer.UNKNOWN_GOAL, own=False)
        else:
            life.tell("result", None, None, own=False)
    life.wait_until(5.0)
    assert (life.end, life.report) == (End.DEADLINE, CancelReport.UNKNOWN)


def test_what_one_of_two_servers_has_forgotten_is_cancelled_on_the_other() -> None:
    """That one has not answered yet whether it accepts the goal."""
    goal = on_two(accepted=1, at=0.1)
    goal.give_up(CancelReason.CANCELLED, 1.0)
    goal.result(None, None, 2.0, asked_at=1.9)
    effects = goal.result(None, None, 3.0, asked_at=2.9)
    assert effects == [
        Record(GoalState.LOST, "the result cannot be had"),
        Disarm(Timer.STALL),
        AskCancel(),
        AskResult(anew=True),
        Arm(Timer.REASK, 4.0),
    ]
    assert goal.stage is Stage.ANOTHER_MAY_RUN
    (settled,) = goal.timer(Timer.CANCEL, 4.0)
    assert isinstance(settled, Settle)
    why = "its server no longer knows the goal"
    assert (settled.ending.end, settled.ending.lost_because) == (End.RESULT_LOST, why)


def test_what_a_server_has_forgotten_is_over_though_its_acceptance_was_lost() -> None:
    life = Life(3.0).after("sent", "feedback", until=3.0)
    life.tell("result", None, None)
    life.wait_until(3.0 + CONFIRMED_AFTER)
    life.tell("result", None, None)
    assert (life.end, life.report) == (End.DEADLINE, CancelReport.NOT_NEEDED)
    assert life.ended.lost_because == ""
    assert life.goal.facts.fate is GoalFate.ENDED


def test_a_cancel_is_answered_by_the_loss_of_the_server() -> None:
    life = Life().after(*UNTIL_ACCEPTED, "cancel")
    life.tell("server_lost", "gone")
    assert (life.end, life.report) == (End.LOST, CancelReport.UNKNOWN)


# --- the client closes -------------------------------------------------------------------------


def test_closing_cancels() -> None:
    life = Life().after(*UNTIL_ACCEPTED)
    assert AskCancel() in life.tell("close", abandon=False)
    life.tell("result", GoalState.CANCELED, None)
    assert (life.end, life.report) == (End.CLOSED, CancelReport.CONFIRMED)
    assert life.states == [GoalState.SENT, GoalState.ACCEPTED, GoalState.CANCELED]


def test_closing_is_refused() -> None:
    life = Life().after(*UNTIL_ACCEPTED)
    life.tell("close", abandon=False)
    life.tell("cancel_answered", CancelAnswer.REFUSED)
    life.wait_until(2.0)
    assert (life.end, life.report) == (End.CLOSED, CancelReport.REFUSED)
    assert refusals(life.all) == [GoalState.ACCEPTED]


@pytest.mark.parametrize("abandon", [False, True])
def test_closing_while_the_callers_own_cancel_is_refused(abandon: bool) -> None:
    life = Life().after(*UNTIL_ACCEPTED)
    life.tell("cancel")
    life.tell("close", abandon=abandon)
    life.tell("cancel_answered", CancelAnswer.REFUSED)
    life.wait_until(2.0)
    assert (life.end, life.report) == (End.CLOSED, CancelReport.REFUSED)


@pytest.mark.parametrize("accepted", [False, True])
def test_what_is_only_followed_is_left_at_the_deadline(accepted: bool) -> None:
    goal = Goal(uuid.uuid4(), Timeouts())
    goal.attached(0.0, 1, left_alone=True)
    if accepted:
        goal.status(GoalState.EXECUTING, 1.0, ours=True)
    ending = Ending(
        End.DEADLINE,
        GoalState.TIMED_OUT,
        phase="execute" if accepted else "accept",
        news=LastNews.NOTHING,
        given_up=True,
        abandoned=True,
    )
    assert goal.give_up(CancelReason.DEADLINE, 3.0) == [
        Record(GoalState.TIMED_OUT, "waiting for the result"),
        Settle(ending),
        Release(),
    ]
    assert goal.stage is Stage.OVER
    assert goal.facts.fate is GoalFate.LEFT


@pytest.mark.parametrize("situation", ["sent", "accepted", "lost", "ended", "over"])
def test_who_has_left_asks_once_more_where_that_may_help(situation: str) -> None:
    life = Life(3.0).after(*(UNTIL_SENT if situation == "sent" else UNTIL_ACCEPTED), until=5.0)
    assert life.end is End.DEADLINE
    if situation == "lost":
        life.tell("server_lost", "gone")
    elif situation == "ended":
        life.tell("status", GoalState.SUCCEEDED)
    elif situation == "over":
        life.tell("result", GoalState.SUCCEEDED, 1)
    asks = [AskCancel()] if situation in ("sent", "accepted") else []
    assert life.see("cancel") == asks
    assert life.tell("close", abandon=False) == asks
    assert life.tell("close", abandon=True) == []  # the user chose to let goals run


@pytest.mark.parametrize("events", [UNTIL_SENT, UNTIL_ACCEPTED])
def test_closing_abandons(events: tuple[str, ...]) -> None:
    life = Life().after(*events)
    life.tell("close", abandon=True)
    assert (life.end, life.report) == (End.CLOSED, CancelReport.UNKNOWN)
    assert life.count(AskCancel) == 0
    assert life.count(Release) == 1
