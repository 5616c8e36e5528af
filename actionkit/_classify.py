"""What counts as success: by default, and by a field of the result (contract C3.3)."""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection
from dataclasses import replace
from typing import Any

from actionkit._effects import End, Ending
from actionkit._errors import ActionKitError
from actionkit._fields import FieldError, field_type, get_field
from actionkit._values import Outcome, Verdict

_log = logging.getLogger("actionkit")

Classify = Callable[[Outcome[Any]], Verdict]


def default_verdict(outcome: Outcome[Any]) -> Verdict:
    """Return what an outcome counts as where nobody says otherwise."""
    if outcome.error is None:
        return Verdict.SUCCESS
    transient = isinstance(outcome.error, ActionKitError) and outcome.error.transient
    return Verdict.TRANSIENT if transient else Verdict.PERMANENT


def asked(classify: Classify, outcome: Outcome[Any]) -> Verdict:
    """Return what the user's function says; its errors are logged, and the default counts."""
    try:
        verdict = classify(outcome)
        if not isinstance(verdict, Verdict):
            _log.error("classify=%r returned %r, which is no Verdict", classify, verdict)
        elif verdict is Verdict.SUCCESS and outcome.result is None:
            # A rejected goal is never an empty success (C3.1).
            _log.error("classify=%r called a goal without a result a success", classify)
        else:
            return verdict
    except BaseException:  # noqa: BLE001  a user's error must not lose the outcome
        _log.exception("classify=%r raised", classify)
    return default_verdict(outcome)


def overruled(ending: Ending, verdict: Verdict) -> Ending:
    """Return the ending as the verdict has it."""
    succeeded = ending.end is End.SUCCEEDED
    if verdict is Verdict.SUCCESS and not succeeded:
        return replace(ending, end=End.SUCCEEDED)
    if verdict is not Verdict.SUCCESS and succeeded:
        return replace(ending, end=End.JUDGED, info=verdict)
    return ending


class FieldClassifier:
    """Judges outcomes that carry a result by one of its fields. Made by `classify_by_field`."""

    def __init__(
        self, path: str, transient: Collection[Any], permanent: Collection[Any], ok: Collection[Any]
    ) -> None:
        self._path = path
        self._by_value = {
            Verdict.SUCCESS: frozenset(ok),
            Verdict.TRANSIENT: frozenset(transient),
            Verdict.PERMANENT: frozenset(permanent),
        }
        self._closed = bool(ok)

    def __repr__(self) -> str:
        return f"<classify_by_field {self._path!r}>"

    def check(self, result_class: type) -> None:
        """Raise where the results of an action do not have the field.

        Raises:
            ValueError: They do not; the error names the fields that there are.
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

    def __call__(self, outcome: Outcome[Any]) -> Verdict:
        """Judge an outcome."""
        if outcome.result is None:
            return default_verdict(outcome)
        value = get_field(outcome.result, self._path)
        for verdict, values in self._by_value.items():
            if value in values:
                return verdict
        if outcome.error is None and self._closed:
            return Verdict.PERMANENT  # `ok=` names all that is fine
        return default_verdict(outcome)


def classify_by_field(
    path: str,
    *,
    transient: Collection[Any] = (),
    permanent: Collection[Any] = (),
    ok: Collection[Any] = (),
) -> FieldClassifier:
    """Return a `classify=` function that looks at one field of the result.

        Client(..., classify=classify_by_field("error_code", transient={102}, ok={0}))

    Args:
        path: The field, such as `error_code` or `status.code`. A client refuses, when it is
            made, one that its results do not have.
        transient: Values that make any outcome with a result a transient failure.
        permanent: Values that make it a permanent failure.
        ok: Values that make it a success, even of an aborted goal. Where given, a goal that
            succeeded with a value named nowhere is a permanent failure.

    Raises:
        TypeError: `path` is no string.
        ValueError: `path` is empty, a value stands in two of the sets, or none is given.
    """
    if not isinstance(path, str):
        raise TypeError(f"classify_by_field: path={path!r} must be a string")
    if not path:
        raise ValueError("classify_by_field: path='' must name a field of the result")
    sets = [frozenset(transient), frozenset(permanent), frozenset(ok)]
    if not any(sets):
        raise ValueError("classify_by_field: give values for transient=, permanent= or ok=")
    twice = (sets[0] & sets[1]) | (sets[0] & sets[2]) | (sets[1] & sets[2])
    if twice:
        values = ", ".join(sorted(repr(value) for value in twice))
        raise ValueError(f"classify_by_field: {values} stands in more than one set")
    return FieldClassifier(path, transient, permanent, ok)
