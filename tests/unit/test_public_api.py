"""The public names and signatures. A change here is a change for all users."""

from __future__ import annotations

import dataclasses
import enum
import inspect
from typing import Any, get_args

import pytest
from test_msgs.action import Fibonacci

import actionkit
import actionkit.servers
import actionkit.testing
from actionkit import Client, GoalFuture, agents
from actionkit.testing import FakeServer, tick_until
from actionkit.trees import ActionBehaviour, FromBlackboard

NAMES = [
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
TESTING = ["EventLog", "FakeServer", "isolated_domain", "tick_until"]
SERVERS = ["Server", "ServerEvent", "names", "start"]
AGENTS = [
    "ApprovalRequest",
    "ConfigError",
    "Image",
    "Progress",
    "Tool",
    "ToolResult",
    "Toolbox",
]
SIGNATURES = {
    Client.__init__: "(self, action_type, action_name, *, node=None,"
    " timeouts=Timeouts(server=5.0, accept=5.0, total=None, feedback=None, cancel=2.0,"
    " liveness=None, result=30.0),"
    " retry=RetryPolicy(attempts=3, initial=0.2, factor=2.0, max_pause=5.0, jitter=0.2,"
    " resend='confirmed_stopped', stop=None, wait=None), classify=None, observers=(),"
    " on_close='cancel', retry_budget=None, ledger=None)",
    Client.call: "(self, goal, timeout=<as the client's timeouts.total>, *, on_feedback=None,"
    " retry=None, classify=None, replaces=None, preempt=False, key=None)",
    Client.call_async: "(self, goal, on_feedback=None,"
    " timeout=<as the client's timeouts.total>, *, retry=None, classify=None, replaces=None,"
    " preempt=False, key=None)",
    Client.check_goal: "(self, goal)",
    Client.attach: "(self, goal_id, *, timeout=<as the client's timeouts.total>,"
    " on_feedback=None, on_give_up='leave')",
    Client.cancel_everything: "(self, timeout=10.0)",
    Client.wait_for_server: "(self, timeout=None)",
    actionkit.RetryBudget.__init__: "(self, capacity=10.0, ratio=0.1)",
    actionkit.classify_by_field: "(path, *, transient=(), permanent=(), ok=())",
    actionkit.retry_aborted: "()",
    actionkit.cancel_on_signals.__init__: "(self, *signals)",
    actionkit.JsonLines.__init__: "(self, path, *, max_bytes=10000000, backups=5, messages=True,"
    " max_items=100)",
    actionkit.OpenTelemetry.__init__: "(self, tracer_provider=None, meter_provider=None)",
    actionkit.Rosout.__init__: "(self, node)",
    actionkit.Observer.on_event: "(self, event, call)",
    actionkit.read_goals: "(path)",
    actionkit.read_json_lines: "(path)",
    ActionBehaviour.__init__: "(self, name, client, goal, *, timeout=None, retry=None,"
    " classify=None, feedback_key=None, result_key=None, earlier_goal='wait', key=None,"
    " server_timeout=5.0)",
    ActionBehaviour.setup: "(self, **kwargs)",
    ActionBehaviour.shutdown: "(self)",
    FromBlackboard.__init__: "(self, key)",
    tick_until: "(tree, wanted, timeout=10.0, *, period=0.05)",
    agents.Toolbox.from_file: "(path, *, domain_id=None)",
    agents.Toolbox.from_config: "(config, *, domain_id=None)",
    agents.Toolbox.call: "(self, name, arguments=None, *, on_progress=None, approve=None)",
    agents.Toolbox.cancel_all: "(self)",
    agents.Toolbox.goals: "(self, goal_id=None)",
    agents.Toolbox.openai_tools: "(self)",
    agents.Toolbox.anthropic_tools: "(self)",
    agents.Toolbox.close: "(self)",
    agents.Toolbox.aclose: "(self)",
    Client.server_is_ready: "(self)",
    Client.cancel_all: "(self)",
    Client.close: "(self)",
    FakeServer.__init__: "(self, action_type, name, *, accept=True, feedback=(), period=0.0,"
    " result=None, end='succeeded', cancel='accept', preempts=False, domain_id=None)",
    FakeServer.script: "(self, entries)",
    FakeServer.wait_for: "(self, event, *, goal_id=None, count=1, timeout=10.0)",
    FakeServer.count: "(self, event)",
    FakeServer.running: "(self)",
    FakeServer.start: "(self)",
    FakeServer.stop: "(self)",
    actionkit.servers.start: "(name, *, action_name='fibonacci', action_type=None,"
    " domain_id=None, **options)",
    GoalFuture.result: "(self, timeout=None)",
    GoalFuture.exception: "(self, timeout=None)",
    GoalFuture.outcome: "(self, timeout=None)",
    GoalFuture.wait_accepted: "(self, timeout=None)",
    GoalFuture.wait_accepted_async: "(self, timeout=None)",
    GoalFuture.cancel: "(self)",
    GoalFuture.feedback: "(self)",
    GoalFuture.add_done_callback: "(self, fn)",
}
MEMBERS = {
    "CancelReport": "CONFIRMED REFUSED UNKNOWN NOT_NEEDED",
    "GoalFate": "UNANSWERED RUNNING REJECTED ENDED LOST LEFT",
    "GoalState": "SENDING SENT ACCEPTED REJECTED EXECUTING FEEDBACK CANCELING SUCCEEDED CANCELED"
    " ABORTED LOST RETRYING TIMED_OUT REPLACED",
    "Verdict": "SUCCESS TRANSIENT PERMANENT",
}
AGENTS_FIELDS = {
    "ApprovalRequest": "tool arguments text",
    "Image": "mime_type data",
    "Progress": "elapsed feedback_count message percent",
    "Tool": "name description input_schema output_schema confirm kind",
    "ToolResult": "value is_error images",
}
FIELDS = {
    "GoalEvent": "goal_id attempt state monotonic wall detail cancel_refused",
    "Outcome": "status result error attempts timeline goal_id cancel callback_errors"
    " feedback_count elapsed goals from_ledger",
    "GoalReport": "goal_id fate cancel_refused",
    "CallInfo": "call_id action_name action_type node_name monotonic wall goal context",
    "LogFile": "lines problems",
    "LoggedLine": "kind call_id action_name action_type node_name pid event data",
    "RecordedGoal": "goal_id action_name action_type state began accepted ended sent_by server goal"
    " result timeline",
    "RetryPolicy": "attempts initial factor max_pause jitter resend stop wait",
    "Timeouts": "server accept total feedback cancel liveness result",
}
RAISES = {
    Client.__init__: "TypeError ValueError ImportError ActionTypeMismatchError",
    Client.call: "ActionKitError CancelledError RuntimeError TypeError ValueError",
    Client.call_async: "ClientClosedError RuntimeError TypeError ValueError",
    Client.wait_for_server: "ClientClosedError TypeError ValueError",
    actionkit.RetryBudget.__init__: "TypeError ValueError",
    actionkit.classify_by_field: "TypeError ValueError",
    actionkit.JsonLines.__init__: "OSError TypeError ValueError",
    actionkit.OpenTelemetry.__init__: "ImportError TypeError",
    actionkit.Rosout.__init__: "TypeError",
    actionkit.read_goals: "ImportError OSError ValueError",
    actionkit.read_json_lines: "OSError",
    ActionBehaviour.__init__: "TypeError ValueError AttributeError",
    ActionBehaviour.setup: "ServerUnavailableError ImportError ActionTypeMismatchError TypeError"
    " ValueError",
    tick_until: "AssertionError TimeoutError",
    Client.server_is_ready: "ClientClosedError",
    Client.cancel_all: "ClientClosedError",
    FakeServer.__init__: "TypeError ValueError ImportError",
    FakeServer.script: "TypeError ValueError",
    FakeServer.wait_for: "AssertionError TypeError ValueError",
    actionkit.servers.start: "TypeError ValueError RuntimeError",
    GoalFuture.result: "TimeoutError CancelledError ActionKitError",
    GoalFuture.exception: "TimeoutError CancelledError",
    GoalFuture.outcome: "TimeoutError",
}
"""What these raise, also by way of what they call."""


# --- names -------------------------------------------------------------------------------------


def test_the_names() -> None:
    assert actionkit.__all__ == NAMES
    assert sorted(NAMES) == NAMES
    assert actionkit.testing.__all__ == TESTING
    assert actionkit.servers.__all__ == SERVERS


def test_the_names_of_trees() -> None:
    import actionkit.trees

    assert actionkit.trees.__all__ == ["ActionBehaviour", "FromBlackboard"]


@pytest.mark.parametrize(
    ("cls", "names"),
    [
        (Client, "action_name closed pending retry_budget timeouts"),
        (GoalFuture, "goal_id known_to_run latest_feedback state timeline"),
        (ActionBehaviour, "client future"),
    ],
)
def test_the_properties(cls: type, names: str) -> None:
    own = {
        name
        for each in cls.__mro__
        if each.__module__.startswith("actionkit")
        for name, member in vars(each).items()
        if isinstance(member, property) and not name.startswith("_")
    }
    assert own == set(names.split())


def test_the_names_of_agents() -> None:
    assert agents.__all__ == AGENTS
    ours = {
        name
        for name, value in vars(agents).items()
        if not name.startswith("_") and not inspect.ismodule(value)
    }
    assert ours == set(AGENTS)
    for name in AGENTS:
        assert getattr(agents, name).__name__ == name


def test_nothing_else_is_public() -> None:
    ours = {
        name
        for name in dir(actionkit)
        if not name.startswith("_") and not inspect.ismodule(getattr(actionkit, name))
    }
    assert ours == set(NAMES)


def test_the_version() -> None:
    from importlib.metadata import version

    assert actionkit.__version__ == version("actionkit")


# --- shapes ------------------------------------------------------------------------------------


@pytest.mark.parametrize("function", SIGNATURES, ids=lambda function: function.__qualname__)
def test_the_signatures(function: Any) -> None:
    signature = inspect.signature(function)
    bare = [each.replace(annotation=each.empty) for each in signature.parameters.values()]
    plain = signature.replace(parameters=bare, return_annotation=signature.empty)
    assert str(plain) == SIGNATURES[function]


def test_annotations_can_be_evaluated() -> None:
    assert get_args(Client[Fibonacci]) == (Fibonacci,)
    messages = (Fibonacci.Result, Fibonacci.Feedback)
    assert get_args(GoalFuture[messages]) == messages


@pytest.mark.parametrize("name", MEMBERS)
def test_the_members_of_enumerations(name: str) -> None:
    members = list(getattr(actionkit, name))
    assert [member.name for member in members] == MEMBERS[name].split()
    for member in members:
        assert isinstance(member, enum.Enum)
        assert isinstance(member, str)
        assert str(member) == member.value == member.name


@pytest.mark.parametrize(
    ("cls", "names"),
    [
        *((getattr(actionkit, name), names) for name, names in FIELDS.items()),
        *((getattr(agents, name), names) for name, names in AGENTS_FIELDS.items()),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_the_fields_of_values(cls: Any, names: str) -> None:
    assert [field.name for field in dataclasses.fields(cls)] == names.split()
    assert cls.__dataclass_params__.frozen
    for name in names.split():
        assert f"{name}: " in (cls.__doc__ or "")


def test_terminal_states() -> None:
    terminal = {state.name for state in actionkit.GoalState if state.is_terminal}
    assert terminal == {"REJECTED", "SUCCEEDED", "CANCELED", "ABORTED"}


# --- what the reference makes of it --------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_every_name_is_documented(name: str) -> None:
    said = getattr(actionkit, name).__doc__ or ""
    assert said
    assert not said.startswith(f"{name}(")  # what dataclass writes by itself


@pytest.mark.parametrize("function", RAISES, ids=lambda function: function.__qualname__)
def test_every_method_names_what_it_raises(function: Any) -> None:
    said = (function.__doc__ or "").partition("Raises:")[2]
    assert [error for error in RAISES[function].split() if error not in said] == []
