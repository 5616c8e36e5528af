"""The names and signatures that users build on. A change here is a change for all of them."""

from __future__ import annotations

import ast
import dataclasses
import enum
import inspect
import textwrap
from collections.abc import Iterator
from typing import Any

import pytest

import actionkit
from actionkit import Client, GoalFuture, agents

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
    Client.__init__: "(self, action_type, action_name, *misplaced, node=None,"
    " timeouts=Timeouts(server=5.0, accept=5.0, total=None, feedback=None, cancel=2.0,"
    " liveness=None, result=30.0),"
    " retry=RetryPolicy(attempts=3, initial=0.2, factor=2.0, max_pause=5.0, jitter=0.2,"
    " resend='confirmed_stopped', stop=None, wait=None), classify=None, observers=(),"
    " on_close='cancel', retry_budget=None, **unknown)",
    Client.call: "(self, goal, timeout=<as the client's timeouts.total>, *, on_feedback=None,"
    " retry=None, classify=None, **unknown)",
    Client.call_async: "(self, goal, on_feedback=None,"
    " timeout=<as the client's timeouts.total>, *, retry=None, classify=None, **unknown)",
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
    actionkit.read_json_lines: "(path)",
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
    GoalFuture.result: "(self, timeout=None)",
    GoalFuture.exception: "(self, timeout=None)",
    GoalFuture.outcome: "(self, timeout=None)",
    GoalFuture.cancel: "(self)",
    GoalFuture.feedback: "(self)",
    GoalFuture.add_done_callback: "(self, fn)",
}
MEMBERS = {
    "CancelReport": "CONFIRMED REFUSED UNKNOWN NOT_NEEDED",
    "GoalState": "SENDING SENT ACCEPTED REJECTED EXECUTING FEEDBACK CANCELING SUCCEEDED CANCELED"
    " ABORTED LOST RETRYING TIMED_OUT",
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
    " feedback_count elapsed",
    "CallInfo": "call_id action_name action_type node_name monotonic wall goal context",
    "LogFile": "lines problems",
    "LoggedLine": "kind call_id action_name action_type node_name pid event data",
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
    actionkit.read_json_lines: "OSError",
    Client.server_is_ready: "ClientClosedError",
    Client.cancel_all: "ClientClosedError",
    GoalFuture.result: "TimeoutError CancelledError ActionKitError",
    GoalFuture.exception: "TimeoutError CancelledError",
    GoalFuture.outcome: "TimeoutError",
}
"""What these raise, also by way of what they call."""


def public_classes() -> list[type]:
    return [value for value in map(vars(actionkit).get, NAMES) if isinstance(value, type)]


def own_members() -> Iterator[tuple[str, Any]]:
    """Yield the public methods and properties that our public classes define themselves."""
    for cls in public_classes():
        for name, member in vars(cls).items():
            function = getattr(member, "fget", getattr(member, "__func__", member))
            generated = dataclasses.is_dataclass(cls) and name.startswith("__")
            if inspect.isfunction(function) and not generated and not name.startswith("_"):
                yield f"{cls.__name__}.{name}", function
    yield "Client.__init__", Client.__init__
    yield "RetryBudget.__init__", actionkit.RetryBudget.__init__
    yield "classify_by_field", actionkit.classify_by_field
    yield "retry_aborted", actionkit.retry_aborted
    yield "JsonLines.__init__", actionkit.JsonLines.__init__
    yield "OpenTelemetry.__init__", actionkit.OpenTelemetry.__init__
    yield "Rosout.__init__", actionkit.Rosout.__init__
    yield "read_json_lines", actionkit.read_json_lines


METHODS = dict(own_members())
REFUSED = ("misplaced", "unknown")
"""Parameters that take what is not there, to explain it."""


# --- names -------------------------------------------------------------------------------------


def test_the_names() -> None:
    assert actionkit.__all__ == NAMES
    assert sorted(NAMES) == NAMES


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
        for name, value in vars(actionkit).items()
        if not name.startswith("_") and not inspect.ismodule(value)
    }
    assert ours == set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_what_is_public_says_where_it_is_public(name: str) -> None:
    assert getattr(actionkit, name).__name__ == name


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


@pytest.mark.parametrize("name", MEMBERS)
def test_the_members_of_enumerations(name: str) -> None:
    members = list(getattr(actionkit, name))
    assert [member.name for member in members] == MEMBERS[name].split()
    for member in members:
        assert isinstance(member, enum.Enum)
        assert isinstance(member, str)
        assert str(member) == member.value == member.name


@pytest.mark.parametrize("name", FIELDS)
def test_the_fields_of_values(name: str) -> None:
    cls = getattr(actionkit, name)
    assert [field.name for field in dataclasses.fields(cls)] == FIELDS[name].split()
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(cls.__new__(cls), FIELDS[name].split()[0], 1)


@pytest.mark.parametrize("name", AGENTS_FIELDS)
def test_the_fields_of_values_of_agents(name: str) -> None:
    cls = getattr(agents, name)
    assert [field.name for field in dataclasses.fields(cls)] == AGENTS_FIELDS[name].split()
    assert cls.__dataclass_params__.frozen
    for field in AGENTS_FIELDS[name].split():
        assert f"{field}: " in (cls.__doc__ or "")


def test_terminal_states() -> None:
    terminal = {state.name for state in actionkit.GoalState if state.is_terminal}
    assert terminal == {"REJECTED", "SUCCEEDED", "CANCELED", "ABORTED"}


# --- words -------------------------------------------------------------------------------------


@pytest.mark.parametrize("cls", public_classes(), ids=lambda cls: cls.__name__)
def test_every_class_says_what_it_is(cls: type) -> None:
    said = vars(cls).get("__doc__") or ""
    assert said.strip().splitlines()[0].rstrip().endswith((".", ";", ":", ")"))
    assert not said.startswith(f"{cls.__name__}(")  # what dataclass writes by itself
    for field in FIELDS.get(cls.__name__, "").split():
        assert f"{field}: " in said


@pytest.mark.parametrize("name", METHODS)
def test_every_method_says_what_it_does(name: str) -> None:
    function = METHODS[name]
    said = inspect.getdoc(function)
    assert function.__doc__, name
    assert said is not None
    assert said.splitlines()[0].endswith((".", ":")), name
    arguments = [each for each in inspect.signature(function).parameters if each != "self"]
    if "Args:" in said:
        for argument in arguments:
            assert f"{argument}: " in said or argument in REFUSED, (name, argument)


@pytest.mark.parametrize("name", METHODS)
def test_every_method_names_what_it_raises(name: str) -> None:
    function = METHODS[name]
    said = (inspect.getdoc(function) or "").partition("Raises:")[2]
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    raised = {
        node.exc.func.id
        for node in ast.walk(tree)
        if isinstance(node, ast.Raise)
        and isinstance(node.exc, ast.Call)
        and isinstance(node.exc.func, ast.Name)
    }
    for error in raised | set(RAISES.get(function, "").split()):
        assert error in said, f"{name} raises {error}"


def test_every_error_says_when_it_is_raised() -> None:
    for cls in public_classes():
        if issubclass(cls, BaseException):
            words = (cls.__doc__ or "").split()
            assert len(words) >= 6, cls
