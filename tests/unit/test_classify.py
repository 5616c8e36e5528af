"""What counts as success, transient or permanent failure (contract C3.3)."""

from __future__ import annotations

import logging
import uuid
from typing import Any

import pytest
from test_msgs.action import Fibonacci, NestedMessage

import actionkit
from actionkit import GoalState, Outcome, Verdict, classify_by_field
from actionkit._classify import asked, default_verdict, overruled
from actionkit._effects import End, Ending

SUCCESS, TRANSIENT, PERMANENT = Verdict
ABORTED = actionkit.GoalAbortedError("aborted")


def outcome(*sequence: int, error: BaseException | None = None, result: Any = ...) -> Outcome[Any]:
    if result is ...:
        result = Fibonacci.Result(sequence=sequence)
    status = GoalState.SUCCEEDED if error is None else GoalState.ABORTED
    return Outcome(status, result, error, 1, (), uuid.uuid4(), None)


# --- the default -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("error", "verdict"),
    [
        (None, SUCCESS),
        (actionkit.ServerUnavailableError("x"), TRANSIENT),
        (actionkit.AcceptanceTimeoutError("x"), TRANSIENT),
        (actionkit.ServerLostError("x"), TRANSIENT),
        (actionkit.FeedbackStalledError("x"), TRANSIENT),
        (actionkit.InvalidGoalError("x"), PERMANENT),
        (actionkit.ActionTypeMismatchError("x"), PERMANENT),
        (actionkit.GoalRejectedError("x"), PERMANENT),
        (actionkit.GoalAbortedError("x"), PERMANENT),
        (actionkit.GoalCanceledError("x"), PERMANENT),
        (actionkit.ResultLostError("x"), PERMANENT),
        (actionkit.DeadlineExceededError("x"), PERMANENT),
        (actionkit.ClientClosedError("x"), PERMANENT),
        (RuntimeError("x"), PERMANENT),
    ],
    ids=lambda value: type(value).__name__,
)
def test_each_error_says_whether_trying_again_may_help(
    error: BaseException | None, verdict: Verdict
) -> None:
    assert default_verdict(outcome(error=error)) is verdict


# --- by a field --------------------------------------------------------------------------------

BY_FIELD = classify_by_field("sequence[0]", transient={1, 2}, permanent={3}, ok={4})


@pytest.mark.parametrize("error", [None, ABORTED])
@pytest.mark.parametrize(
    ("value", "verdict"), [(1, TRANSIENT), (2, TRANSIENT), (3, PERMANENT), (4, SUCCESS)]
)
def test_a_value_that_is_named_decides_whatever_the_status(
    error: BaseException | None, value: int, verdict: Verdict
) -> None:
    assert BY_FIELD(outcome(value, error=error)) is verdict


def test_a_value_named_nowhere() -> None:
    assert BY_FIELD(outcome(9)) is PERMANENT  # `ok=` names all that is fine
    assert BY_FIELD(outcome(9, error=ABORTED)) is PERMANENT
    lost = actionkit.ServerLostError("x")
    open_ = classify_by_field("sequence[0]", transient={1})
    assert open_(outcome(9)) is SUCCESS
    assert open_(outcome(9, error=ABORTED)) is PERMANENT
    assert open_(outcome(9, error=lost)) is TRANSIENT


def test_an_outcome_without_a_result_is_judged_by_its_error() -> None:
    rejected = actionkit.GoalRejectedError("no")
    assert BY_FIELD(outcome(error=rejected, result=None)) is PERMANENT
    lost = actionkit.ServerLostError("x")
    assert BY_FIELD(outcome(error=lost, result=None)) is TRANSIENT


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("nested_field_no_pkg.duration_value.sec", 7),
        ("nested_field.int32_value", 7),
        ("nested_different_pkg.sec", 7),
    ],
)
def test_a_field_at_any_depth(path: str, value: int) -> None:
    result = NestedMessage.Result()
    target: Any = result
    *way, last = path.split(".")
    for name in way:
        target = getattr(target, name)
    setattr(target, last, value)
    judge = classify_by_field(path, transient={value})
    judge.check(NestedMessage.Result)
    assert judge(outcome(result=result)) is TRANSIENT
    assert judge(outcome(result=NestedMessage.Result())) is SUCCESS


def test_a_text_or_a_truth_can_be_looked_at_too() -> None:
    class Message:
        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]:
            return {"success": "boolean", "why": "string"}

        success, why = False, "busy"

    from rosidl_parser.definition import BasicType, UnboundedString

    Message.SLOT_TYPES = (BasicType("boolean"), UnboundedString())  # type: ignore[attr-defined]
    result = Message()
    assert classify_by_field("success", permanent={False})(outcome(result=result)) is PERMANENT
    assert classify_by_field("success", ok={True})(outcome(result=result)) is PERMANENT
    assert classify_by_field("why", transient={"busy"})(outcome(result=result)) is TRANSIENT


def test_an_element_that_the_result_does_not_have_is_an_error_of_the_judgement(
    caplog: pytest.LogCaptureFixture,
) -> None:
    assert asked(BY_FIELD, outcome()) is SUCCESS  # the default counts
    assert "there is no element 0" in caplog.text


def test_a_field_that_does_not_exist_is_refused_before_any_goal() -> None:
    BY_FIELD.check(Fibonacci.Result)
    for path, near in [("sequense[0]", "sequence"), ("sequence[0].x", "int32"), ("a b", "a path")]:
        with pytest.raises(ValueError, match=r"^classify_by_field\(") as caught:
            classify_by_field(path, ok={0}).check(Fibonacci.Result)
        assert repr(path) in str(caught.value)
        assert near in str(caught.value)


def test_a_whole_array_has_no_values_to_name() -> None:
    """Its values cannot stand in a set, and every goal would fail in its judgement."""
    with pytest.raises(ValueError, match="sequence"):
        classify_by_field("sequence", ok={0}).check(Fibonacci.Result)


def test_what_it_says_of_itself() -> None:
    assert repr(BY_FIELD) == "<classify_by_field 'sequence[0]'>"


@pytest.mark.parametrize("path", [None, 3, b"x", ["x"]])
def test_a_path_that_is_no_string(path: Any) -> None:
    with pytest.raises(TypeError, match="path="):
        classify_by_field(path, ok={0})


def test_arguments_that_make_no_sense() -> None:
    with pytest.raises(ValueError, match="path=''"):
        classify_by_field("", ok={0})
    with pytest.raises(ValueError, match="give values"):
        classify_by_field("x")
    for sets in (
        {"ok": {0, 5}, "transient": {5}},
        {"ok": {5}, "permanent": {5, 1}},
        {"permanent": {5}, "transient": {5}},
    ):
        with pytest.raises(ValueError, match="5 stands in more than one"):
            classify_by_field("x", **sets)
    with pytest.raises(ValueError, match="more than one set"):
        classify_by_field("x", ok={"a", 1}, transient={"a", 1})  # of kinds that have no order


def test_any_collection_of_values_will_do() -> None:
    judge = classify_by_field("sequence[0]", transient=[1], permanent=(2,), ok=range(10, 20))
    verdicts = [judge(outcome(value)) for value in (1, 2, 15, 20)]
    assert verdicts == [TRANSIENT, PERMANENT, SUCCESS, PERMANENT]


# --- the user's own function -------------------------------------------------------------------


@pytest.mark.parametrize("verdict", Verdict)
def test_what_the_function_says_counts(verdict: Verdict) -> None:
    assert asked(lambda _: verdict, outcome()) is verdict
    assert asked(lambda _: verdict, outcome(error=ABORTED)) is verdict


@pytest.mark.parametrize("error", [ValueError("no"), KeyboardInterrupt(), SystemExit(1)])
def test_a_function_that_raises_is_logged_and_the_default_counts(
    error: BaseException, caplog: pytest.LogCaptureFixture
) -> None:
    def classify(_: Outcome[Any]) -> Verdict:
        raise error

    with caplog.at_level(logging.ERROR, "actionkit"):
        assert asked(classify, outcome()) is SUCCESS
        assert asked(classify, outcome(error=ABORTED)) is PERMANENT
    assert [record.exc_info is not None for record in caplog.records] == [True, True]
    assert "classify" in caplog.text


@pytest.mark.parametrize("wrong", [None, True, "SUCCESS", 1, Verdict])
def test_a_function_that_returns_no_verdict_is_logged_and_the_default_counts(
    wrong: Any, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.ERROR, "actionkit"):
        assert asked(lambda _: wrong, outcome()) is SUCCESS
    assert repr(wrong) in caplog.text
    assert "no Verdict" in caplog.text


def test_a_goal_without_a_result_is_never_a_success(caplog: pytest.LogCaptureFixture) -> None:
    rejected = outcome(error=actionkit.GoalRejectedError("rejected"), result=None)
    with caplog.at_level(logging.ERROR, "actionkit"):
        assert asked(lambda _: SUCCESS, rejected) is PERMANENT
    assert "without a result" in caplog.text
    assert asked(lambda _: TRANSIENT, rejected) is TRANSIENT


# --- overruling --------------------------------------------------------------------------------

SUCCEEDED = Ending(End.SUCCEEDED, GoalState.SUCCEEDED, result=1)


@pytest.mark.parametrize("verdict", [TRANSIENT, PERMANENT])
def test_a_success_judged_a_failure(verdict: Verdict) -> None:
    ending = overruled(SUCCEEDED, verdict)
    assert (ending.end, ending.info) == (End.JUDGED, verdict)
    assert (ending.status, ending.result) == (GoalState.SUCCEEDED, 1)


@pytest.mark.parametrize("end", [End.ABORTED, End.REJECTED])
def test_a_failure_judged_a_success(end: End) -> None:
    ending = Ending(end, GoalState[end.name], result=2, info="why")
    judged = overruled(ending, SUCCESS)
    assert (judged.end, judged.status, judged.result) == (End.SUCCEEDED, ending.status, 2)


@pytest.mark.parametrize("end", [End.ABORTED, End.REJECTED])
@pytest.mark.parametrize("verdict", [TRANSIENT, PERMANENT])
def test_a_failure_judged_a_failure_keeps_its_own_error(end: End, verdict: Verdict) -> None:
    ending = Ending(end, GoalState[end.name], result=2)
    assert overruled(ending, verdict) is ending


def test_a_success_judged_a_success_is_left_alone() -> None:
    assert overruled(SUCCEEDED, SUCCESS) is SUCCEEDED
