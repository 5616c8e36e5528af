"""ActionKit: the action client that ROS 2 lacks.

    from actionkit import Client
    from test_msgs.action import Fibonacci

    with Client(Fibonacci, "fibonacci") as client:
        result = client.call(Fibonacci.Goal(order=10), timeout=10.0)

Importing this does not import rclpy; making a `Client` does. Each name is imported where it is used
first, so that a program does not wait for what it does not need.
"""

import importlib as _importlib
import sys as _sys
import typing as _typing

if _typing.TYPE_CHECKING:  # the same as in `_MODULES`, for type checkers and editors
    from actionkit._calls.futures.future import GoalFuture
    from actionkit._calls.ledger.store import Leftover
    from actionkit._calls.on_signal.signals import cancel_on_signals
    from actionkit._calls.retries.budget import RetryBudget
    from actionkit._calls.retries.classify import classify_by_field, retry_aborted
    from actionkit._client import Client
    from actionkit._leftovers.ledger import Ledger
    from actionkit._messages.convert import from_plain, to_plain
    from actionkit._model.errors import (
        AcceptanceTimeoutError,
        ActionKitError,
        ActionTypeMismatchError,
        ClassifyError,
        ClientClosedError,
        DeadlineExceededError,
        FeedbackStalledError,
        GoalAbortedError,
        GoalCanceledError,
        GoalNotReplacedError,
        GoalRejectedError,
        GoalUnknownError,
        InvalidGoalError,
        LedgerError,
        PermanentError,
        ResultLostError,
        RetriesExhaustedError,
        SecurityError,
        ServerLostError,
        ServerUnavailableError,
        TransientError,
    )
    from actionkit._model.settings import RetryPolicy, Timeouts
    from actionkit._model.values import (
        CancelReport,
        GoalEvent,
        GoalFate,
        GoalReport,
        GoalState,
        Outcome,
        Timeline,
        Verdict,
    )
    from actionkit._observers.json_lines import JsonLines
    from actionkit._observers.json_reader import LogFile, read_json_lines
    from actionkit._observers.json_schema import LoggedLine
    from actionkit._observers.protocol import CallInfo, Observer
    from actionkit._observers.rosout import Rosout
    from actionkit._observers.telemetry import OpenTelemetry
    from actionkit._recordings.goals import RecordedGoal, RecordedGoals, read_goals

__version__ = "1.0.0"

__all__ = [
    "AcceptanceTimeoutError",
    "ActionKitError",
    "ActionTypeMismatchError",
    "CallInfo",
    "CancelReport",
    "ClassifyError",
    "Client",
    "ClientClosedError",
    "DeadlineExceededError",
    "FeedbackStalledError",
    "GoalAbortedError",
    "GoalCanceledError",
    "GoalEvent",
    "GoalFate",
    "GoalFuture",
    "GoalNotReplacedError",
    "GoalRejectedError",
    "GoalReport",
    "GoalState",
    "GoalUnknownError",
    "InvalidGoalError",
    "JsonLines",
    "Ledger",
    "LedgerError",
    "Leftover",
    "LogFile",
    "LoggedLine",
    "Observer",
    "OpenTelemetry",
    "Outcome",
    "PermanentError",
    "RecordedGoal",
    "RecordedGoals",
    "ResultLostError",
    "RetriesExhaustedError",
    "RetryBudget",
    "RetryPolicy",
    "Rosout",
    "SecurityError",
    "ServerLostError",
    "ServerUnavailableError",
    "Timeline",
    "Timeouts",
    "TransientError",
    "Verdict",
    "cancel_on_signals",
    "classify_by_field",
    "from_plain",
    "read_goals",
    "read_json_lines",
    "retry_aborted",
    "to_plain",
]

_MODULES = {
    "AcceptanceTimeoutError": "_model.errors",
    "ActionKitError": "_model.errors",
    "ActionTypeMismatchError": "_model.errors",
    "CallInfo": "_observers.protocol",
    "CancelReport": "_model.values",
    "ClassifyError": "_model.errors",
    "Client": "_client",
    "ClientClosedError": "_model.errors",
    "DeadlineExceededError": "_model.errors",
    "FeedbackStalledError": "_model.errors",
    "GoalAbortedError": "_model.errors",
    "GoalCanceledError": "_model.errors",
    "GoalEvent": "_model.values",
    "GoalFate": "_model.values",
    "GoalFuture": "_calls.futures.future",
    "GoalNotReplacedError": "_model.errors",
    "GoalRejectedError": "_model.errors",
    "GoalUnknownError": "_model.errors",
    "GoalReport": "_model.values",
    "GoalState": "_model.values",
    "InvalidGoalError": "_model.errors",
    "JsonLines": "_observers.json_lines",
    "Ledger": "_leftovers.ledger",
    "LedgerError": "_model.errors",
    "Leftover": "_calls.ledger.store",
    "LogFile": "_observers.json_reader",
    "LoggedLine": "_observers.json_schema",
    "Observer": "_observers.protocol",
    "OpenTelemetry": "_observers.telemetry",
    "Outcome": "_model.values",
    "PermanentError": "_model.errors",
    "RecordedGoal": "_recordings.goals",
    "RecordedGoals": "_recordings.goals",
    "ResultLostError": "_model.errors",
    "RetriesExhaustedError": "_model.errors",
    "RetryBudget": "_calls.retries.budget",
    "RetryPolicy": "_model.settings",
    "Rosout": "_observers.rosout",
    "SecurityError": "_model.errors",
    "ServerLostError": "_model.errors",
    "ServerUnavailableError": "_model.errors",
    "Timeline": "_model.values",
    "Timeouts": "_model.settings",
    "TransientError": "_model.errors",
    "Verdict": "_model.values",
    "cancel_on_signals": "_calls.on_signal.signals",
    "classify_by_field": "_calls.retries.classify",
    "from_plain": "_messages.convert",
    "read_goals": "_recordings.goals",
    "read_json_lines": "_observers.json_reader",
    "retry_aborted": "_calls.retries.classify",
    "to_plain": "_messages.convert",
}
"""Where each public name is."""


if not _typing.TYPE_CHECKING:  # a checker would take any name for one that is there

    def __getattr__(name: str) -> _typing.Any:
        if name not in _MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        try:
            value = getattr(_importlib.import_module(f"{__name__}.{_MODULES[name]}"), name)
        except (AttributeError, ImportError) as error:  # such as `signal.SIGHUP`, on Windows
            if _sys.platform == "linux":
                raise
            from actionkit._model.missing import ON_LINUX

            raise ImportError(ON_LINUX) from error
        globals()[name] = value  # so it is asked for once
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
