"""The error that each way to fail gets, and what its text tells (contract C3.2)."""

from __future__ import annotations

import concurrent.futures
import pickle
import re
import uuid
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest
from goal_life import UNTIL_ACCEPTED, UNTIL_SENT, Life
from test_msgs.action import Fibonacci

import actionkit
from actionkit import CancelReport, GoalEvent, GoalState, Timeouts, Verdict
from actionkit._calls import explain as _explain
from actionkit._calls.explain import ErrorContext, explain
from actionkit._calls.graph_snapshot import GraphSnapshot
from actionkit._goal.effects import AskCancel, End, Ending, Fault, GoalFate, GoalProgress
from actionkit._messages.convert import to_message
from actionkit._model.cancel_answer import CancelAnswer
from actionkit._model.field_errors import FieldError, FieldProblem

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
ACCEPTED = GoalProgress.ACCEPTED
REPORTS: dict[CancelReport, dict[str, Any]] = {
    # The facts from which each report follows.
    CancelReport.CONFIRMED: {"given_up": True, "ended_as": GoalState.CANCELED},
    CancelReport.REFUSED: {"given_up": True, "refused": True, "fate": GoalFate.NOTHING},
    CancelReport.UNKNOWN: {"given_up": True, "fate": GoalFate.NOTHING},
    CancelReport.NOT_NEEDED: {"given_up": True, "fate": GoalFate.STOPPED},
}
CONFIRMED, REFUSED, UNKNOWN, _ = REPORTS.values()
ENDINGS: dict[End, tuple[Ending, type[BaseException], str]] = {
    # How it ends, its error, and the remedy that the text is to give.
    ending.end: (ending, cls, remedy)
    for ending, cls, remedy in [
        (
            Ending(End.NO_SERVER, GoalState.TIMED_OUT, given_up=True),
            actionkit.ServerUnavailableError,
            "Check that the server runs",
        ),
        (
            Ending(End.TYPE_MISMATCH, GoalState.SENDING, served=("a/action/B", "a/action/C")),
            actionkit.ActionTypeMismatchError,
            "Use the served type",
        ),
        (
            Ending(End.INVALID, GoalState.SENDING, error=FieldError("order", -1, "be positive")),
            actionkit.InvalidGoalError,
            "order: be positive",
        ),
        (
            Ending(
                End.NO_ACCEPTANCE,
                GoalState.TIMED_OUT,
                progress=GoalProgress.UNANSWERED,
                **UNKNOWN,
            ),
            actionkit.AcceptanceTimeoutError,
            "Timeouts(accept=...)",
        ),
        (
            Ending(End.REJECTED, GoalState.REJECTED),
            actionkit.GoalRejectedError,
            "look at the server's log",
        ),
        (
            Ending(End.ABORTED, GoalState.ABORTED, ABORTED, progress=ACCEPTED),
            actionkit.GoalAbortedError,
            "`error.result`",
        ),
        (
            Ending(End.CANCELED_BY_OTHER, GoalState.CANCELED, ABORTED, progress=ACCEPTED),
            actionkit.GoalCanceledError,
            "Another client, an operator or the server",
        ),
        (
            Ending(
                End.LOST,
                GoalState.LOST,
                progress=ACCEPTED,
                fate=GoalFate.SERVER_GONE,
                lost_because="it is gone",
            ),
            actionkit.ServerLostError,
            "Look for a crash",
        ),
        (
            Ending(
                End.RESULT_LOST,
                GoalState.LOST,
                progress=ACCEPTED,
                ended_as=GoalState.SUCCEEDED,
                lost_because="it is late",
            ),
            actionkit.ResultLostError,
            "result_timeout",
        ),
        (
            Ending(End.STALLED, GoalState.TIMED_OUT, progress=ACCEPTED, **REFUSED),
            actionkit.FeedbackStalledError,
            "Timeouts(feedback=...)",
        ),
        (
            Ending(End.DEADLINE, GoalState.TIMED_OUT, phase="execute", **CONFIRMED),
            actionkit.DeadlineExceededError,
            "Give it more time",
        ),
        (
            Ending(
                End.REJECTED_BY_CLASSIFIER,
                GoalState.SUCCEEDED,
                ABORTED,
                progress=ACCEPTED,
                verdict=Verdict.PERMANENT,
            ),
            actionkit.PermanentError,
            "`error.result`",
        ),
        (
            Ending(
                End.CLASSIFIER_FAILED,
                GoalState.SUCCEEDED,
                ABORTED,
                progress=ACCEPTED,
                classifier_fault=Fault("`classify=f` broke"),
            ),
            actionkit.ClassifyError,
            "`error.result`",
        ),
        (
            Ending(End.CLOSED, GoalState.CANCELED, progress=ACCEPTED, **CONFIRMED),
            actionkit.ClientClosedError,
            "Wait for the result before close()",
        ),
    ]
}


def explained(ending: Ending, **changed: Any) -> Any:
    error = explain(ending, replace(CONTEXT, **changed))
    assert error is not None
    return error


def test_every_way_to_fail_has_its_own_error() -> None:
    failures = set(End) - {End.SUCCEEDED, End.CANCELLED_BY_CALLER}
    assert set(_explain._TEXTS) == failures == set(ENDINGS)
    classes = [cls for cls, _ in _explain._TEXTS.values()]
    assert len(set(classes)) == len(classes)


def test_a_success_has_none() -> None:
    assert explain(Ending(End.SUCCEEDED, GoalState.SUCCEEDED, result=ABORTED), CONTEXT) is None


def test_the_callers_own_cancel_is_pythons_own_error() -> None:
    error = explained(Ending(End.CANCELLED_BY_CALLER, GoalState.CANCELED))
    assert type(error) is concurrent.futures.CancelledError
    assert "/fibonacci" in str(error)
    assert str(GOAL_ID) in str(error)


@pytest.mark.parametrize("end", ENDINGS, ids=lambda end: end.name)
def test_an_error_tells_what_happened_to_which_action_and_what_to_do(end: End) -> None:
    ending, cls, remedy = ENDINGS[end]
    error = explained(ending)
    assert type(error) is cls
    text = str(error)
    assert "'/fibonacci'" in text
    assert remedy in text
    assert text.endswith(".")
    unformatted = re.search(r"None|  |\{|<", text.replace("or None where it has no opinion", ""))
    assert unformatted is None, text
    assert (error.action_name, error.goal_id, error.attempts) == ("/fibonacci", GOAL_ID, 1)
    assert (error.timeline, error.elapsed, error.cancel) == ((EVENT,), 4.2, ending.cancel)
    assert str(pickle.loads(pickle.dumps(error))) == text


def test_the_facts_of_each_error() -> None:
    errors = {end: explained(ending) for end, (ending, _, _) in ENDINGS.items()}
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
    broken = RuntimeError("the thread died")
    assert explained(replace(ENDINGS[End.LOST][0], error=broken)).__cause__ is broken


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
        assert "ran out waiting for a server that could try again" in text
        assert "sent," not in text
    assert ("IT IS STILL RUNNING" in text) == (report is CancelReport.REFUSED)
    assert ("IT MAY STILL BE RUNNING" in text) == (report is CancelReport.UNKNOWN)
    assert ("runs no more" in text) == (report is CancelReport.CONFIRMED)


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


# --- sentences end before the next begins -----------------------------------------------------

BEGINNINGS = "A|An|Another|Call|Check|Correct|Give|It|Its|Look|No|Nothing|Please|So|The|Use|What"
WITHOUT_A_STOP = re.compile(rf"[^.!?:;,] (?=(?:{BEGINNINGS})\b)")
TWO_STOPS = re.compile(r"[.!?][.;:,!?]|\. \.|\s\.| {2}")


def assert_sentences(text: str) -> None:
    assert text.endswith((".", "!")), text
    assert not WITHOUT_A_STOP.search(text), text
    assert not TWO_STOPS.search(re.sub(r"\d\.\.-?\d|\.\.\.", "", text)), text


FOREIGN = ["no", "No.", "never!", "it ends in a stop..."]
"""What functions of the user's say, or the middleware."""


def endings_with(text: str) -> Iterator[Ending]:
    """Every way to fail in every way to say more of it, with a text of somebody else's in it."""
    fault = Fault(f"`classify=f` raised ValueError: {text}", ValueError(text))
    for ending, _, _ in ENDINGS.values():
        for facts in ({}, *REPORTS.values()):
            one = replace(ending, **facts)
            yield one
            yield replace(one, error=ValueError(text))
            yield replace(one, not_retried="it is Sunday")
            yield replace(one, strategy_fault=fault)
            yield replace(one, classifier_fault=fault)
            yield replace(one, verdict=Verdict.TRANSIENT, not_retried="it is Sunday")
            yield replace(one, classifier_fault=replace(fault, impossible=True))
            yield replace(one, status=GoalState.SENDING)


@pytest.mark.parametrize("foreign", FOREIGN)
def test_sentences_end_before_the_next_begins(foreign: str) -> None:
    for ending in endings_with(foreign):
        for elapsed in (0.5, 4.2):
            assert_sentences(str(explained(ending, elapsed=elapsed, attempts=2)))


INVALID: list[Any] = [
    {"order": "five"},
    {"order": 2**31},
    {"order": None},
    {"ordr": 1},
    {"x": 1},
    None,
    3,
    Fibonacci,
    Fibonacci.Result(),
    Fibonacci.Goal(order=1).order,
]


@pytest.mark.parametrize("goal", INVALID, ids=repr)
def test_what_is_wrong_with_a_goal_is_a_sentence(goal: Any) -> None:
    with pytest.raises(FieldProblem) as caught:
        to_message(Fibonacci.Goal, goal)
    ending = Ending(End.INVALID, GoalState.REJECTED, error=caught.value)
    assert_sentences(f"{caught.value} Nothing was sent.")
    assert_sentences(str(explained(ending)))


# --- why it was not tried again (contract C4.1) ------------------------------------------------

TRANSIENT = [End.NO_ACCEPTANCE, End.LOST, End.STALLED]


@pytest.mark.parametrize("end", TRANSIENT, ids=lambda end: end.name)
def test_an_error_that_speaks_for_itself_says_why_it_was_not_tried_again(end: End) -> None:
    ending, cls, remedy = ENDINGS[end]
    error = explained(replace(ending, not_retried="it is Sunday"), attempts=3)
    assert type(error) is cls
    assert error.transient
    assert error.attempts == 3
    text = str(error)
    assert remedy in text
    assert text.endswith("It was not tried again: it is Sunday.")
    assert "tried again" not in str(explained(ending))
    assert str(pickle.loads(pickle.dumps(error))) == text


def test_a_success_judged_transient_has_an_error_only_for_the_end_of_the_retries() -> None:
    ending = replace(
        ENDINGS[End.REJECTED_BY_CLASSIFIER][0],
        verdict=Verdict.TRANSIENT,
        not_retried="it is Sunday",
    )
    error = explained(ending, attempts=3)
    assert type(error) is actionkit.RetriesExhaustedError
    assert (error.result, error.attempts, error.goal_id) == (ABORTED, 3, GOAL_ID)
    assert "it is Sunday" in str(error)
    assert "/fibonacci" in str(error)
    assert isinstance(error.__cause__, actionkit.TransientError)
    assert error.__cause__.result is ABORTED
    assert type(pickle.loads(pickle.dumps(error)).__cause__) is actionkit.TransientError


# --- functions of the user's that do not do what they should (contract C3.3) -------------------

RAISED = ValueError("no")


def test_a_success_that_could_not_be_judged_says_what_the_function_did() -> None:
    fault = Fault("`classify=judge` raised ValueError: no", RAISED)
    error = explained(replace(ENDINGS[End.CLASSIFIER_FAILED][0], classifier_fault=fault))
    assert "succeeded on the server, but 4.2 s into the call `classify=judge` raised" in str(error)
    assert error.__cause__ is RAISED
    assert error.result is ABORTED
    assert not error.transient


@pytest.mark.parametrize(("end", "became"), [(End.ABORTED, "aborted"), (End.REJECTED, "rejected")])
def test_a_failure_that_is_called_a_success_and_cannot_be_one(end: End, became: str) -> None:
    fault = Fault("`classify=judge` called it a SUCCESS", RAISED, impossible=True)
    error = explained(replace(ENDINGS[end][0], end=End.CLASSIFIER_FAILED, classifier_fault=fault))
    assert type(error) is actionkit.ClassifyError
    assert f"was {became} by the server, and 4.2 s into the call `classify=judge`" in str(error)
    assert error.__cause__ is RAISED


@pytest.mark.parametrize("end", [End.ABORTED, End.REJECTED], ids=lambda end: end.name)
def test_a_failure_that_could_not_be_judged_keeps_its_error_and_says_so(end: End) -> None:
    ending, cls, remedy = ENDINGS[end]
    error = explained(
        replace(ending, classifier_fault=Fault("`classify=judge` raised ValueError: no"))
    )
    assert type(error) is cls
    assert remedy in str(error)
    assert str(error).endswith("not tried again, because `classify=judge` raised ValueError: no.")


@pytest.mark.parametrize("end", [*TRANSIENT, End.ABORTED], ids=lambda end: end.name)
@pytest.mark.parametrize("cause", [RAISED, None])
def test_a_strategy_that_fails_ends_the_retries_and_the_last_failure_is_told(
    end: End, cause: BaseException | None
) -> None:
    ending, cls, remedy = ENDINGS[end]
    error = explained(replace(ending, strategy_fault=Fault("`RetryPolicy.stop=f` raised", cause)))
    assert type(error) is actionkit.RetriesExhaustedError
    assert remedy in str(error)
    assert str(error).endswith("The retries ended: `RetryPolicy.stop=f` raised.")
    assert (error.result, error.cancel) == (ending.result, ending.cancel)
    if cause is None:
        assert type(error.__cause__) is cls
        assert str(error).startswith(str(error.__cause__))
    else:
        assert error.__cause__ is cause


def test_a_strategy_that_fails_after_a_success_that_was_judged_transient() -> None:
    fault = Fault("`RetryPolicy.stop=f` raised")
    ending = replace(
        ENDINGS[End.REJECTED_BY_CLASSIFIER][0], verdict=Verdict.TRANSIENT, strategy_fault=fault
    )
    error = explained(ending)
    assert type(error) is actionkit.RetriesExhaustedError
    assert type(error.__cause__) is actionkit.TransientError
    assert error.result is error.__cause__.result is ABORTED


# --- what the graph shows (contract C3.2) ------------------------------------------------------


def no_server(actions: dict[str, tuple[str, ...]] | None, **changed: Any) -> str:
    around = GraphSnapshot(actions, 7, "rmw_fastrtps_cpp")
    return str(explained(ENDINGS[End.NO_SERVER][0], surroundings=lambda: around, **changed))


def test_where_no_server_is_seen_the_text_lists_those_that_are() -> None:
    fibonacci, other = ("test_msgs/action/Fibonacci",), ("a/action/B",)
    text = no_server({"/fibonaci": other, "/robot/fibonacci": fibonacci, "/zzz": fibonacci})
    assert "similar name: '/fibonaci' (a/action/B), '/robot/fibonacci' (" in text
    assert "same type under another name: '/zzz'." in text
    assert "ROS_DOMAIN_ID=7, rmw_fastrtps_cpp" in text
    assert "after 4.2 s of looking, so nothing was sent" in text
    many = no_server({f"/zzz{number}": fibonacci for number in range(9)})
    assert many.count("/zzz") == 5
    assert "and more" in many


def test_where_the_server_is_seen_the_text_does_not_call_it_similar() -> None:
    text = no_server({"/fibonacci": ("test_msgs/action/Fibonacci",)})
    assert "is visible, but has not answered this client yet" in text
    assert "similar" not in text
    others = {"/fibonacci": ("a/action/B", "a/action/C"), "/fibonaci": ("a/action/B",)}
    served = no_server(others)
    assert "similar" not in served
    assert "served as a/action/B, a/action/C" in served


def test_after_a_short_look_the_text_says_that_a_server_may_take_longer() -> None:
    near = {"/fibonaci": ("a/action/B",)}
    hint = "can take 3 s to be seen: if yours does, allow more time"
    assert hint in no_server({}, elapsed=0.5)
    assert hint in no_server(near, elapsed=0.5)
    assert hint not in no_server({}, elapsed=3.1)
    assert hint not in no_server(None, elapsed=0.5)
    assert hint not in no_server({"/fibonacci": ("test_msgs/action/Fibonacci",)}, elapsed=0.5)
    assert "timeout=0 leaves no time to look for one" in no_server({}, elapsed=0.0, timeout=0.0)


def test_where_nothing_is_seen_the_text_says_so() -> None:
    assert "No action server at all is visible." in no_server({})
    text = no_server(None)
    assert "the graph cannot be asked" in text
    assert "at all is visible" not in text
