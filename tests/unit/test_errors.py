"""The tree of errors, and what each of them carries (contract C3)."""

from __future__ import annotations

import copy
import pickle
import re
import uuid
from typing import Any

import pytest
from test_msgs.action import Fibonacci

import actionkit
from actionkit import CancelReport, GoalEvent, GoalState
from actionkit._model import errors as _errors
from actionkit._model.field_errors import FieldError

TREE: dict[str, tuple[str, ...]] = {
    "ActionKitError": ("Exception",),
    "TransientError": ("ActionKitError",),
    "ServerUnavailableError": ("TransientError", "TimeoutError"),
    "AcceptanceTimeoutError": ("TransientError",),
    "ServerLostError": ("TransientError",),
    "FeedbackStalledError": ("TransientError",),
    "PermanentError": ("ActionKitError",),
    "InvalidGoalError": ("PermanentError", "TypeError", "ValueError"),
    "ActionTypeMismatchError": ("PermanentError",),
    "GoalUnknownError": ("PermanentError",),
    "GoalNotReplacedError": ("PermanentError",),
    "GoalRejectedError": ("PermanentError",),
    "GoalAbortedError": ("PermanentError",),
    "GoalCanceledError": ("PermanentError",),
    "ResultLostError": ("PermanentError",),
    "ClassifyError": ("PermanentError",),
    "DeadlineExceededError": ("ActionKitError", "TimeoutError"),
    "RetriesExhaustedError": ("ActionKitError",),
    "LedgerError": ("ActionKitError", "OSError"),
    "SecurityError": ("ActionKitError", "PermissionError"),
    "ClientClosedError": ("ActionKitError",),
}
ERRORS = [getattr(actionkit, name) for name in TREE]
EVENT = GoalEvent(uuid.uuid4(), 1, GoalState.SENDING, 1.0, 2.0, "detail")
OWN_FACTS: dict[str, dict[str, Any]] = {
    "InvalidGoalError": {"field": "pose.x"},
    "ActionTypeMismatchError": {"expected": "a/action/A", "served": ("a/action/B",)},
    "GoalAbortedError": {"result": Fibonacci.Result(sequence=[1, 2])},
    "GoalCanceledError": {"result": Fibonacci.Result(sequence=[3])},
    "ResultLostError": {"status": GoalState.ABORTED},
    "ClassifyError": {"result": Fibonacci.Result(sequence=[4])},
    "DeadlineExceededError": {
        "phase": "accept",
        "late_result": Fibonacci.Result(),
        "status": GoalState.SUCCEEDED,
    },
}


def test_the_tree_is_that_of_the_contract() -> None:
    found = {
        name: tuple(base.__name__ for base in cls.__bases__)
        for name, cls in vars(_errors).items()
        if isinstance(cls, type) and issubclass(cls, BaseException)
    }
    assert found == TREE
    exported = {name for name in actionkit.__all__ if name.endswith("Error")}
    assert exported == set(TREE)


def test_the_module_draws_the_tree() -> None:
    drawn = re.findall(r"^[\s│├└─]*(\w+Error)\b", _errors.__doc__ or "", re.MULTILINE)
    assert drawn == list(TREE)


@pytest.mark.parametrize("cls", ERRORS)
def test_transient_tells_whether_trying_again_may_help(cls: Any) -> None:
    assert cls.transient is issubclass(cls, actionkit.TransientError)
    assert cls("x").transient is cls.transient


@pytest.mark.parametrize("cls", ERRORS)
def test_a_bare_error(cls: Any) -> None:
    error = cls("what happened, and what to do")
    assert str(error) == error.message == "what happened, and what to do"
    assert error.args == ("what happened, and what to do",)
    assert (error.action_name, error.goal_id, error.attempts) == ("", None, 0)
    assert (error.timeline, error.elapsed) == ((), None)
    # That of a deadline is never None.
    nothing = CancelReport.NOT_NEEDED if cls is actionkit.DeadlineExceededError else None
    assert error.cancel is nothing
    for name, value in OWN_FACTS.get(cls.__name__, {}).items():
        assert getattr(error, name) in ("", (), None), (name, value)
        assert name in (cls.__doc__ or "")


@pytest.mark.parametrize("cls", ERRORS)
@pytest.mark.parametrize("copied", ["pickle", "copy"])
def test_an_error_travels_between_processes_with_all_it_knows(cls: Any, copied: str) -> None:
    error = cls(
        "text",
        action_name="/fibonacci",
        goal_id=EVENT.goal_id,
        attempts=2,
        timeline=(EVENT,),
        elapsed=1.5,
    )
    assert (error.action_name, error.goal_id, error.attempts) == ("/fibonacci", EVENT.goal_id, 2)
    assert (error.timeline, error.elapsed) == ((EVENT,), 1.5)
    error.cancel = CancelReport.REFUSED
    for name, value in OWN_FACTS.get(cls.__name__, {}).items():
        setattr(error, name, value)
    error.__cause__ = FieldError("pose.x", lambda: None, "no")
    twin = pickle.loads(pickle.dumps(error)) if copied == "pickle" else copy.copy(error)
    assert type(twin) is cls
    assert (str(twin), vars(twin)) == (str(error), vars(error))
    assert twin.args == error.args
    assert (type(twin.__cause__), str(twin.__cause__)) == (FieldError, "pose.x: no.")
    assert isinstance(pickle.loads(pickle.dumps(cls("x"))).__cause__, type(None))


def test_a_cause_that_cannot_travel_leaves_its_text() -> None:
    class OnlyHere(Exception):
        pass

    error = actionkit.GoalAbortedError("text")
    error.__cause__ = OnlyHere("why")
    cause = pickle.loads(pickle.dumps(error)).__cause__
    assert (type(cause), str(cause)) == (RuntimeError, "OnlyHere: why")


def test_every_documented_attribute_exists() -> None:
    documented = re.findall(r"^        (\w+): ", actionkit.ActionKitError.__doc__ or "", re.M)
    error = actionkit.ActionKitError("x")
    assert [name for name in documented if not hasattr(error, name)] == []
