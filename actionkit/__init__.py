"""ActionKit: the action client that ROS 2 lacks.

    from actionkit import Client
    from test_msgs.action import Fibonacci

    with Client(Fibonacci, "fibonacci") as client:
        result = client.call(Fibonacci.Goal(order=10), timeout=10.0)

Importing this does not import rclpy; making a `Client` does.
"""

from actionkit._calls.budget import RetryBudget
from actionkit._calls.classify import classify_by_field, retry_aborted
from actionkit._calls.future import GoalFuture
from actionkit._calls.signals import cancel_on_signals
from actionkit._client import Client
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
    GoalRejectedError,
    InvalidGoalError,
    PermanentError,
    ResultLostError,
    RetriesExhaustedError,
    ServerLostError,
    ServerUnavailableError,
    TransientError,
)
from actionkit._model.settings import RetryPolicy, Timeouts
from actionkit._model.values import CancelReport, GoalEvent, GoalState, Outcome, Timeline, Verdict
from actionkit._observers.json_lines import JsonLines
from actionkit._observers.json_reader import LogFile, read_json_lines
from actionkit._observers.json_schema import LoggedLine
from actionkit._observers.protocol import CallInfo, Observer
from actionkit._observers.rosout import Rosout
from actionkit._observers.telemetry import OpenTelemetry

__version__ = "0.1.0"

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
    "GoalFuture",
    "GoalRejectedError",
    "GoalState",
    "InvalidGoalError",
    "JsonLines",
    "LogFile",
    "LoggedLine",
    "Observer",
    "OpenTelemetry",
    "Outcome",
    "PermanentError",
    "ResultLostError",
    "RetriesExhaustedError",
    "RetryBudget",
    "RetryPolicy",
    "Rosout",
    "ServerLostError",
    "ServerUnavailableError",
    "Timeline",
    "Timeouts",
    "TransientError",
    "Verdict",
    "cancel_on_signals",
    "classify_by_field",
    "read_json_lines",
    "retry_aborted",
]
