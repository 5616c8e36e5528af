"""The life of a goal, situation by situation. What is checked of every order of
events is checked of these too: see goal_life.
"""

from __future__ import annotations

import uuid
from collections.abc import Iterator
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
    RunsElsewhere,
    Settle,
    StopCancel,
    Timer,
    WatchStatus,
)
from actionkit._goal.facts import GoalFacts
from actionkit._goal.machine import Goal
from actionkit._goal.stages import CONFIRMED_AFTER, LONGEST_RESULT_PAUSE, CancelReason, Stage
from actionkit._model.cancel_answer import CancelAnswer
from actionkit._model.settings import Timeouts
from actionkit._model.values import CancelReport, GoalFate, GoalReport, GoalState

ONE_IS_GONE = "one of its action servers is gone, and the others do not have it"


# --- what a server does of its own -------------------------------------------------------------


def test_a_goal_succeeds() -> None:
    life = Life()
    assert life.goal.state is GoalState.SENDING
    limits = [Arm(Timer.ACCEPT, 5.0), Arm(Timer.REASK, 1.0)]
    assert life.see("sent") == [Record(GoalState.SENT), *limits]
    assert life.see("accepted") == [
        Disarm(Timer.ACCEPT),
        Record(GoalState.ACCEPTED),
        AskResult(anew=True),  # at once, because a result may expire (R25)
        Arm(Timer.REASK, 1.0),
    ]
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
    life = Life().after(*UNTIL_SENT, "rejected")
    assert life.ending == Ending(End.REJECTED, GoalState.REJECTED, rejected=True)
    assert life.count(Release) == 1
    assert life.count(AskResult) == 0  # it would be answered with an empty result (R13)


def test_a_goal_is_aborted() -> None:
    life = Life().after(*UNTIL_ACCEPTED)
    life.tell("result", GoalState.ABORTED, "why")
    assert (life.end, life.ended.result) == (End.ABORTED, "why")


def test_somebody_else_cancels() -> None:
    life = Life().after(*UNTIL_ACCEPTED)
    life.tell("status", GoalState.CANCELING)
    life.tell("result", GoalState.CANCELED, "so far")
    assert (life.end, life.report) == (End.CANCELED_BY_OTHER, None)
    assert life.goal.facts.others_cancel


def test_silence_is_no_stall_while_somebody_else_cancels() -> None:
    """A server may send no feedback while it cancels a goal; the caller does not give up on it."""
    life = Life(feedback=1.0).after(*UNTIL_ACCEPTED, "feedback")
    life.tell("status", GoalState.CANCELING)
    life.see("feedback")
    assert Timer.STALL not in life.timers
    life.wait_until(30.0)
    assert AskCancel() not in life.all
    life.tell("result", GoalState.ABORTED, None)
    assert life.end is End.ABORTED
    assert life.goal.facts.others_cancel


def test_the_first_news_of_a_goal_may_be_that_somebody_else_cancels_it() -> None:
    life = Life(feedback=1.0).after("sent")
    life.tell("status", GoalState.CANCELING)
    assert life.goal.facts.others_cancel
    assert Timer.STALL not in life.timers


def test_the_status_of_what_may_be_sent_again_is_read_from_the_beginning() -> None:
    life = Life()
    life.goal.watched_early = True
    assert WatchStatus() in life.see("sent")


def test_what_this_side_has_asked_for_was_not_cancelled_by_others() -> None:
    life = Life().after(*UNTIL_ACCEPTED, "cancel")
    life.tell("status", GoalState.CANCELING)
    assert not life.goal.facts.others_cancel


@pytest.mark.parametrize("proof", ["feedback", "status", "result", "cancel answer"])
def test_acceptance_is_proven_by_whatever_only_an_accepted_goal_causes(proof: str) -> None:
    life = Life().after(*UNTIL_SENT)
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


def test_the_end_may_be_the_first_that_is_heard_of_a_goal() -> None:
    life = Life(feedback=5.0, result=60.0).after("sent")
    assert life.tell("status", GoalState.SUCCEEDED) == [
        Disarm(Timer.ACCEPT),
        Record(GoalState.ACCEPTED),
        AskResult(anew=True),
        Arm(Timer.REASK, 1.0),
        Arm(Timer.STALL, 5.0),
        Disarm(Timer.STALL),
        Arm(Timer.REASK, 0.5),
        Arm(Timer.RESULT, 60.0),
    ]


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
    life = Life().after(*UNTIL_SENT, "rejected")
    assert life.see("rejected") == []
    life = Life().after(*UNTIL_ACCEPTED, "cancel")
    assert life.see("cancel") == []
    assert life.tell("close", abandon=False) == []
    life.tell("cancel_answered", CancelAnswer.ACCEPTED)
    life.tell("status", GoalState.CANCELING)
    assert life.states.count(GoalState.CANCELING) == 1
    life.tell("status", GoalState.CANCELED)
    assert life.tell("status", GoalState.CANCELED) == []
    life = Life().after(*UNTIL_ACCEPTED)
    life.tell("server_lost", "gone")
    assert life.tell("server_lost", "gone") == []
    life = Life().after(*UNTIL_ACCEPTED)
    assert life.see("rejected") == []
    life.goal.servers_changed(2, 0)
    assert life.goal.facts.undecided  # that was no answer of the second server


def test_states_never_go_back() -> None:
    life = Life().after(*UNTIL_ACCEPTED)
    forth = [GoalState.ACCEPTED, GoalState.EXECUTING, GoalState.CANCELING]
    for state in (*forth, *reversed(forth)):
        life.tell("status", state)
    assert life.states == [GoalState.SENT, *forth]
    assert life.goal.state is GoalState.CANCELING


# --- the server is not there -------------------------------------------------------------------


@pytest.mark.parametrize("phase", [UNTIL_SENT, UNTIL_ACCEPTED])
def test_a_lost_server_ends_the_call_and_a_goal_that_comes_back_is_cancelled(
    phase: tuple[str, ...],
) -> None:
    life = Life().after(*phase)
    ending = Ending(
        End.LOST,
        GoalState.LOST,
        news=LastNews.SERVER_GONE,
        lost_because="its action server is gone",
    )
    assert life.tell("server_lost", "its action server is gone") == [
        Disarm(Timer.REASK),
        Record(GoalState.LOST, "its action server is gone"),
        Settle(ending),
    ]
    assert life.count(Release) == 0
    assert life.timers == {}
    assert life.see("server_ready")[:2] == [AskCancel(), AskResult(anew=True)]
    life.tell("status", GoalState.EXECUTING)
    assert life.goal.stage is Stage.ACCEPTED
    life.tell("result", GoalState.CANCELED, None)
    assert life.count(Release) == 1


@pytest.mark.parametrize(
    ("phase", "event", "late"),
    [
        (UNTIL_SENT, ("rejected",), (GoalState.REJECTED, None)),
        (UNTIL_ACCEPTED, ("result", GoalState.SUCCEEDED, 1), (GoalState.SUCCEEDED, 1)),
    ],
)
def test_a_lost_goal_is_over_when_its_end_comes(
    phase: tuple[str, ...], event: tuple[Any, ...], late: tuple[Any, ...]
) -> None:
    life = Life().after(*phase)
    life.tell("server_lost", "gone")
    assert life.tell(*event) == [Record(late[0]), LateResult(*late), Release()]


def test_a_server_that_comes_is_asked_for_the_result_of_a_goal_that_was_accepted() -> None:
    """It may be the same one after a restart, and says that it does not know the goal (R1)."""
    life = Life()
    assert life.see("sent", "server_ready") == []
    assert life.see("accepted", "server_ready") == [AskResult()]
    assert life.see("server_back") == [AskResult()]


def test_the_state_of_a_lost_goal_is_shown_when_it_is_back() -> None:
    life = Life().after(*UNTIL_ACCEPTED)
    life.tell("server_lost", "gone")
    life.see("server_back")
    assert life.goal.facts.lost is False
    life.tell("status", GoalState.ACCEPTED)
    assert life.goal.state is GoalState.ACCEPTED


def test_a_lost_goal_that_was_back_may_be_lost_again() -> None:
    life = Life().after(*UNTIL_ACCEPTED)
    life.tell("server_lost", "gone")
    life.see("server_back")
    life.tell("server_lost", "gone")
    assert life.goal.facts.fate is GoalFate.LOST


def test_a_server_may_go_away_before_it_has_sent_the_result() -> None:
    life = Life().after(*UNTIL_ACCEPTED)
    life.tell("status", GoalState.SUCCEEDED)
    assert life.tell("server_lost", "gone")[0] == Record(GoalState.LOST, "the result cannot be had")
    assert life.ending == Ending(
        End.RESULT_LOST,
        GoalState.LOST,
        ended_as=GoalState.SUCCEEDED,
        lost_because="gone",
    )
    assert life.count(Release) == 1


@pytest.mark.parametrize(
    ("timer", "events"),
    [
        (Timer.ACCEPT, UNTIL_ACCEPTED),
        (Timer.CANCEL, UNTIL_SENT),
        (Timer.STALL, UNTIL_SENT),
        (Timer.RESULT, UNTIL_ACCEPTED),
    ],
)
def test_a_timer_that_has_nothing_to_limit_changes_nothing(
    timer: Timer, events: tuple[str, ...]
) -> None:
    life = Life().after(*events)
    assert life.tell("timer", timer) == []


def test_another_server_says_nothing_of_a_goal() -> None:
    """Only the one that it was sent to may have it (C5.7)."""
    life = Life().after(*UNTIL_ACCEPTED)
    for _ in range(2):
        assert life.tell("result", None, None, own=False) == []
        life.wait_until(life.now + CONFIRMED_AFTER)
    life.goal.servers_changed(1, 1)
    assert life.tell("result", None, None, own=False) == []
    life.tell("server_lost", "gone")
    asks_no_more = [Disarm(Timer.REASK), StopCancel()]
    assert life.tell("result", None, None, own=False, everybody=False) == asks_no_more


@pytest.mark.parametrize("answer", ["cancel", "result"])
@pytest.mark.parametrize("back", [False, True])
def test_a_lost_goal_is_forgotten_when_its_own_server_does_not_know_it(
    answer: str, back: bool
) -> None:
    life = Life().after(*UNTIL_ACCEPTED)
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
    life = Life().after(*UNTIL_SENT)
    life.tell("server_lost", "answered nothing for a while")
    assert life.see("server_back")[:2] == [AskCancel(), AskResult(anew=True)]
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
    life = Life().after(*UNTIL_ACCEPTED)
    life.tell("server_lost", "answered nothing for a while")
    life.see("server_back")
    life.tell("cancel_answered", CancelAnswer.UNKNOWN_GOAL)
    assert life.goal.stage is Stage.OVER


def test_a_broken_client_ends_the_call() -> None:
    life = Life().after(*UNTIL_ACCEPTED)
    effects = life.tell("fail", "the thread died", error := RuntimeError("x"))
    ending = Ending(End.LOST, GoalState.LOST, news=LastNews.NOTHING, error=error)
    assert effects == [Record(GoalState.LOST, "the thread died"), Settle(ending), Release()]
    assert life.goal.stage is Stage.OVER
    assert life.see("feedback") == []


# --- answers that are lost, or mislead ---------------------------------------------------------


def test_what_may_be_lost_is_asked_for_again_ever_more_rarely() -> None:
    life = Life(accept=None).after(*UNTIL_SENT)
    asked = []
    for second in range(100):
        before = life.count(AskResult)
        life.wait_until(second)
        if life.count(AskResult) > before:
            asked.append(second)
    assert asked == [1, 3, 7, 15, 31, 61, 91]
    assert life.count(WatchStatus) == len(asked)


def test_a_goal_that_merely_takes_long_is_hardly_asked_about() -> None:
    life = Life().after(*UNTIL_ACCEPTED, until=100.0)
    assert life.count(AskResult) == 1 + 4
    assert life.count(AskCancel) == 0


def test_a_result_that_does_not_follow_its_status_is_asked_for_and_lost_in_the_end() -> None:
    life = Life(result=60.0).after(*UNTIL_ACCEPTED)
    life.tell("status", GoalState.SUCCEEDED)
    life.wait_until(0.5)
    assert life.all[-2:] == [AskResult(), Arm(Timer.REASK, 1.5)]
    life.wait_until(59.9)
    assert life.ending is None
    assert life.all.count(AskResult()) > 59.9 / LONGEST_RESULT_PAUSE
    life.wait_until(60.0)
    assert (life.end, life.ended.ended_as) == (End.RESULT_LOST, GoalState.SUCCEEDED)
    assert "within 60 s" in life.ended.lost_because


def test_nobody_asks_for_ever_for_the_result_of_a_goal_whose_caller_is_gone() -> None:
    life = Life(3.0).after(*UNTIL_ACCEPTED, until=3.0)
    life.tell("status", GoalState.SUCCEEDED)
    life.wait_until(5.0)
    assert (life.end, life.report) == (End.DEADLINE, CancelReport.CONFIRMED)
    life.wait_until(20.0)
    assert life.all.count(AskResult()) == 3
    assert life.count(Release) == 1


def test_a_result_that_follows_its_status_late_is_taken() -> None:
    life = Life().after(*UNTIL_ACCEPTED)
    assert life.goal.awaits_result_of is None
    life.tell("status", GoalState.SUCCEEDED)
    assert life.goal.awaits_result_of is GoalState.SUCCEEDED
    life.wait_until(1.4)
    life.tell("result", GoalState.SUCCEEDED, 1)
    assert life.end is End.SUCCEEDED
    assert life.goal.awaits_result_of is None


def test_a_result_that_is_unknown_after_acceptance_is_lost() -> None:
    """It is asked for once more: a server that is just accepting the goal says so, too (R12)."""
    life = Life().after(*UNTIL_ACCEPTED)
    asked = life.all.count(AskResult())
    life.tell("result", None, None)
    life.tell("result", None, None)  # to what was asked before
    assert life.end is None
    life.wait_until(CONFIRMED_AFTER)
    assert life.all.count(AskResult()) == asked + 1
    effects = life.tell("result", None, None)
    assert effects[0] == Record(GoalState.LOST, "the result cannot be had")
    assert life.ended.lost_because == "its server no longer knows the goal"
    assert (life.end, life.ended.ended_as) == (End.RESULT_LOST, None)


def test_a_result_that_is_unknown_before_acceptance_says_nothing() -> None:
    life = Life().after(*UNTIL_SENT)
    assert life.tell("result", None, None) == []  # (R6)
    life.see("accepted")
    life.tell("result", GoalState.SUCCEEDED, 1)
    assert life.end is End.SUCCEEDED


# --- a request that is not answered (R4, R5) ---------------------------------------------------


def test_a_goal_not_known_so_far_was_not_rejected() -> None:
    life = Life().after(*UNTIL_SENT)
    life.tell("result", None, None)  # asked before the server took it (R6)
    assert life.end is None
    life.see("accepted")
    life.tell("result", GoalState.SUCCEEDED, 1)
    assert life.end is End.SUCCEEDED


# --- what somebody else has sent ---------------------------------------------------------------


def followed(*, left_alone: bool) -> Goal:
    goal = Goal(uuid.uuid4(), Timeouts())
    goal.attached(0.0, 1, left_alone=left_alone)
    return goal


@pytest.mark.parametrize("just_sent", [False, True])
def test_a_goal_that_was_sent_just_now_may_be_accepted_yet(just_sent: bool) -> None:
    goal = Goal(uuid.uuid4(), Timeouts())
    asks = goal.attached(0.0, 1, left_alone=False, just_sent=just_sent)
    assert Arm(Timer.ACCEPT, 5.0 + 9.0 * just_sent) in asks
    for now in (0.1, 0.5, 9.0):
        goal.result(None, None, now, asked_at=now)
    assert goal.settled is not just_sent
    goal.result(None, None, 9.2, asked_at=9.2)
    assert goal.settled


def test_the_time_for_its_acceptance_does_not_begin_again_with_another_call() -> None:
    goal = Goal(uuid.uuid4(), Timeouts())
    goal.attached(0.0, 1, left_alone=False, just_sent=True)
    goal.result(None, None, 0.1, asked_at=0.1)
    goal.attached_again(Timeouts(), 9.0, 1, left_alone=False)
    goal.result(None, None, 9.2, asked_at=9.2)
    assert goal.settled


def test_what_somebody_else_has_sent_is_asked_for() -> None:
    goal = Goal(uuid.uuid4(), Timeouts())
    assert goal.attached(0.0, 2, left_alone=True) == [
        WatchStatus(),
        AskResult(),
        Arm(Timer.ACCEPT, 5.0),
        Arm(Timer.REASK, 1.0),
    ]
    assert goal.state is GoalState.SENT
    assert goal.facts.servers == 2


@pytest.mark.parametrize(
    ("why", "end"),
    [
        (None, End.UNKNOWN),
        (CancelReason.CANCELLED, End.UNKNOWN),
        (CancelReason.DEADLINE, End.DEADLINE),
        (CancelReason.CLOSED, End.CLOSED),
    ],
)
def test_what_no_server_knows_cannot_be_followed(why: CancelReason | None, end: End) -> None:
    goal = followed(left_alone=False)
    if why is not None:
        goal.give_up(why, 0.0)
    assert goal.result(None, None, 1.0, asked_at=0.9) == [Arm(Timer.REASK, 1.0 + CONFIRMED_AFTER)]
    late = end is End.DEADLINE
    ending = Ending(
        end,
        GoalState.TIMED_OUT if late else GoalState.LOST,
        phase="accept" if late else "",
        given_up=why is not None,
    )
    assert goal.result(None, None, 2.0, asked_at=1.9) == [
        Record(GoalState.LOST, "no server knows it"),
        Settle(ending),
        Release(),
    ]
    assert goal.facts.fate is GoalFate.ENDED


def test_what_is_only_followed_is_left_when_its_server_is_lost() -> None:
    goal = followed(left_alone=True)
    goal.status(GoalState.EXECUTING, 1.0, ours=True)
    effects = goal.server_lost("gone", 2.0)
    assert effects[1] == Record(GoalState.LOST, "gone")
    assert endings(effects)[0].end is End.LOST
    assert effects[-1] == Release()
    assert goal.facts.fate is GoalFate.LEFT


def test_what_somebody_else_has_sent_to_the_only_server_ends_with_its_answer() -> None:
    goal = followed(left_alone=False)
    effects = goal.result(GoalState.SUCCEEDED, 1, 1.0, asked_at=0.0, everybody=False)
    assert effects[-1] == Release()
    assert goal.facts.is_over


# --- several servers on one name ---------------------------------------------------------------


@pytest.mark.parametrize("wanted", [True, False])
def test_a_goal_that_two_servers_accept_is_cancelled_only_if_nobody_wants_it(wanted: bool) -> None:
    goal = on_two(accepted=1)
    if not wanted:
        goal.give_up(CancelReason.CANCELLED, 1.0)
    cancel = [] if wanted else [AskCancel()]
    assert goal.accepted(2.0) == [AskResult(anew=True), *cancel]


def test_what_one_of_two_servers_rejects_is_over_for_its_caller() -> None:
    ending = Ending(End.REJECTED, GoalState.REJECTED, news=LastNews.NOTHING, elsewhere=True)
    goal = on_two()
    assert goal.rejected(1.0) == [Record(GoalState.REJECTED), Settle(ending), Release()]
    assert goal.facts.known_to_run is False


def test_what_one_of_two_servers_rejects_is_cancelled_on_the_other_if_it_was_given_up() -> None:
    goal = on_two()
    goal.give_up(CancelReason.CANCELLED, 1.0)
    assert goal.rejected(2.0) == [
        Record(GoalState.REJECTED),
        Disarm(Timer.STALL),
        AskCancel(),
        AskResult(anew=True),
        Arm(Timer.REASK, 3.0),
    ]
    goal.server_lost("gone", 3.0)
    goal.server_back(4.0)
    assert goal.stage is Stage.ANOTHER_MAY_RUN  # what one has rejected is not waited for again


def test_both_of_two_servers_that_were_lost_may_reject_it() -> None:
    goal = on_two()
    goal.server_lost("gone", 1.0)
    assert goal.rejected(2.0) == []
    assert goal.rejected(2.0)[-1] == Release()


def test_a_rejection_is_the_answer_of_a_server_that_does_not_run_it() -> None:
    """Two of three reject what the first one runs; so its end is the end of the goal."""
    goal = sent_to(3, accepted=1)
    assert goal.rejected(0.0) == []
    assert goal.rejected(0.0) == []
    goal.give_up(CancelReason.CANCELLED, 1.0)
    effects = goal.result(GoalState.CANCELED, None, 2.0, asked_at=0.0, everybody=False)
    assert effects[-1] == Release()
    assert goal.facts.is_over


def test_a_rejection_does_not_end_what_another_server_runs() -> None:
    goal = sent_to(3, accepted=2)
    goal.result(GoalState.ABORTED, None, 1.0, asked_at=0.0, everybody=False)
    assert goal.rejected(1.0) == []
    assert goal.facts.known_to_run


def test_what_a_third_server_accepts_after_two_have_ended_it_is_cancelled() -> None:
    goal = sent_to(3, accepted=2)
    goal.result(GoalState.ABORTED, None, 1.0, asked_at=0.0, everybody=False)
    effects = goal.result(GoalState.ABORTED, 2, 1.0, asked_at=0.0, everybody=False, ends=2)
    assert effects == [LateResult(GoalState.ABORTED, 2), Release()]
    assert accepted_late(goal.facts, 2.0) == CANCELLED_ELSEWHERE


CANCELLED_ELSEWHERE = [AskCancel(), AskResult(anew=True), Arm(Timer.REASK, 3.0)]


def accepted_late(facts: GoalFacts, now: float) -> list[Effect]:
    """A server accepts a goal that was released; two may have it."""
    return Goal(facts.goal_id, Timeouts()).taken_back(facts, 2, now)


def test_what_a_server_accepts_that_the_others_have_rejected_is_cancelled() -> None:
    goal = sent_to(1)
    assert goal.rejected(1.0)[-1] == Release()
    assert accepted_late(goal.facts, 2.0) == CANCELLED_ELSEWHERE
    assert goal.facts.known_to_run


def test_the_late_acceptance_of_the_server_that_has_ended_it_takes_nothing_back() -> None:
    """If packets are lost, it may come after the result."""
    goal = sent_to(1)
    assert goal.result(GoalState.SUCCEEDED, None, 1.0, asked_at=0.0)[-1] == Release()
    assert accepted_late(goal.facts, 2.0) == [Release()]
    assert goal.facts.known_to_run is False
    assert accepted_late(goal.facts, 2.0) == CANCELLED_ELSEWHERE  # another server's


def test_what_is_taken_back_is_not_over_before_each_server_that_accepted_it_has_answered() -> None:
    """The one that has just accepted it may not be in sight yet."""
    facts = sent_to(1, accepted=1).facts
    facts.ended, facts.ends = True, 1
    goal = Goal(facts.goal_id, Timeouts())
    goal.taken_back(facts, 1, 2.0)
    assert goal.result(None, None, 5.0, asked_at=4.0, answers=1) == []
    assert facts.known_to_run
    goal.servers_changed(1, 0)
    assert goal.result(None, None, 5.0, asked_at=4.0, answers=1) == []
    assert goal.result(None, None, 5.0, asked_at=4.0, answers=2) == [Release()]
    assert facts.known_to_run is False


def test_a_server_that_accepted_it_and_is_never_in_sight_does_not_run_it_for_ever() -> None:
    """Nothing tells that it has left: only that all others have answered, again and again."""
    goal = sent_to(1, accepted=2)
    goal.result(GoalState.SUCCEEDED, None, 1.0, asked_at=0.5, answers=1)
    now = 1.0
    for pause in (1.0, 2.0, 4.0, 8.0, 16.0):
        assert (goal.stage, goal.facts.known_to_run) == (Stage.ANOTHER_MAY_RUN, True)
        now += pause
        goal.timer(Timer.REASK, now)
        goal.result(GoalState.SUCCEEDED, None, now, asked_at=now, answers=1)
    assert goal.timer(Timer.REASK, now + 30.0) == [StopCancel(), Disarm(Timer.REASK)]
    assert goal.facts.known_to_run is None
    assert not goal.facts.blocks_another(unless_gone=True)
    assert AskCancel() in goal.server_back(200.0)
    goal.result(GoalState.SUCCEEDED, None, 202.0, asked_at=201.0, answers=2)
    assert goal.facts.is_over


def test_a_call_does_not_wait_for_ever_for_a_server_that_accepted_and_was_never_in_sight() -> None:
    goal = sent_to(1, accepted=2, at=1.0, accept=5.0)
    for now in (9.0, 38.9):  # it may come yet
        assert goal.result(None, None, now, asked_at=now, answers=1) == []
        assert AskResult() in goal.timer(Timer.REASK, now)
    (ending,) = endings(goal.result(None, None, 39.0, asked_at=39.0, answers=1))
    assert (ending.end, ending.lost_because) == (End.LOST, ONE_IS_GONE)
    assert goal.facts.blocks_another(unless_gone=True)  # that it has left was not seen


def test_what_is_taken_back_is_not_gone_with_the_server_that_had_it_first() -> None:
    goal = sent_to(1, accepted=1)
    goal.servers_changed(1, 1)
    goal.server_lost("gone", 1.0)
    goal.result(GoalState.SUCCEEDED, None, 1.0, asked_at=0.5)  # it has sent that before
    again = Goal(goal.facts.goal_id, Timeouts())
    again.taken_back(goal.facts, 1, 2.0)
    again.server_lost("the other one is silent", 3.0)
    assert again.facts.blocks_another(unless_gone=True)


def test_a_caller_that_cancels_all_the_time_does_not_keep_it_from_being_over() -> None:
    goal = on_two(accepted=2)
    goal.result(GoalState.SUCCEEDED, None, 1.0, asked_at=0.5, everybody=False)
    for tick in range(20, 30):
        assert goal.give_up(CancelReason.CANCELLED, tick / 10) == [AskCancel()]
    assert Release() in goal.result(None, None, 3.0, asked_at=2.9, answers=2)


@pytest.mark.parametrize(
    ("asked_at", "everybody", "over"),
    [(1.0 + CONFIRMED_AFTER, True, True), (1.0, True, False), (9.0, False, False)],
)
def test_what_one_of_two_servers_has_ended_is_over_if_the_other_denied_it_after_its_acceptance(
    asked_at: float, everybody: bool, over: bool
) -> None:
    """A server that is just accepting a goal answers as if it did not know it (R12)."""
    goal = on_two(accepted=1)
    goal.accepted(1.0)
    goal.result(GoalState.SUCCEEDED, 1, 9.0, asked_at=asked_at, everybody=everybody)
    assert goal.facts.is_over is over
    assert goal.stage is (Stage.OVER if over else Stage.ANOTHER_MAY_RUN)


@pytest.mark.parametrize(
    ("first", "second", "end"),
    [
        (GoalState.CANCELED, GoalState.SUCCEEDED, End.SUCCEEDED),
        (GoalState.SUCCEEDED, GoalState.CANCELED, End.SUCCEEDED),
        (GoalState.ABORTED, GoalState.CANCELED, End.ABORTED),
    ],
)
def test_of_two_results_of_what_was_cancelled_a_success_counts_and_else_the_first(
    first: GoalState, second: GoalState, end: End
) -> None:
    goal = on_two(accepted=2)
    goal.give_up(CancelReason.CANCELLED, 1.0)
    goal.result(first, first, 1.0, asked_at=0.0, everybody=False)
    assert not goal.settled
    effects = goal.result(second, second, 2.0, asked_at=0.0, ends=2)
    (ending,) = endings(effects)
    assert (ending.end, ending.result) == (
        end,
        GoalState.SUCCEEDED if end is End.SUCCEEDED else first,
    )


def test_the_result_of_the_second_server_is_told_of_when_the_first_has_ended_the_call() -> None:
    goal = on_two(accepted=2)
    ending = Ending(End.ABORTED, GoalState.ABORTED, result=1, news=LastNews.NOTHING, elsewhere=True)
    assert goal.result(GoalState.ABORTED, 1, 1.0, asked_at=0.0, everybody=False) == [
        Record(GoalState.ABORTED),
        Disarm(Timer.STALL),
        Settle(ending),
        AskCancel(),
        AskResult(anew=True),
        Arm(Timer.REASK, 2.0),
    ]
    assert goal.may_run
    again = goal.result(GoalState.ABORTED, 1, 2.0, asked_at=0.0, everybody=False)
    assert again == [LateResult(GoalState.ABORTED, 1)]
    effects = goal.result(GoalState.SUCCEEDED, 2, 3.0, asked_at=1.0)
    assert effects == [LateResult(GoalState.SUCCEEDED, 2), Release()]


@pytest.mark.parametrize("accepted", [0, 1])
@pytest.mark.parametrize(("everybody", "own"), [(False, True), (True, False)])
def test_that_one_of_two_servers_does_not_know_it_says_nothing(
    accepted: int, everybody: bool, own: bool
) -> None:
    goal = on_two(accepted=accepted)
    assert goal.result(None, None, 1.0, asked_at=0.9, everybody=everybody, own=own) == []
    assert goal.may_run
    goal.server_lost("gone", 2.0)
    # Asking others goes on until each of them has denied it.
    asks_no_more = [Disarm(Timer.REASK), StopCancel()] if everybody else []
    effects = goal.result(None, None, 3.0, asked_at=2.9, everybody=everybody, own=own)
    assert effects == asks_no_more


def test_what_neither_of_two_servers_knows_is_waited_for_no_more_after_its_limit() -> None:
    goal = on_two()
    goal.timer(Timer.ACCEPT, 5.0)
    (ending,) = endings(goal.result(None, None, 5.1, asked_at=5.0))
    assert ending.end is End.NO_ACCEPTANCE


def test_what_one_of_two_servers_may_yet_accept_is_not_over_when_the_other_is_back() -> None:
    goal = on_two(accepted=1)
    goal.server_lost("answered nothing for a while", 1.0)
    goal.server_back(2.0)
    assert goal.result(None, None, 3.0, asked_at=2.9) == []
    assert goal.in_flight


def asked_elsewhere(goal: Goal, *, denied: bool = False) -> Iterator[tuple[float, list[Effect]]]:
    """Yield when a second server is asked about a goal, and with what, until it is over."""
    due = 1.0
    for _ in range(10):
        if denied:
            assert goal.result(None, None, due, asked_at=due) == []
        effects = goal.timer(Timer.REASK, due)
        yield due, effects
        due += sum(each.at - due for each in effects if isinstance(each, Arm))
        if goal.stage is not Stage.ANOTHER_MAY_RUN:
            return


def test_what_the_second_server_denies_for_a_minute_is_over() -> None:
    """It has not said whether it accepts the goal, and answers that it does not know it."""
    goal = on_two()
    goal.give_up(CancelReason.CANCELLED, 0.0)
    goal.rejected(0.0)
    *before, (at, effects) = asked_elsewhere(goal, denied=True)
    assert [due for due, _ in before] == [1.0, 3.0, 7.0, 15.0, 31.0]
    assert at == 61.0
    assert endings(effects)[0].end is End.CANCELLED_BY_CALLER
    assert effects[-1] == Release()
    assert goal.facts.is_over


@pytest.mark.parametrize("accepted", [1, 2])
def test_what_the_second_server_does_not_deny_is_cancelled_for_ever(accepted: int) -> None:
    goal = on_two(accepted=accepted)
    goal.give_up(CancelReason.CANCELLED, 0.0)
    goal.result(GoalState.CANCELED, None, 0.0, asked_at=0.0, everybody=False)
    asked = dict(asked_elsewhere(goal))
    assert list(asked) == [1.0, 3.0, 7.0, 15.0, 31.0, 61.0, 91.0, 121.0, 151.0, 181.0]
    assert all(effects[:2] == [AskCancel(), AskResult()] for effects in asked.values())
    # The user is warned once, and only if it has shown that it runs the goal.
    warned = [due for due, effects in asked.items() if RunsElsewhere() in effects]
    assert warned == ([15.0] if accepted == 2 else [])


def test_what_runs_on_a_server_that_has_left_is_lost_with_it_when_the_other_denies_it() -> None:
    goal = on_two(accepted=1)
    goal.rejected(0.0)
    assert goal.servers_changed(2, 1) == [AskResult(anew=True)]
    (ending,) = endings(goal.result(None, None, 1.0, asked_at=0.9))
    assert (ending.end, ending.lost_because) == (End.LOST, ONE_IS_GONE)
    assert goal.facts.is_lost_with_server
    goal.servers_changed(2, 1)
    assert goal.facts.is_lost_with_server
    goal.servers_changed(2, 0)
    assert not goal.facts.is_lost_with_server


@pytest.mark.parametrize("how", ["the other denies it", "lost", "result not sent"])
def test_an_end_that_was_shown_before_the_second_server_came_goes_with_the_first(how: str) -> None:
    goal = sent_to(1, accepted=1, accept=5.0)
    goal.give_up(CancelReason.CANCELLED, 0.0)
    goal.status(GoalState.SUCCEEDED, 0.0, ours=True)
    goal.servers_changed(2, 0)
    goal.servers_changed(2, 1)
    if how == "lost":
        effects = goal.server_lost("gone", 6.0)
    elif how == "result not sent":
        effects = goal.timer(Timer.RESULT, 6.0)
    else:
        effects = goal.result(None, None, 6.0, asked_at=5.9)
    assert effects == [
        Record(GoalState.LOST, "the result cannot be had"),
        Disarm(Timer.STALL),
        AskCancel(),  # the second one may yet accept it
        AskResult(anew=True),
        Arm(Timer.REASK, 7.0),
    ]


def test_what_one_of_two_servers_has_ended_stays_so_while_the_other_is_out_of_sight() -> None:
    goal = on_two(accepted=2)
    goal.result(GoalState.ABORTED, None, 1.0, asked_at=0.5, everybody=False)
    assert goal.server_lost("gone", 2.0) == [Disarm(Timer.REASK)]
    assert goal.facts.fate is GoalFate.LOST
    goal.server_back(3.0)
    assert goal.stage is Stage.ANOTHER_MAY_RUN
    assert goal.in_flight


def test_what_ran_on_the_server_that_has_left_is_lost_with_it_when_the_other_ends_it() -> None:
    goal = on_two(accepted=2)
    goal.result(GoalState.ABORTED, 1, 1.0, asked_at=0.5, everybody=False)
    goal.servers_changed(2, 1)
    effects = goal.result(GoalState.ABORTED, 1, 2.0, asked_at=1.5)
    assert effects == [LateResult(GoalState.ABORTED, 1), Disarm(Timer.REASK)]
    assert goal.facts.is_lost_with_server


@pytest.mark.parametrize("both", [True, False])
def test_what_was_not_answered_in_time_was_rejected_only_if_both_servers_say_so(both: bool) -> None:
    goal = on_two()
    goal.timer(Timer.ACCEPT, 5.0)
    assert endings(goal.rejected(5.1)) == []
    (ending,) = endings(goal.rejected(5.2) if both else goal.timer(Timer.CANCEL, 7.0))
    assert ending.end is (End.REJECTED if both else End.NO_ACCEPTANCE)


def test_the_second_server_may_refuse_to_cancel_what_the_first_has_ended() -> None:
    goal = on_two(accepted=2)
    goal.result(GoalState.ABORTED, None, 1.0, asked_at=0.5, everybody=False)
    for answer in (CancelAnswer.REFUSED, CancelAnswer.ACCEPTED):
        assert goal.cancel_answered(answer, 2.0, asked_at=1.0) == [AskResult()]
        refused = answer is CancelAnswer.REFUSED
        goal_id = goal.facts.goal_id
        assert goal.facts.report == GoalReport(goal_id, GoalFate.RUNNING, cancel_refused=refused)


def test_one_of_two_servers_that_knows_no_goal_to_cancel_is_asked_for_its_result() -> None:
    goal = on_two(accepted=1)
    goal.give_up(CancelReason.CANCELLED, 1.0)
    answer = CancelAnswer.UNKNOWN_GOAL
    assert goal.cancel_answered(answer, 2.0, asked_at=1.0) == [AskResult()]


@pytest.mark.parametrize("accepted", [0, 1])
def test_a_result_is_asked_for_when_one_of_several_servers_leaves(accepted: int) -> None:
    """If it was the one with the goal, only that shows it: the others do not know it."""
    goal = on_two(accepted=accepted)
    asks = [AskResult(anew=True)] if accepted else []
    assert goal.servers_changed(2, 0) == []
    assert goal.servers_changed(2, 1) == asks
    assert goal.servers_changed(2, 1) == []
    assert goal.servers_changed(2, 0) == []
    goal.servers_changed(1, 0)
    assert goal.servers_changed(1, 1) == []  # it may come back


@pytest.mark.parametrize(
    ("accepted", "seen", "servers"), [(0, 0, 1), (0, 1, 1), (0, 3, 3), (1, 0, 1), (2, 1, 2)]
)
def test_at_least_the_servers_that_have_accepted_it_may_run_it(
    accepted: int, seen: int, servers: int
) -> None:
    goal = on_two(accepted=accepted)
    goal.servers_changed(seen, 0)
    assert goal.facts.servers == servers
    assert goal.facts.may_run


def test_what_one_of_two_servers_has_ended_is_not_asked_for_by_each_answer_again() -> None:
    goal = on_two(accepted=1)
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
    goal.status(GoalState.SUCCEEDED, 1.0, ours=True)
    assert goal.facts.is_over
    goal.accepted(1.0)
    assert goal.facts.may_run
    effects = goal.result(GoalState.SUCCEEDED, 1, 2.0, asked_at=1.0, everybody=False)
    assert AskCancel() in effects
    assert Settle in map(type, effects)
    assert goal.facts.may_run


def test_a_second_server_that_accepts_what_was_cancelled_is_asked_to_cancel_it_at_once() -> None:
    """It read the first request to cancel before it had the goal, so it ignored it."""
    goal = on_two(accepted=1)
    assert AskCancel() in goal.give_up(CancelReason.CANCELLED, 1.0)
    assert AskCancel() in goal.accepted(2.0)


def test_what_one_of_two_servers_rejects_may_run_on_the_one_that_has_gone() -> None:
    goal = on_two()
    goal.servers_changed(2, 1)
    (ending,) = endings(goal.rejected(1.0))
    assert (ending.end, ending.lost_because) == (End.LOST, ONE_IS_GONE)
    assert goal.facts.may_run
    assert not goal.facts.is_lost_with_server  # the one that has gone may have rejected it
    goal.servers_changed(2, 2)
    assert goal.facts.is_lost_with_server


def test_a_goal_of_a_server_that_has_gone_is_lost_when_the_other_had_time_to_accept_it() -> None:
    """The other one came when the goal had just been sent, and never got it."""
    goal = sent_to(1, accepted=1, accept=5.0)
    goal.servers_changed(2, 0)
    goal.servers_changed(2, 1)
    assert goal.result(None, None, 4.0, asked_at=3.9) == []  # it may still accept it
    (ending,) = endings(goal.result(None, None, 5.0, asked_at=4.9))
    assert (ending.end, ending.lost_because) == (End.LOST, ONE_IS_GONE)
    assert goal.facts.known_to_run is None
    assert not goal.facts.is_lost_with_server
    assert AskCancel() in goal.accepted(7.0)


def test_without_a_limit_for_the_acceptance_such_a_goal_is_lost_all_the_same() -> None:
    """The call was accepted once: without a deadline, it would wait for ever."""
    goal = sent_to(1, accepted=1, accept=None)
    goal.servers_changed(2, 0)
    goal.servers_changed(2, 1)
    assert goal.result(None, None, 4.0, asked_at=3.9) == []
    (ending,) = endings(goal.result(None, None, 31.0, asked_at=30.9))
    assert ending.end is End.LOST
    assert not goal.facts.is_lost_with_server


def test_what_one_of_two_servers_has_ended_may_run_on_the_one_that_is_back_and_lost_again() -> None:
    goal = on_two(accepted=2)
    goal.servers_changed(2, 1)
    goal.result(GoalState.SUCCEEDED, None, 1.0, asked_at=0.5, everybody=False)
    goal.result(None, None, 2.0, asked_at=1.5)
    assert goal.stage is Stage.LOST
    goal.cancel_answered(CancelAnswer.REFUSED, 3.0, asked_at=1.0)
    assert goal.stage is Stage.ANOTHER_MAY_RUN
    goal.servers_changed(2, 2)
    goal.server_lost("it is gone", 4.0)
    assert goal.facts.may_run


def test_what_one_of_two_servers_rejects_after_both_were_lost_is_still_followed() -> None:
    goal = on_two()
    goal.server_lost("it is gone", 1.0)
    assert goal.rejected(2.0) == []
    assert goal.facts.may_run
    assert AskCancel() in goal.server_back(3.0)
