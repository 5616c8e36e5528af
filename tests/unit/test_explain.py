"""The error for each kind of failure, and its text (contract C3.2).

Not every sentence is compared: only what a user needs of it.
"""

from __future__ import annotations

import concurrent.futures
import pickle
import re
import uuid
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from goal_life import UNTIL_ACCEPTED, UNTIL_SENT, Life
from test_msgs.action import Fibonacci

import actionkit
from actionkit import (
    CancelReport,
    GoalEvent,
    GoalFate,
    GoalReport,
    GoalState,
    Timeouts,
    Verdict,
)
from actionkit._calls.errors.error_context import ErrorContext
from actionkit._calls.errors.error_texts import TEXTS
from actionkit._calls.errors.explain import explain
from actionkit._calls.errors.graph_snapshot import GraphSnapshot
from actionkit._goal.effects import AskCancel, End, Ending, Fault, LastNews
from actionkit._model.cancel_answer import CancelAnswer
from actionkit._model.field_errors import FieldError

EVENT = GoalEvent(uuid.uuid4(), 1, GoalState.SENDING, 1.0, 2.0)
GOAL_ID = uuid.uuid4()
CONTEXT = ErrorContext(
    action_name="/fibonacci",
    type_name="test_msgs/action/Fibonacci",
    goal_id=GOAL_ID,
    attempts=1,
    timeline=(EVENT,),
    elapsed=4.2,
    timeout=4.0,
    timeouts=Timeouts(feedback=3.0),
    surroundings=lambda: GraphSnapshot({}, 7, "rmw_fastrtps_cpp"),
)
ABORTED = Fibonacci.Result(sequence=[1])
REPORTS: dict[CancelReport, dict[str, Any]] = {
    # The facts from which each report follows.
    CancelReport.CONFIRMED: {"given_up": True, "ended_as": GoalState.CANCELED},
    CancelReport.REFUSED: {"given_up": True, "refused": True, "news": LastNews.NOTHING},
    CancelReport.UNKNOWN: {"given_up": True, "news": LastNews.NOTHING},
    CancelReport.NOT_NEEDED: {"given_up": True, "news": LastNews.STOPPED},
}
CONFIRMED, REFUSED, UNKNOWN, NOT_NEEDED = REPORTS.values()
ENDINGS: dict[End, tuple[Ending, type[BaseException], str, str]] = {
    # How it ends, its error, and what the text is to say: what happened, and the remedy.
    ending.end: (ending, cls, happened, remedy)
    for ending, cls, happened, remedy in [
        (
            Ending(End.NO_SERVER, GoalState.TIMED_OUT, given_up=True),
            actionkit.ServerUnavailableError,
            "nothing was sent",
            "Check that the server runs",
        ),
        (
            Ending(End.TYPE_MISMATCH, GoalState.SENDING, served=("a/action/B", "a/action/C")),
            actionkit.ActionTypeMismatchError,
            "served as a/action/B, a/action/C",
            "Use the served type",
        ),
        (
            Ending(End.INVALID, GoalState.SENDING, error=FieldError("order", -1, "be positive")),
            actionkit.InvalidGoalError,
            "nothing was sent",
            "order: be positive",
        ),
        (
            Ending(End.UNKNOWN, GoalState.LOST),
            actionkit.GoalUnknownError,
            "No server of action '/fibonacci' knows goal",
            "`actionkit watch` shows the goals there",
        ),
        (
            Ending(
                End.NOT_REPLACING,
                GoalState.SENDING,
                earlier=(GoalReport(GOAL_ID, GoalFate.RUNNING, cancel_refused=True),),
                given_up=True,
            ),
            actionkit.GoalNotReplacedError,
            "MAY STILL BE RUNNING (the server refused to cancel it), 2 s after it was cancelled",
            "preempt=True",
        ),
        (
            Ending(
                End.NO_ACCEPTANCE,
                GoalState.TIMED_OUT,
                **UNKNOWN,
            ),
            actionkit.AcceptanceTimeoutError,
            "neither accepted nor rejected within 5 s",
            "Timeouts(accept=...)",
        ),
        (
            Ending(End.REJECTED, GoalState.REJECTED),
            actionkit.GoalRejectedError,
            "rejected by the server",
            "look at the server's log",
        ),
        (
            Ending(End.ABORTED, GoalState.ABORTED, ABORTED),
            actionkit.GoalAbortedError,
            "aborted by the server",
            "`error.result`",
        ),
        (
            Ending(End.CANCELED_BY_OTHER, GoalState.CANCELED, ABORTED),
            actionkit.GoalCanceledError,
            "not by this client",
            "Another client, an operator or the server",
        ),
        (
            Ending(
                End.LOST,
                GoalState.LOST,
                news=LastNews.SERVER_GONE,
                lost_because="it is gone",
            ),
            actionkit.ServerLostError,
            "it is gone",
            "Look for a crash",
        ),
        (
            Ending(
                End.RESULT_LOST,
                GoalState.LOST,
                ended_as=GoalState.SUCCEEDED,
                lost_because="it is late",
            ),
            actionkit.ResultLostError,
            "ended as SUCCEEDED",
            "result_timeout",
        ),
        (
            Ending(End.STALLED, GoalState.TIMED_OUT, **REFUSED),
            actionkit.FeedbackStalledError,
            "no feedback for 3 s",
            "Timeouts(feedback=...)",
        ),
        (
            Ending(End.DEADLINE, GoalState.TIMED_OUT, phase="execute", **CONFIRMED),
            actionkit.DeadlineExceededError,
            "4 s, ran out",
            "Give it more time",
        ),
        (
            Ending(
                End.REJECTED_BY_CLASSIFIER,
                GoalState.SUCCEEDED,
                ABORTED,
                verdict=Verdict.PERMANENT,
            ),
            actionkit.PermanentError,
            "by `classify=` its result is a failure",
            "`error.result`",
        ),
        (
            Ending(
                End.CLASSIFIER_FAILED,
                GoalState.SUCCEEDED,
                ABORTED,
                classifier_fault=Fault("`classify=f` broke"),
            ),
            actionkit.ClassifyError,
            "`classify=f` broke",
            "Correct that function",
        ),
        (
            Ending(End.CLOSED, GoalState.CANCELED, **CONFIRMED),
            actionkit.ClientClosedError,
            "its client was closed",
            "Wait for the result before close()",
        ),
    ]
}
NOTHING_SENT = (End.NO_SERVER, End.TYPE_MISMATCH, End.INVALID)
GIVEN_UP = (End.NO_ACCEPTANCE, End.STALLED, End.CLOSED)
"""Besides the deadline: what may have been running when its caller gave up on it."""


def explained(ending: Ending, **changed: Any) -> Any:
    error = explain(ending, replace(CONTEXT, **changed))
    assert error is not None
    return error


def test_every_way_to_fail_has_its_own_error() -> None:
    failures = set(End) - {End.SUCCEEDED, End.CANCELLED_BY_CALLER, End.REPLACED}
    assert set(TEXTS) == failures == set(ENDINGS)
    classes = [cls for cls, _ in TEXTS.values()]
    assert len(set(classes)) == len(classes)


def test_a_success_has_none() -> None:
    assert explain(Ending(End.SUCCEEDED, GoalState.SUCCEEDED, result=ABORTED), CONTEXT) is None


@pytest.mark.parametrize(
    ("status", "said"),
    [
        (GoalState.SENDING, "was not sent: its client was closed first. Wait for the result"),
        (
            GoalState.ABORTED,
            "ran no more (ABORTED), and was not tried again, because its client was closed. Wait",
        ),
    ],
)
def test_closing_says_it_where_no_goal_was_in_flight(status: GoalState, said: str) -> None:
    text = str(explained(Ending(End.CLOSED, status, **NOT_NEEDED)))
    assert said in text
    assert "in flight" not in text


def test_the_callers_own_cancel_is_pythons_own_error() -> None:
    error = explained(Ending(End.CANCELLED_BY_CALLER, GoalState.CANCELED))
    assert type(error) is concurrent.futures.CancelledError
    assert "/fibonacci" in str(error)
    assert str(GOAL_ID) in str(error)


@pytest.mark.parametrize("end", ENDINGS, ids=lambda end: end.name)
def test_an_error_tells_what_happened_to_which_action_and_what_to_do(end: End) -> None:
    ending, cls, happened, remedy = ENDINGS[end]
    error = explained(ending)
    assert type(error) is cls
    text = str(error)
    assert "'/fibonacci'" in text
    assert (str(GOAL_ID) in text) == (end not in NOTHING_SENT)
    assert happened in text
    assert remedy in text
    assert text.endswith(".")
    unformatted = re.search(r"None|  |\{|<", text.replace("or None where it has no opinion", ""))
    assert unformatted is None, text
    assert (error.action_name, error.goal_id, error.attempts) == ("/fibonacci", GOAL_ID, 1)
    assert (error.timeline, error.elapsed, error.cancel) == ((EVENT,), 4.2, ending.cancel)
    assert str(pickle.loads(pickle.dumps(error))) == text


@pytest.mark.parametrize(
    ("code", "message", "said"),
    [
        (7, "", " It says error_code=7."),
        (7, "stuck", " It says error_code=7, error_msg='stuck'."),
        (0, "stuck", " It says error_msg='stuck'."),
        (0, "", ""),  # a default that the server has not filled in, mostly: no reason
    ],
)
def test_an_abort_quotes_the_reason_that_its_result_gives(
    code: int, message: str, said: str
) -> None:
    result = SimpleNamespace(error_code=code, error_msg=message)
    text = str(explained(replace(ENDINGS[End.ABORTED][0], result=result)))
    assert f"s.{said} What the server sent" in text


def test_the_facts_of_each_error() -> None:
    errors = {end: explained(ending) for end, (ending, *_) in ENDINGS.items()}
    assert errors[End.TYPE_MISMATCH].expected == "test_msgs/action/Fibonacci"
    assert errors[End.TYPE_MISMATCH].served == ("a/action/B", "a/action/C")
    assert errors[End.INVALID].field == "order"
    assert errors[End.INVALID].__cause__ is ENDINGS[End.INVALID][0].error
    assert errors[End.ABORTED].result is errors[End.CANCELED_BY_OTHER].result is ABORTED
    assert errors[End.REJECTED_BY_CLASSIFIER].result is ABORTED
    assert errors[End.RESULT_LOST].status is GoalState.SUCCEEDED
    assert errors[End.DEADLINE].phase == "execute"
    late = explained(replace(ENDINGS[End.DEADLINE][0], result=ABORTED, status=GoalState.SUCCEEDED))
    assert late.late_result is ABORTED
    assert "late_result" in str(late)


# --- what may still run ------------------------------------------------------------------------


def assert_told(text: str, report: CancelReport) -> None:
    """A text says that the goal runs, may run, or has stopped, exactly when that is true."""
    assert ("IT IS STILL RUNNING" in text) == (report is CancelReport.REFUSED)
    assert ("IT MAY STILL BE RUNNING" in text) == (report is CancelReport.UNKNOWN)
    assert ("runs no more" in text) == (report is CancelReport.CONFIRMED)


@pytest.mark.parametrize("end", GIVEN_UP, ids=lambda end: end.name)
@pytest.mark.parametrize("report", CancelReport)
def test_an_error_tells_what_became_of_a_goal_that_was_given_up(
    end: End, report: CancelReport
) -> None:
    first = ENDINGS[end][0]
    ending = Ending(end, first.status, **REPORTS[report])
    assert ending.cancel is report
    assert_told(str(explained(ending)), report)


@pytest.mark.parametrize("phase", ["server", "accept", "execute", "pause", "cancel"])
@pytest.mark.parametrize("report", CancelReport)
def test_the_deadline_names_the_phase_and_what_became_of_the_goal(
    phase: str, report: CancelReport
) -> None:
    facts = REPORTS[report]
    ending = Ending(End.DEADLINE, GoalState.TIMED_OUT, phase=phase, **facts)
    assert ending.cancel is report
    text = str(explained(ending))
    if phase == "cancel" and report is not CancelReport.CONFIRMED:
        assert "within 2 s: IT MAY STILL BE RUNNING" in text
        return
    if phase != "cancel":
        assert "4 s, ran out" in text
    if phase == "server":
        # Without an earlier attempt, it had a server all the same; else there would be no phase.
        assert "was not sent, though a server is ready" in text
        text = str(explained(ending, attempts=2))
        assert "sent," not in text
    assert_told(text, report)


@pytest.mark.parametrize("event", ["silence", "no answer", "close"])
def test_a_goal_that_was_cancelled_is_not_said_to_have_succeeded(event: str) -> None:
    life = Life(feedback=1.0)
    life.see(*(UNTIL_SENT if event == "no answer" else UNTIL_ACCEPTED))
    if event == "close":
        life.tell("close", abandon=False)
    life.wait_until(5.0 if event == "no answer" else 1.0)
    life.tell("cancel_answered", CancelAnswer.ACCEPTED)
    life.tell("result", GoalState.CANCELED, ABORTED)
    assert life.ending is not None
    assert "succeeded" not in str(explained(life.ending))


@pytest.mark.parametrize("state", [GoalState.SUCCEEDED, GoalState.ABORTED, GoalState.CANCELED])
def test_a_goal_that_ended_is_not_said_to_be_cancelled_where_only_its_result_is_missing(
    state: GoalState,
) -> None:
    life = Life(2.0)
    life.see(*UNTIL_ACCEPTED)
    life.wait_until(1.0)
    life.tell("status", state)
    life.wait_until(2.0)
    assert not any(isinstance(effect, AskCancel) for effect in life.all)
    life.wait_until(4.0)
    assert life.ending is not None
    assert not life.goal.may_run
    error = explained(life.ending, timeout=2.0)
    assert type(error) is actionkit.DeadlineExceededError
    assert error.cancel is CancelReport.CONFIRMED
    text = str(error)
    assert f"ended as {state}; its result did not come within 2 s" in text
    assert "cancelled on the server" not in text
    assert "before the goal ended" not in text


def test_the_silence_of_a_goal_that_has_ended_is_no_stall() -> None:
    life = Life(feedback=1.0, result=5.0)
    life.see(*UNTIL_ACCEPTED)
    life.tell("status", GoalState.SUCCEEDED)
    life.wait_until(10.0)
    assert life.ending is not None
    assert life.ending.end is End.RESULT_LOST
    assert "ended as SUCCEEDED, but its result cannot be had" in str(explained(life.ending))


def test_a_server_was_lost_when_it_was_lost_and_not_when_that_was_tried_again_in_vain() -> None:
    states = [GoalState.SENDING, GoalState.EXECUTING, GoalState.LOST, GoalState.RETRYING]
    of_the_first = [
        replace(EVENT, goal_id=GOAL_ID, state=state, monotonic=at)
        for state, at in zip(states, (1.0, 1.1, 2.0, 7.3), strict=True)
    ]
    error = explained(ENDINGS[End.LOST][0], timeline=(*of_the_first, EVENT))
    assert "was lost 1.0 s into the call" in str(error)


def test_only_a_goal_that_was_left_to_run_on_purpose_is_said_to_be_left() -> None:
    for abandon in (True, False):
        life = Life()
        life.see(*UNTIL_ACCEPTED)
        life.tell("close", abandon=abandon)
        life.wait_until(10.0)
        assert life.ending is not None
        text = str(explained(life.ending))
        assert ("It was left to run on the server." in text) == abandon
        assert ("did not confirm its cancellation within 2 s: IT MAY" in text) != abandon


def test_a_thread_that_died_knows_nothing_of_the_goal() -> None:
    broken = RuntimeError("the thread died")
    ending = replace(ENDINGS[End.LOST][0], error=broken)
    error = explained(replace(ending, goals=(GoalReport(GOAL_ID, GoalFate.RUNNING),)))
    assert "IT MAY STILL BE RUNNING" in str(error)
    assert error.__cause__ is broken
    assert "RUNNING" not in str(explained(ending))  # where nothing was sent


@pytest.mark.parametrize("end", [End.CANCELLED_BY_CALLER, End.REPLACED])
def test_a_cancelled_call_names_an_earlier_goal_that_may_run(end: End) -> None:
    lost = GoalReport(uuid.uuid4(), GoalFate.LOST)
    error = explained(Ending(end, GoalState.CANCELED, goals=(lost,)))
    assert f" Goal {lost.goal_id} of this call MAY STILL BE RUNNING: the server is" in str(error)


@pytest.mark.parametrize("end", ENDINGS, ids=lambda end: end.name)
def test_other_goals_of_the_call_that_may_run_are_named(end: End) -> None:
    fates = GoalFate.UNANSWERED, GoalFate.LOST, GoalFate.RUNNING, GoalFate.ENDED, GoalFate.LOST
    others = [GoalReport(uuid.uuid4(), fate) for fate in fates]
    error = explained(replace(ENDINGS[end][0], goals=(GoalReport(GOAL_ID, fates[0]), *others)))
    unanswered, lost, running, ended, lost_too = (str(goal.goal_id) for goal in others)
    assert f"oal {unanswered} of this call MAY STILL BE RUNNING: the server has not" in str(error)
    both = f"oal {lost} and goal {lost_too} of this call MAY STILL BE RUNNING: the server is gone"
    assert both in str(error)
    assert f" Goal {running} of this call MAY STILL BE RUNNING: the server has not" in str(error)
    assert ended not in str(error)
    assert error.cancel in (CancelReport.REFUSED, CancelReport.UNKNOWN)


def test_a_goal_that_its_server_refuses_to_cancel_is_the_worst() -> None:
    refused = GoalReport(uuid.uuid4(), GoalFate.RUNNING, cancel_refused=True)
    lost = GoalReport(uuid.uuid4(), GoalFate.LOST, cancel_refused=True)
    error = explained(replace(ENDINGS[End.ABORTED][0], goals=(lost, refused)))
    text = f"Goal {refused.goal_id} of this call MAY STILL BE RUNNING: the server refused to"
    assert text in str(error)
    assert error.cancel is CancelReport.REFUSED
    error = explained(replace(ENDINGS[End.ABORTED][0], goals=(lost,)))
    assert error.cancel is CancelReport.UNKNOWN


def test_an_error_names_ten_goals_and_counts_the_others() -> None:
    goals = tuple(GoalReport(uuid.uuid4(), GoalFate.LOST) for _ in range(13))
    text = str(explained(replace(ENDINGS[End.ABORTED][0], goals=goals)))
    assert text.count("oal ") - text.count(str(GOAL_ID)) == 10
    assert " and 3 more of this call MAY STILL BE RUNNING" in text


def test_a_function_that_could_not_be_called_is_not_to_be_corrected() -> None:
    fault = Fault("`classify=f` could not be called, because no thread", asked=False)
    text = str(explained(replace(ENDINGS[End.CLASSIFIER_FAILED][0], classifier_fault=fault)))
    assert "Start fewer threads" in text
    assert "Correct that function" not in text


@pytest.mark.parametrize("fate", [GoalFate.UNANSWERED, GoalFate.LOST])
def test_what_was_not_waited_for_is_not_said_to_have_been(fate: GoalFate) -> None:
    unknown = {"given_up": True, "news": LastNews.NOTHING, "status": GoalState.TIMED_OUT}
    ending = Ending(End.DEADLINE, phase="cancel", goals=(GoalReport(GOAL_ID, fate),), **unknown)
    text = str(explained(ending))
    assert ("within" in text) == (fate is GoalFate.UNANSWERED)
    assert ("gone, or silent: IT MAY STILL BE RUNNING." in text) == (fate is GoalFate.LOST)


@pytest.mark.parametrize("end", [End.DEADLINE, End.NO_ACCEPTANCE])
def test_a_cancel_that_no_server_could_confirm_yet_was_not_waited_for(end: End) -> None:
    ending = Ending(
        end,
        GoalState.TIMED_OUT,
        given_up=True,
        news=LastNews.UNKNOWN_TO_SERVER,
        phase="cancel" if end is End.DEADLINE else "",
    )
    text = str(explained(ending))
    assert "ts server does not know it yet, and may still accept it: IT MAY STILL BE" in text
    assert "within 2 s" not in text


@pytest.mark.parametrize("phase", ["cancel", "execute"])
def test_a_cancel_that_was_accepted_needs_more_time(phase: str) -> None:
    canceling = replace(EVENT, goal_id=GOAL_ID, state=GoalState.CANCELING)
    ending = Ending(
        End.DEADLINE, GoalState.TIMED_OUT, phase=phase, given_up=True, news=LastNews.NOTHING
    )
    text = str(explained(ending, timeline=(EVENT, canceling)))
    late = "he server is cancelling it, and did not end it within 2 s, the time of Timeouts(cancel"
    assert late in text
    assert "as soon as the server answers" not in text


# --- why it was not tried again (contract C4.1) ------------------------------------------------

TRANSIENT = [End.NO_ACCEPTANCE, End.LOST, End.STALLED]


@pytest.mark.parametrize("end", TRANSIENT, ids=lambda end: end.name)
def test_an_error_says_why_it_was_not_tried_again(end: End) -> None:
    ending, cls, _, remedy = ENDINGS[end]
    error = explained(replace(ending, not_retried="it is Sunday"), attempts=3)
    assert type(error) is cls
    assert error.transient
    assert error.attempts == 3
    assert remedy in str(error)
    assert "not tried again: it is Sunday." in str(error)
    assert "tried again" not in str(explained(ending))


# --- what the graph shows (contract C3.2) ------------------------------------------------------

TYPE, OTHER = ("test_msgs/action/Fibonacci",), ("a/action/B",)


@pytest.mark.parametrize("age", [2.0, 3.5])
def test_a_young_node_says_only_that_it_sees_no_server_so_far(age: float) -> None:
    """The announcement of a server that runs may come 3 s late."""
    around = GraphSnapshot({}, 7, "rmw_fastrtps_cpp", age=age)
    told = str(explained(ENDINGS[End.NO_SERVER][0], surroundings=lambda: around, elapsed=2.0))
    assert ("No action server at all is visible" in told) == (age > 3.0)
    assert ("No action server has come into sight so far" in told) == (age < 3.0)


def test_that_security_is_on_is_told_where_no_server_is_seen() -> None:
    around = GraphSnapshot({}, 7, "rmw_cyclonedds_cpp", enclave="/robot/client")
    told = str(explained(ENDINGS[End.NO_SERVER][0], surroundings=lambda: around))
    assert "ROS security is on, as enclave '/robot/client': only servers with keys of" in told


def test_nodes_that_only_publish_feedback_are_told_of() -> None:
    around = GraphSnapshot({}, 7, "rmw_fastrtps_cpp", only_publishing=("/bridge", "/player"))
    told = str(explained(ENDINGS[End.NO_SERVER][0], surroundings=lambda: around))
    assert "Its feedback is published by /bridge and /player, without its services" in told
    assert "Allow it more time" not in told


@pytest.mark.parametrize("end", [End.NO_SERVER, End.NO_ACCEPTANCE])
def test_a_server_in_sight_that_sends_nothing_is_told_of(end: End) -> None:
    around = GraphSnapshot({"/fibonacci": TYPE}, 7, "rmw_fastrtps_cpp", no_data=True)
    told = str(explained(ENDINGS[end][0], surroundings=lambda: around))
    assert "no data from it arrives here" in told
    assert "FASTDDS_BUILTIN_TRANSPORTS=UDPv4" in told
    assert "busy" not in told


@pytest.mark.parametrize(
    ("actions", "told"),
    [
        ({"/fibonaci": OTHER}, "similar name: '/fibonaci' (a/action/B)."),
        ({"/zzz": TYPE}, "same type under another name: '/zzz'."),
        ({"/fibonacci": TYPE}, "is visible, but has not answered"),
        ({"/fibonacci": OTHER}, "is served as a/action/B"),
        ({}, "No action server at all is visible."),
        (None, "the graph cannot be asked"),
        ({f"/zzz{number}": TYPE for number in range(9)}, "'/zzz4' and more."),
    ],
)
def test_without_a_server_the_text_tells_what_is_seen(
    actions: dict[str, tuple[str, ...]] | None, told: str
) -> None:
    around = GraphSnapshot(actions, 7, "rmw_fastrtps_cpp")
    for elapsed in (0.5, 4.2):
        error = explained(ENDINGS[End.NO_SERVER][0], surroundings=lambda: around, elapsed=elapsed)
        assert told in str(error)
        # A server that is not seen yet may come; what is known of another is no matter of time.
        sought = actions is not None and "/fibonacci" not in actions
        assert ("allow more time with" in str(error)) == (elapsed < 3.0 and sought)
