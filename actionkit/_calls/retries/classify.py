"""Decides what counts as success: by default, and by a field of the result (C3.3)."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import replace
from numbers import Real
from typing import Any

from actionkit._goal.effects import End, Ending, Fault
from actionkit._messages.paths import field_type, get_field
from actionkit._model.arguments import check_function
from actionkit._model.errors import ActionKitError
from actionkit._model.field_errors import FieldError
from actionkit._model.values import GoalState, Outcome, Verdict
from actionkit._threads.function_runner import described, short_name_of

Classify = Callable[[Outcome[Any]], Verdict | None]


def default_verdict(outcome: Outcome[Any]) -> Verdict:
    """Return how an outcome counts if the user has no other opinion."""
    if outcome.error is None:
        return Verdict.SUCCESS
    transient = isinstance(outcome.error, ActionKitError) and outcome.error.transient
    return Verdict.TRANSIENT if transient else Verdict.PERMANENT


def label_of(classify: Classify) -> str:
    """Return the name of the user's function for error texts."""
    name = repr(classify) if isinstance(classify, FieldClassifier) else short_name_of(classify)
    return f"`classify={name}`"


def call_classifier(classify: Classify, outcome: Outcome[Any]) -> Verdict | Fault:
    """Return the verdict of the user's function, which it runs. Never raises."""
    try:
        verdict = classify(outcome)
        if verdict is None:
            return default_verdict(outcome)
        if not isinstance(verdict, Verdict):
            said = described(verdict)
            return Fault(
                f"{label_of(classify)} returned {said}, which is neither a Verdict nor None"
            )
        lack = why_no_success(outcome)
        if verdict is Verdict.SUCCESS and lack:
            return Fault(
                f"{label_of(classify)} called it a SUCCESS, though {lack}",
                cause=outcome.error,
                impossible=True,
            )
    except BaseException as error:  # noqa: BLE001  any error: the call must end (C3.1)
        return Fault(f"{label_of(classify)} raised {described(error)}", error)
    return verdict


def why_no_success(outcome: Outcome[Any]) -> str:
    """Return why a goal can never count as a success, or `""` (C3.1, C3.3)."""
    if outcome.error is None:
        return ""
    if outcome.status in (GoalState.REJECTED, GoalState.CANCELED):
        return f"it was {str(outcome.status).lower()}"
    if outcome.result is None:
        return "it has no result"
    # rclpy also sends an empty result if a server's callback raised.
    return "its result is empty" if outcome.result == type(outcome.result)() else ""


def apply_verdict(ending: Ending, verdict: Verdict | Fault) -> Ending:
    """Return the ending after the verdict; unchanged if the verdict changes nothing."""
    succeeded = ending.end is End.SUCCEEDED
    if isinstance(verdict, Fault):
        failed = succeeded or verdict.impossible
        end = End.CLASSIFIER_FAILED if failed else ending.end
        return replace(ending, end=end, classifier_fault=verdict)
    if verdict is Verdict.SUCCESS and not succeeded:
        return replace(ending, end=End.SUCCEEDED)
    if verdict is not Verdict.SUCCESS and succeeded:
        return replace(ending, end=End.REJECTED_BY_CLASSIFIER, verdict=verdict)
    return ending


def retry_aborted() -> Classify:
    """Return a `classify=` function that makes an aborted goal a transient failure, to retry it.

        Client(..., classify=retry_aborted())

    It returns no verdict on other goals. The `RetryPolicy` decides how often the call is tried
    again, and how long each pause is.
    """
    return _retry_aborted


def _retry_aborted(outcome: Outcome[Any]) -> Verdict | None:
    return Verdict.TRANSIENT if outcome.status is GoalState.ABORTED else None


class FieldClassifier:
    """Classifies outcomes with a result by one of its fields. Made by `classify_by_field`."""

    def __init__(self, path: str, values: dict[Verdict, frozenset[Any]]) -> None:
        self._path = path
        self._by_value = values
        self._closed = bool(values[Verdict.SUCCESS])

    def __repr__(self) -> str:
        return f"<classify_by_field {self._path!r}>"

    def check(self, result_class: type) -> None:
        """Raise if the action's results do not have the field, or if it never has such values.

        Raises:
            ValueError: That is so; if the field does not exist, the error names those that do.
        """
        try:
            kind = field_type(result_class, self._path)
        except FieldError as error:
            raise ValueError(f"classify_by_field({self._path!r}): {error}") from error
        if "/" in kind or kind.endswith("]") or kind.startswith("sequence"):
            raise ValueError(
                f"classify_by_field({self._path!r}): that is a {kind}, and has no single value;"
                " name one of its fields or items"
            )
        wrong = [each for values in self._by_value.values() for each in values]
        wrong = [each for each in wrong if not _may_equal(each, kind)]
        if wrong:
            raise ValueError(
                f"classify_by_field({self._path!r}): that is a {kind}, and never equal to"
                f" {', '.join(sorted(map(repr, wrong)))}"
            )

    def __call__(self, outcome: Outcome[Any]) -> Verdict | None:
        """Return the verdict on an outcome, or `None` to keep its error.

        Raises:
            ValueError: The goal succeeded, but the path names an element of an array that its
                result does not have.
        """
        failed = outcome.error is not None
        if outcome.result is None:
            return None
        try:
            value = get_field(outcome.result, self._path)
        except FieldError:
            if failed:
                return None  # servers send all kinds of results with an abort
            raise
        for verdict, values in self._by_value.items():
            if value in values:
                vain = verdict is Verdict.SUCCESS and why_no_success(outcome)
                return None if vain else verdict
        # `ok=` names all good values.
        return Verdict.PERMANENT if self._closed and not failed else None


def _may_equal(value: object, kind: str) -> bool:
    """Whether a field of a ROS type can equal a value: a number never equals "102"."""
    if kind.startswith(("string", "wstring")):
        return isinstance(value, str)
    if kind == "boolean":
        return value in (True, False)
    if kind.startswith(("int", "uint", "float", "double")):
        return isinstance(value, Real) and not isinstance(value, bool)
    return True


def classify_by_field(
    path: str,
    *,
    transient: Collection[Any] = (),
    permanent: Collection[Any] = (),
    ok: Collection[Any] = (),
) -> FieldClassifier:
    """Return a `classify=` function that looks at one field of the result.

        Client(..., classify=classify_by_field("error_code", transient={102}, ok={0}))

    If the path names an element of an array, and the result of a successful goal does not have
    that element, the call ends with a `ClassifyError`. A goal that did not succeed keeps its own
    error if its value is not in any of the sets. An `ok` value does not make a goal a success if
    it was cancelled, or if its result is empty. Servers send an empty result after an error in
    their callback.

    Args:
        path: The field, such as `error_code`, `status.code` or `codes[0]`. Making a client fails if
            the action's results do not have this field, or if it can never have the given values.
        transient: Values that make any outcome with a result a transient failure.
        permanent: Values that make it a permanent failure.
        ok: Values that make it a success, even if the goal was aborted. If you give `ok`, a
            successful goal with a value in none of the sets is a permanent failure.

    Raises:
        TypeError: `path` is not a string, or a set is not a collection of values.
        ValueError: `path` is empty, a value is NaN or is in two sets, or no values are given.
    """
    if not isinstance(path, str):
        raise TypeError(f"classify_by_field: path={path!r} must be a string")
    if not path:
        raise ValueError("classify_by_field: path='' must name a field of the result")
    sets = {
        Verdict.SUCCESS: _values("ok", ok),
        Verdict.TRANSIENT: _values("transient", transient),
        Verdict.PERMANENT: _values("permanent", permanent),
    }
    if not any(sets.values()):
        raise ValueError("classify_by_field: give values for transient=, permanent= or ok=")
    good, passing, bad = sets.values()
    twice = (good & passing) | (good & bad) | (passing & bad)
    if twice:
        values = ", ".join(sorted(repr(value) for value in twice))
        raise ValueError(f"classify_by_field: {values} stands in more than one set")
    return FieldClassifier(path, sets)


def _values(name: str, given: object) -> frozenset[Any]:
    if isinstance(given, (str, bytes)) or not isinstance(given, Collection):
        raise TypeError(
            f"classify_by_field: {name}={given!r} must be a collection of values, such as"
            f" {name}={{{given!r}}}"
        )
    try:
        values = frozenset(given)
    except TypeError as error:
        raise TypeError(
            f"classify_by_field: {name}={given!r} must hold plain values, such as numbers and"
            f" strings ({error})"
        ) from error
    if any(isinstance(value, float) and math.isnan(value) for value in values):
        raise ValueError(f"classify_by_field: {name}={given!r} holds NaN, which equals no value")
    return values


def check_classify(classify: Classify | None, action_type: Any) -> None:
    """Raise if `classify=` cannot classify the outcomes of an action.

    Raises:
        TypeError: It is not a function, or it is a class or a coroutine function.
        ValueError: It looks at a field that the action's results do not have.
    """
    if classify is None:
        return
    check_function("classify", classify, "a function (Outcome) -> Verdict or None")
    if isinstance(classify, FieldClassifier):
        classify.check(action_type.Result)
