"""What counts as success, transient or permanent failure (contract C3.3)."""

from __future__ import annotations

import math
import re
import uuid
from typing import Any

import pytest
from test_msgs.action import Fibonacci, NestedMessage
from test_msgs.msg import Arrays, WStrings

import actionkit
from actionkit import GoalState, Outcome, Verdict, classify_by_field
from actionkit._calls.retries.classify import (
    apply_verdict,
    call_classifier,
    check_classify,
    default_verdict,
)
from actionkit._goal.effects import End, Ending, Fault

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
    assert BY_FIELD(outcome(9, error=ABORTED)) is None
    open_ = classify_by_field("sequence[0]", transient={1})
    assert open_(outcome(9)) is None
    assert open_(outcome(9, error=ABORTED)) is None


def test_of_an_outcome_without_a_result_it_has_no_opinion() -> None:
    rejected = actionkit.GoalRejectedError("no")
    assert BY_FIELD(outcome(error=rejected, result=None)) is None


def test_the_default_result_of_an_abort_is_no_success() -> None:
    """It is what rclpy sends where the server's callback raised, and has 0 in every field."""
    judge = classify_by_field("nested_field.int32_value", ok={0}, transient={102})
    empty = NestedMessage.Result()
    assert judge(outcome(result=empty)) is SUCCESS
    assert judge(outcome(result=empty, error=ABORTED)) is None
    filled = NestedMessage.Result()
    filled.nested_field.bool_value = True
    assert judge(outcome(result=filled, error=ABORTED)) is SUCCESS
    filled.nested_field.int32_value = 102
    assert judge(outcome(result=filled, error=ABORTED)) is TRANSIENT


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
    assert judge(outcome(result=NestedMessage.Result())) is None


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
    classify_by_field("why", transient={"busy", ""}).check(Message)
    with pytest.raises(ValueError, match="that is a string, and never equal to 5"):
        classify_by_field("why", transient={"busy", 5}).check(Message)


def test_an_element_that_the_result_does_not_have_makes_no_success() -> None:
    said = call_classifier(BY_FIELD, outcome())
    assert isinstance(said, Fault)
    assert "`classify=<classify_by_field 'sequence[0]'>` raised" in said.problem
    assert "there is no element 0" in said.problem
    assert isinstance(said.cause, ValueError)
    assert BY_FIELD(outcome(error=ABORTED)) is None  # servers send all sorts of results with that


def test_a_field_that_does_not_exist_is_refused_before_any_goal() -> None:
    BY_FIELD.check(Fibonacci.Result)
    for path, near in [("sequense[0]", "sequence"), ("sequence[0].x", "int32"), ("a b", "a path")]:
        with pytest.raises(ValueError, match=r"^classify_by_field\(") as caught:
            classify_by_field(path, ok={0}).check(Fibonacci.Result)
        assert repr(path) in str(caught.value)
        assert near in str(caught.value)


@pytest.mark.parametrize(
    ("path", "message", "kind"),
    [
        ("sequence", Fibonacci.Result, "sequence<int32>"),
        ("int32_values", Arrays, "int32[3]"),
        ("basic_types_values", Arrays, "test_msgs/BasicTypes[3]"),
        ("nested_field", NestedMessage.Result, "test_msgs/BasicTypes"),
    ],
)
def test_a_whole_array_or_message_has_no_values_to_name(
    path: str, message: type, kind: str
) -> None:
    """Its values cannot stand in a set, and every goal would fail in its judgement."""
    told = (
        f"classify_by_field({path!r}): that is a {kind}, and has no single value;"
        " name one of its fields or items"
    )
    with pytest.raises(ValueError, match=f"^{re.escape(told)}$"):
        classify_by_field(path, ok={0}).check(message)


@pytest.mark.parametrize(
    ("path", "right", "wrong"),
    [
        ("nested_field.int32_value", (0, 1.0, -5), ("0", True, None)),
        ("nested_field.float64_value", (0, 1.5), ("0", False)),
        ("nested_field.bool_value", (True, False, 0, 1), ("true", 2, None)),
        ("nested_field.uint8_value", (0, 1.0), ("0", True)),
        ("nested_field.float32_value", (0, 1.5), ("0", True)),
        ("nested_field.byte_value", (b"a", 1), ()),
    ],
)
def test_values_that_the_field_never_has_are_refused_before_any_goal(
    path: str, right: tuple[Any, ...], wrong: tuple[Any, ...]
) -> None:
    for value in right:
        classify_by_field(path, ok={value}).check(NestedMessage.Result)
    for value in wrong:
        with pytest.raises(ValueError, match="never equal to") as caught:
            classify_by_field(path, transient={value}).check(NestedMessage.Result)
        assert repr(value) in str(caught.value)
        assert repr(path) in str(caught.value)


def test_a_text_is_never_equal_to_a_number() -> None:
    classify_by_field("wstring_value", ok={"1"}).check(WStrings)
    told = "classify_by_field('wstring_value'): that is a wstring, and never equal to 1, 2"
    with pytest.raises(ValueError, match=f"^{re.escape(told)}$"):
        classify_by_field("wstring_value", ok={2}, transient={1}).check(WStrings)


def test_a_client_takes_a_function_that_can_judge_its_action() -> None:
    for right in (None, BY_FIELD, default_verdict):
        check_classify(right, Fibonacci)
    told = "classify=5 must be a function (Outcome) -> Verdict or None"
    with pytest.raises(TypeError, match=f"^{re.escape(told)}$"):
        check_classify(5, Fibonacci)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"^classify_by_field\('sequence\[0\]'\): "):
        check_classify(BY_FIELD, NestedMessage)


def test_what_it_says_of_itself() -> None:
    assert repr(BY_FIELD) == "<classify_by_field 'sequence[0]'>"


@pytest.mark.parametrize("path", [None, 3, b"x", ["x"]])
def test_a_path_that_is_no_string(path: Any) -> None:
    with pytest.raises(TypeError, match="path="):
        classify_by_field(path, ok={0})


def test_arguments_that_make_no_sense() -> None:
    with pytest.raises(ValueError, match=r"^classify_by_field: path='' must name a field of the"):
        classify_by_field("", ok={0})
    with pytest.raises(ValueError, match=r"^classify_by_field: give values for .* or ok=$"):
        classify_by_field("x")
    for sets in (
        {"ok": {0, 5}, "transient": {5}},
        {"ok": {5}, "permanent": {5, 1}},
        {"permanent": {5}, "transient": {5}},
    ):
        with pytest.raises(ValueError, match="5 stands in more than one"):
            classify_by_field("x", **sets)
    with pytest.raises(ValueError, match=r": 'a', 1 stands in more than one set$"):
        classify_by_field("x", ok={"a", 1}, transient={"a", 1})  # of kinds that have no order


@pytest.mark.parametrize("name", ["ok", "transient", "permanent"])
def test_values_that_are_no_collection(name: str) -> None:
    wrong: list[Any] = ["done", b"x", 5, None, True, iter([1]), [[1]], [{}]]
    for value in wrong:
        with pytest.raises(TypeError, match=rf"^classify_by_field: {name}=.* must "):
            classify_by_field("x", **{name: value})
    with pytest.raises(ValueError, match=rf"{name}=.*NaN"):
        classify_by_field("x", **{name: {math.nan}})  # type: ignore[arg-type]


def test_any_collection_of_values_will_do() -> None:
    judge = classify_by_field("sequence[0]", transient=[1], permanent=(2,), ok=range(10, 20))
    verdicts = [judge(outcome(value)) for value in (1, 2, 15, 20)]
    assert verdicts == [TRANSIENT, PERMANENT, SUCCESS, PERMANENT]


# --- the user's own function -------------------------------------------------------------------


@pytest.mark.parametrize("verdict", Verdict)
def test_what_the_function_says_counts(verdict: Verdict) -> None:
    assert call_classifier(lambda _: verdict, outcome()) is verdict
    assert call_classifier(lambda _: verdict, outcome(1, error=ABORTED)) is verdict


def test_none_is_no_opinion() -> None:
    assert call_classifier(lambda _: None, outcome()) is SUCCESS
    assert call_classifier(lambda _: None, outcome(error=ABORTED)) is PERMANENT
    assert (
        call_classifier(lambda _: None, outcome(error=actionkit.ServerLostError("x"))) is TRANSIENT
    )


class Unprintable(Exception):
    def __str__(self) -> str:
        raise ValueError("no text")

    __repr__ = __str__


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (ValueError("no\nnever"), "raised ValueError: no never"),
        (KeyboardInterrupt(), "raised KeyboardInterrupt"),
        (SystemExit(1), "raised SystemExit: 1"),
        (Unprintable(), "raised a value of type Unprintable"),
        (ValueError(1000 * "x"), "xxx..."),
    ],
    ids=lambda value: type(value).__name__,
)
def test_a_function_that_raises_gives_no_verdict(error: BaseException, told: str) -> None:
    def judge(_: Outcome[Any]) -> Verdict:
        raise error

    for judged in (outcome(), outcome(error=ABORTED)):
        said = call_classifier(judge, judged)
        assert isinstance(said, Fault)
        assert said.problem.startswith("`classify=")
        assert "judge` raised" in said.problem
        assert said.problem.endswith(told)
        assert said.cause is error
        assert not said.impossible


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (True, "True"),
        ("SUCCESS", "'SUCCESS'"),
        (1, "1"),
        (Verdict, "<enum 'Verdict'>"),
        (Unprintable(), "a value of type Unprintable"),
    ],
)
def test_a_function_that_returns_nonsense_gives_no_verdict(wrong: Any, told: str) -> None:
    def judge(_: object) -> Any:
        return wrong

    said = call_classifier(judge, outcome())
    name = f"`classify={judge.__qualname__}`"
    assert said == Fault(f"{name} returned {told}, which is neither a Verdict nor None")


@pytest.mark.parametrize("result", [None, Fibonacci.Result(), NestedMessage.Result()])
def test_a_goal_that_failed_with_an_empty_result_is_never_a_success(result: Any) -> None:
    error = actionkit.GoalRejectedError("rejected")
    failed = outcome(error=error, result=result)
    said = call_classifier(lambda _: SUCCESS, failed)
    assert isinstance(said, Fault)
    assert said.impossible
    assert said.cause is error
    assert "called it a SUCCESS" in said.problem
    assert call_classifier(lambda _: TRANSIENT, failed) is TRANSIENT
    assert call_classifier(lambda _: SUCCESS, outcome(result=Fibonacci.Result())) is SUCCESS


@pytest.mark.parametrize(
    ("status", "error", "lack"),
    [
        (GoalState.REJECTED, actionkit.GoalRejectedError("x"), "it was rejected"),
        (GoalState.CANCELED, actionkit.GoalCanceledError("x"), "it was canceled"),
        (GoalState.ABORTED, actionkit.GoalAbortedError("x"), ""),
        (GoalState.SUCCEEDED, None, ""),
    ],
)
@pytest.mark.parametrize("sent", ["nothing", "empty", "full"])
def test_what_can_be_judged_a_success(
    status: GoalState, error: BaseException | None, lack: str, sent: str
) -> None:
    result = {"nothing": None, "empty": Fibonacci.Result(), "full": Fibonacci.Result(sequence=[4])}
    judged = Outcome(status, result[sent], error, 1, (), uuid.uuid4(), None)
    said = call_classifier(lambda _: SUCCESS, judged)
    if error is None or (sent == "full" and not lack):
        assert said is SUCCESS
    else:
        assert isinstance(said, Fault)
        assert said.impossible
        assert said.cause is error
        told = lack or ("it has no result" if sent == "nothing" else "its result is empty")
        assert said.problem.startswith("`classify=test_what_can_be_judged_a_success.")
        assert said.problem.endswith(f"` called it a SUCCESS, though {told}")
    # By a field it has no opinion of what cannot be one, so that its own error stands.
    if sent == "full":
        assert BY_FIELD(judged) is (None if lack else SUCCESS)
        assert not isinstance(call_classifier(BY_FIELD, judged), Fault)


def test_retry_aborted() -> None:
    judge = actionkit.retry_aborted()
    assert judge(outcome(error=ABORTED)) is TRANSIENT
    assert judge(outcome()) is None
    rejected = actionkit.GoalRejectedError("x")
    assert judge(Outcome(GoalState.REJECTED, None, rejected, 1, (), uuid.uuid4(), None)) is None


# --- overruling --------------------------------------------------------------------------------

SUCCEEDED = Ending(End.SUCCEEDED, GoalState.SUCCEEDED, result=1)


@pytest.mark.parametrize("verdict", [TRANSIENT, PERMANENT])
def test_a_success_judged_a_failure(verdict: Verdict) -> None:
    ending = apply_verdict(SUCCEEDED, verdict)
    assert (ending.end, ending.verdict) == (End.REJECTED_BY_CLASSIFIER, verdict)
    assert (ending.status, ending.result) == (GoalState.SUCCEEDED, 1)


@pytest.mark.parametrize("end", [End.ABORTED, End.REJECTED])
def test_a_failure_judged_a_success(end: End) -> None:
    ending = Ending(end, GoalState[end.name], result=2, lost_because="why")
    judged = apply_verdict(ending, SUCCESS)
    assert (judged.end, judged.status, judged.result) == (End.SUCCEEDED, ending.status, 2)


@pytest.mark.parametrize("end", [End.ABORTED, End.REJECTED])
@pytest.mark.parametrize("verdict", [TRANSIENT, PERMANENT])
def test_a_failure_judged_a_failure_keeps_its_own_error(end: End, verdict: Verdict) -> None:
    ending = Ending(end, GoalState[end.name], result=2)
    assert apply_verdict(ending, verdict) is ending


def test_a_success_judged_a_success_is_left_alone() -> None:
    assert apply_verdict(SUCCEEDED, SUCCESS) is SUCCEEDED


@pytest.mark.parametrize("impossible", [False, True])
@pytest.mark.parametrize("end", [End.SUCCEEDED, End.ABORTED, End.REJECTED])
def test_without_a_verdict_nothing_is_a_success(end: End, impossible: bool) -> None:
    fault = Fault("it broke", impossible=impossible)
    judged = apply_verdict(Ending(end, GoalState[end.name], result=2), fault)
    stands = end is not End.SUCCEEDED and not impossible
    assert judged.end is (end if stands else End.CLASSIFIER_FAILED)
    assert (judged.classifier_fault, judged.result) == (fault, 2)
