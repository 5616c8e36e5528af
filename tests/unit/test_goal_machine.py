"""The life of a goal, situation by situation. What is checked of every order of
events is checked of these too: see goal_life.
"""

from __future__ import annotations

import uuid

import pytest
from goal_life import UNTIL_ACCEPTED, UNTIL_SENT, Life

from actionkit._goal.effects import (
    Arm,
    AskCancel,
    AskResult,
    End,
    Ending,
    LastNews,
    Record,
    Release,
    Settle,
    Timer,
    WatchStatus,
)
from actionkit._goal.machine import Goal
from actionkit._goal.stages import DOUBT, LONGEST_RESULT_PAUSE, CancelReason, Stage
from actionkit._model.cancel_answer import CancelAnswer
from actionkit._model.settings import Timeouts
from actionkit._model.values import CancelReport, GoalState

# --- what a server does of its own -------------------------------------------------------------


def test_a_goal_succeeds() -> None:
    life = Life()
    limits = [Arm(Timer.ACCEPT, 5.0), Arm(Timer.REASK, 1.0)]
    assert life.see("sent") == [Record(GoalState.SENT), *limits]
    # Asked for at once, because a result may expire (R25).
    assert AskResult(anew=True) in life.see("accepted")
    life.see("feedback")
    life.tell("result", GoalState.SUCCEEDED, "the result")
    assert life.ending == Ending(
        End.SUCCEEDED,
        GoalState.SUCCEEDED,
        result="the result",
        news=LastNews.STOPPED,
        ended_as=GoalState.SUCCEEDED,
    )
    assert life.states == [
        GoalState.SENT,
        GoalState.ACCEPTED,
        GoalState.EXECUTING,
        GoalState.SUCCEEDED,
    ]
    assert life.all[-1] == Release()
    assert life.timers == {}


def test_a_goal_is_rejected() -> None:
    life = Life()
    life.see(*UNTIL_SENT, "rejected")
    assert life.ending == Ending(End.REJECTED, GoalState.REJECTED, rejected=True)
    assert life.count(Release) == 1
    assert life.count(AskResult) == 0  # it would be answered with an empty result (R13)


def test_a_goal_is_aborted() -> None:
    life = Life()
    life.see(*UNTIL_ACCEPTED)
    life.tell("result", GoalState.ABORTED, "why")
    assert (life.end, life.ending.result) == (End.ABORTED, "why")  # type: ignore[union-attr]


def test_somebody_else_cancels() -> None:
    life = Life()
    life.see(*UNTIL_ACCEPTED)
    life.tell("status", GoalState.CANCELING)
    life.tell("result", GoalState.CANCELED, "so far")
    assert (life.end, life.report) == (End.CANCELED_BY_OTHER, None)
    assert life.goal.facts.others_cancel


def test_silence_is_no_stall_while_somebody_else_cancels() -> None:
    """A server may send no feedback while it cancels a goal; the caller does not give up on it."""
    life = Life(feedback=1.0)
    life.see(*UNTIL_ACCEPTED, "feedback")
    life.tell("status", GoalState.CANCELING)
    life.see("feedback")
    assert Timer.STALL not in life.timers
    life.wait_until(30.0)
    assert AskCancel() not in life.all
    life.tell("result", GoalState.ABORTED, None)
    assert life.end is End.ABORTED
    assert life.goal.facts.others_cancel


def test_the_first_news_of_a_goal_may_be_that_somebody_else_cancels_it() -> None:
    life = Life(feedback=1.0)
    life.see("sent")
    life.tell("status", GoalState.CANCELING)
    assert life.goal.facts.others_cancel
    assert Timer.STALL not in life.timers


def test_the_status_of_what_may_be_sent_again_is_read_from_the_beginning() -> None:
    life = Life()
    life.goal.watched_early = True
    assert WatchStatus() in life.see("sent")


def test_what_this_side_has_asked_for_was_not_cancelled_by_others() -> None:
    life = Life()
    life.see(*UNTIL_ACCEPTED, "cancel")
    life.tell("status", GoalState.CANCELING)
    assert not life.goal.facts.others_cancel


@pytest.mark.parametrize("proof", ["feedback", "status", "result", "cancel answer"])
def test_acceptance_is_proven_by_whatever_only_an_accepted_goal_causes(proof: str) -> None:
    life = Life()
    life.see(*UNTIL_SENT)
    if proof == "feedback":
        life.see("feedback")  # it may overtake the acknowledgement (R15)
    elif proof == "status":
        life.tell("status", GoalState.EXECUTING)
    elif proof == "result":
        life.tell("result", GoalState.SUCCEEDED, 1)
    else:
        life.tell("cancel_answered", CancelAnswer.ACCEPTED)
    assert life.states[1] is GoalState.ACCEPTED
    before = list(life.states)
    life.see("accepted")
    assert life.states == before


@pytest.mark.parametrize("repeated", ["feedback"])
def test_what_is_told_twice_counts_once(repeated: str) -> None:
    life = Life()
    for event in (*UNTIL_ACCEPTED, "feedback"):
        life.see(event)
        if event == repeated:
            assert life.see(event) == []
    life.tell("result", GoalState.SUCCEEDED, 1)
    assert life.tell("result", GoalState.ABORTED, 2) == []
    assert life.see("rejected") == []
    assert life.see("feedback") == []
    assert life.end is End.SUCCEEDED


def test_duplicates_of_everything_else() -> None:
    life = Life()
    life.see(*UNTIL_SENT, "rejected")
    assert life.see("rejected") == []
    life = Life()
    life.see(*UNTIL_ACCEPTED, "cancel")
    assert life.see("cancel") == []
    assert life.tell("close", abandon=False) == []
    life.tell("cancel_answered", CancelAnswer.ACCEPTED)
    life.tell("status", GoalState.CANCELING)
    assert life.states.count(GoalState.CANCELING) == 1
    life.tell("status", GoalState.CANCELED)
    assert life.tell("status", GoalState.CANCELED) == []
    life = Life()
    life.see(*UNTIL_ACCEPTED)
    life.tell("server_lost", "gone")
    assert life.tell("server_lost", "gone") == []


def test_states_never_go_back() -> None:
    life = Life()
    life.see(*UNTIL_ACCEPTED)
    for state in (GoalState.CANCELING, GoalState.EXECUTING, GoalState.ACCEPTED):
        life.tell("status", state)
    assert life.goal.state is GoalState.CANCELING


def test_a_second_acceptance_after_the_end_is_cancelled() -> None:
    life = Life()
    life.see(*UNTIL_SENT, "rejected")
    assert life.see("accepted") == [AskCancel()]  # by another server on the name (R14)


# --- the server is not there -------------------------------------------------------------------


@pytest.mark.parametrize("phase", [UNTIL_SENT, UNTIL_ACCEPTED])
def test_a_lost_server_ends_the_call_and_a_goal_that_comes_back_is_cancelled(
    phase: tuple[str, ...],
) -> None:
    life = Life()
    life.see(*phase)
    life.tell("server_lost", "its action server is gone")
    assert life.ending == Ending(
        End.LOST,
        GoalState.LOST,
        news=LastNews.SERVER_GONE,
        lost_because="its action server is gone",
    )
    assert life.count(Release) == 0
    assert life.timers == {}
    assert life.see("server_ready")[:2] == [AskCancel(), AskResult()]
    life.tell("status", GoalState.EXECUTING)
    assert life.goal.stage is Stage.ACCEPTED
    life.tell("result", GoalState.CANCELED, None)
    assert life.count(Release) == 1


@pytest.mark.parametrize("answer", ["cancel", "result"])
@pytest.mark.parametrize("back", [False, True])
def test_a_lost_goal_is_forgotten_when_its_own_server_does_not_know_it(
    answer: str, back: bool
) -> None:
    life = Life()
    life.see(*UNTIL_ACCEPTED)
    life.tell("server_lost", "gone")
    life.see("server_back" if back else "server_ready")
    if answer == "cancel":
        life.tell("cancel_answered", CancelAnswer.UNKNOWN_GOAL)
    else:
        life.tell("result", None, None)
    assert life.goal.stage is (Stage.OVER if back else Stage.LOST)
    assert life.count(Release) == back
    assert life.goal.facts.may_run != back
    assert not life.timers  # another server is not asked again and again


@pytest.mark.parametrize("answer", ["cancel", "result"])
def test_a_lost_goal_may_be_taken_yet_by_its_own_server(answer: str) -> None:
    life = Life()
    life.see(*UNTIL_SENT)
    life.tell("server_lost", "answered nothing for a while")
    assert life.see("server_back")[:2] == [AskCancel(), AskResult()]
    if answer == "cancel":
        life.tell("cancel_answered", CancelAnswer.UNKNOWN_GOAL)
    else:
        life.tell("result", None, None)
    assert life.goal.in_flight
    assert AskResult() in life.fire(Timer.REASK)
    assert AskCancel() in life.see("accepted")
    life.tell("result", GoalState.CANCELED, None)
    assert life.goal.stage is Stage.OVER


def test_a_goal_that_its_own_server_had_and_knows_no_more_is_over() -> None:
    life = Life()
    life.see(*UNTIL_ACCEPTED)
    life.tell("server_lost", "answered nothing for a while")
    life.see("server_back")
    life.tell("cancel_answered", CancelAnswer.UNKNOWN_GOAL)
    assert life.goal.stage is Stage.OVER


def test_a_broken_client_ends_the_call() -> None:
    life = Life()
    life.see(*UNTIL_ACCEPTED)
    effects = life.tell("fail", "the thread died", error := RuntimeError("x"))
    ending = Ending(End.LOST, GoalState.LOST, news=LastNews.NOTHING, error=error)
    assert effects == [Record(GoalState.LOST, "the thread died"), Settle(ending), Release()]
    assert life.goal.stage is Stage.OVER
    assert life.see("feedback") == []


# --- answers that are lost, or mislead ---------------------------------------------------------


def test_what_may_be_lost_is_asked_for_again_ever_more_rarely() -> None:
    life = Life(accept=None)
    life.see(*UNTIL_SENT)
    asked = []
    for second in range(100):
        before = life.count(AskResult)
        life.wait_until(second)
        if life.count(AskResult) > before:
            asked.append(second)
    assert asked == [1, 3, 7, 15, 31, 61, 91]
    assert life.count(WatchStatus) == len(asked)


def test_a_goal_that_merely_takes_long_is_hardly_asked_about() -> None:
    life = Life()
    life.see(*UNTIL_ACCEPTED)
    life.wait_until(100.0)
    assert life.count(AskResult) == 1 + 4
    assert life.count(AskCancel) == 0


def test_a_result_that_does_not_follow_its_status_is_asked_for_and_lost_in_the_end() -> None:
    life = Life(result=60.0)
    life.see(*UNTIL_ACCEPTED)
    life.tell("status", GoalState.SUCCEEDED)
    life.wait_until(0.5)
    assert life.all[-2:] == [AskResult(), Arm(Timer.REASK, 1.5)]
    life.wait_until(59.9)
    assert life.ending is None
    assert life.all.count(AskResult()) > 59.9 / LONGEST_RESULT_PAUSE
    life.wait_until(60.0)
    assert life.ending is not None
    assert (life.end, life.ending.ended_as) == (End.RESULT_LOST, GoalState.SUCCEEDED)
    assert "within 60 s" in life.ending.lost_because


def test_nobody_asks_for_ever_for_the_result_of_a_goal_whose_caller_is_gone() -> None:
    life = Life(3.0)
    life.see(*UNTIL_ACCEPTED)
    life.wait_until(3.0)
    life.tell("status", GoalState.SUCCEEDED)
    life.wait_until(5.0)
    assert (life.end, life.report) == (End.DEADLINE, CancelReport.CONFIRMED)
    life.wait_until(20.0)
    assert life.count(Release) == 1


def test_a_result_that_follows_its_status_late_is_taken() -> None:
    life = Life()
    life.see(*UNTIL_ACCEPTED)
    life.tell("status", GoalState.SUCCEEDED)
    life.wait_until(1.4)
    life.tell("result", GoalState.SUCCEEDED, 1)
    assert life.end is End.SUCCEEDED


def test_a_result_that_is_unknown_after_acceptance_is_lost() -> None:
    """It is asked for once more: a server that is just accepting the goal says so, too (R12)."""
    life = Life()
    life.see(*UNTIL_ACCEPTED)
    asked = life.all.count(AskResult())
    life.tell("result", None, None)
    life.tell("result", None, None)  # to what was asked before
    assert life.end is None
    life.wait_until(DOUBT)
    assert life.all.count(AskResult()) == asked + 1
    effects = life.tell("result", None, None)
    assert effects[0] == Record(GoalState.LOST, "the result cannot be had")
    assert (life.end, life.ending.ended_as) == (End.RESULT_LOST, None)  # type: ignore[union-attr]


def test_a_result_that_is_unknown_before_acceptance_says_nothing() -> None:
    life = Life()
    life.see(*UNTIL_SENT)
    assert life.tell("result", None, None) == []  # (R6)
    life.see("accepted")
    life.tell("result", GoalState.SUCCEEDED, 1)
    assert life.end is End.SUCCEEDED


# --- a request that is not answered (R4, R5) ---------------------------------------------------


def test_a_goal_not_known_so_far_was_not_rejected() -> None:
    life = Life()
    life.see(*UNTIL_SENT)
    life.tell("result", None, None)  # asked before the server took it (R6)
    assert life.end is None
    life.see("accepted")
    life.tell("result", GoalState.SUCCEEDED, 1)
    assert life.end is End.SUCCEEDED


def test_what_one_of_two_servers_has_ended_is_not_asked_for_by_each_answer_again() -> None:
    goal = Goal(uuid.uuid4(), Timeouts())
    goal.sent(0.0, servers=2)
    goal.accepted(0.0)
    goal.give_up(CancelReason.CANCELLED, 0.0)
    asked = {"asked_at": 0.0, "everybody": False}
    assert AskResult(anew=True) in goal.result(GoalState.SUCCEEDED, 1, 1.0, **asked)
    assert goal.result(GoalState.SUCCEEDED, 1, 1.0, **asked) == []
    assert not goal.settled  # the other server may run it
    assert any(isinstance(effect, Settle) for effect in goal.rejected(1.0))


def test_a_second_server_that_accepts_what_one_has_ended_may_run_it() -> None:
    goal = Goal(uuid.uuid4(), Timeouts())
    goal.sent(0.0)  # for one server: the other is not in sight so far
    goal.accepted(0.0)
    goal.status(GoalState.SUCCEEDED, 1.0)
    assert goal.facts.is_over
    goal.accepted(1.0)
    assert goal.facts.may_run
    effects = goal.result(GoalState.SUCCEEDED, 1, 2.0, asked_at=1.0, everybody=False)
    assert AskCancel() in effects
    assert Settle in map(type, effects)
    assert goal.facts.may_run


def test_a_second_server_that_accepts_what_was_cancelled_is_asked_to_cancel_it_at_once() -> None:
    """It read the first request to cancel before it had the goal, so it ignored it."""
    goal = Goal(uuid.uuid4(), Timeouts())
    goal.sent(0.0, servers=2)
    goal.accepted(0.0)
    assert AskCancel() in goal.give_up(CancelReason.CANCELLED, 1.0)
    assert AskCancel() in goal.accepted(2.0)


def test_what_one_of_two_servers_rejects_may_run_on_the_one_that_has_gone() -> None:
    goal = Goal(uuid.uuid4(), Timeouts())
    goal.sent(0.0, servers=2)
    goal.servers_changed(2, 1)
    (settle,) = (each for each in goal.rejected(1.0) if isinstance(each, Settle))
    assert settle.ending.end is End.LOST
    assert goal.facts.may_run
    assert not goal.facts.is_lost_with_server  # the one that has gone may have rejected it
    goal.servers_changed(2, 2)
    assert goal.facts.is_lost_with_server


def test_a_goal_of_a_server_that_has_gone_is_lost_when_the_other_had_time_to_accept_it() -> None:
    """The other one came when the goal had just been sent, and never got it."""
    goal = Goal(uuid.uuid4(), Timeouts(accept=5.0))
    goal.sent(0.0)
    goal.accepted(0.0)
    goal.servers_changed(2, 0)
    goal.servers_changed(2, 1)
    assert goal.result(None, None, 4.0, asked_at=3.9) == []  # it may still accept it
    (settle,) = (e for e in goal.result(None, None, 6.0, asked_at=5.9) if isinstance(e, Settle))
    assert settle.ending.end is End.LOST
    assert goal.facts.known_to_run is None
    assert not goal.facts.is_lost_with_server
    assert AskCancel() in goal.accepted(7.0)


def test_without_a_limit_for_the_acceptance_such_a_goal_is_lost_all_the_same() -> None:
    """The call was accepted once: without a deadline, it would wait for ever."""
    goal = Goal(uuid.uuid4(), Timeouts(accept=None))
    goal.sent(0.0)
    goal.accepted(0.0)
    goal.servers_changed(2, 0)
    goal.servers_changed(2, 1)
    assert goal.result(None, None, 4.0, asked_at=3.9) == []
    (settle,) = (e for e in goal.result(None, None, 31.0, asked_at=30.9) if isinstance(e, Settle))
    assert settle.ending.end is End.LOST
    assert not goal.facts.is_lost_with_server


def test_what_one_of_two_servers_has_ended_may_run_on_the_one_that_is_back_and_lost_again() -> None:
    goal = Goal(uuid.uuid4(), Timeouts())
    goal.sent(0.0, servers=2)
    goal.accepted(0.0)
    goal.accepted(0.0)
    goal.servers_changed(2, 1)
    goal.result(GoalState.SUCCEEDED, None, 1.0, asked_at=0.5, everybody=False)
    goal.result(None, None, 2.0, asked_at=1.5)
    assert goal.stage is Stage.LOST
    goal.cancel_answered(CancelAnswer.REFUSED, 3.0, asked_at=1.0)
    assert goal.stage is Stage.ELSEWHERE
    goal.servers_changed(2, 2)
    goal.server_lost("it is gone", 4.0)
    assert goal.facts.may_run


def test_what_one_of_two_servers_rejects_after_both_were_lost_is_still_followed() -> None:
    goal = Goal(uuid.uuid4(), Timeouts())
    goal.sent(0.0, servers=2)
    goal.server_lost("it is gone", 1.0)
    assert goal.rejected(2.0) == []
    assert goal.facts.may_run
    assert AskCancel() in goal.server_back(3.0)
