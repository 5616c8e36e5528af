"""Reference servers with an action type that is not their own."""

from __future__ import annotations

import subprocess
import sys
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner
from test_msgs.action import Fibonacci, NestedMessage

from actionkit import servers
from actionkit.cli._app import app
from actionkit.servers._behaviours.behaviour import COMMON_OPTIONS, Behaviour
from actionkit.servers._behaviours.registry import is_foreign
from actionkit.servers._serving.contents import message_of
from tests import forked
from tests.rclpy_client import ABORTED, CANCELED, OK, PATIENCE, SUCCEEDED, Driver

NESTED = "test_msgs/action/NestedMessage"
EMPTY = NestedMessage.Result()
UNABLE = {"countdown", "error_code", "fibonacci", "guarded", "navigate"}
"""Servers that need the fields of their own type."""
ENDS = [
    # server, options, how its goals end, how many feedbacks it journals
    ("aborts", {}, ABORTED, 5),
    ("expires", {"steps": 3, "result_timeout": 900.0}, SUCCEEDED, 2),
    ("flaky", {"fails": 0}, SUCCEEDED, 4),
    ("floods", {"steps": 50}, SUCCEEDED, 1),
    ("ignores_cancel", {"period": 0.0}, SUCCEEDED, 5),
    ("queued", {"period": 0.0, "steps": 2}, SUCCEEDED, 1),
    ("scripted", {"script": [{"feedback": 2}, "abort"]}, ABORTED, 2),
    ("slow_accept", {"delay": 0.1}, SUCCEEDED, 4),
]


@pytest.mark.parametrize(("name", "options", "status", "feedbacks"), ENDS)
def test_they_do_the_same(
    action_server: Any, nested: Driver, name: str, options: Any, status: int, feedbacks: int
) -> None:
    server = action_server(name, action_type=NestedMessage, **options)
    nested.connect()
    goal_id, handle = nested.accepted()
    answer = nested.wait(handle.get_result_async())
    assert (answer.status, answer.result) == (status, EMPTY)
    assert all(message == NestedMessage.Feedback() for message in nested.feedback[goal_id])
    server.wait_for({SUCCEEDED: "succeeded", ABORTED: "aborted"}[status], goal_id=goal_id)
    assert server.count("feedback") == feedbacks


def test_until_it_is_cancelled(action_server: Any, nested: Driver) -> None:
    server = action_server("never_finishes", action_type=NESTED)
    nested.connect()
    goal_id, handle = nested.accepted()
    server.wait_for("feedback")
    assert nested.cancel(goal_id) == (OK, [goal_id])
    assert nested.wait(handle.get_result_async()).status == CANCELED


@pytest.mark.long
def test_a_crash(action_server: Any, nested: Driver) -> None:
    server = action_server("crashes", action_type=NESTED, point="before_result")
    nested.connect()
    nested.send()
    server.wait_for("crashing", timeout=PATIENCE)
    server.restart()
    nested.connect()


def test_which_serve_any_type() -> None:
    for name in servers.names():
        if name in UNABLE:
            with pytest.raises(ValueError, match="serve any type are: aborts, blocking, cancels"):
                is_foreign(name, "my_robot/action/Pick")
        else:
            assert is_foreign(name, "my_robot/action/Pick")


@pytest.mark.parametrize(
    ("name", "arguments", "error", "text"),
    [
        ("countdown", {"action_type": NestedMessage}, ValueError,
         f"countdown server is about .*Fibonacci or .*Countdown and .* serve {NESTED}. .*silent"),
        ("silent", {"action_type": "Pick"}, ValueError, "one is written as test_msgs/action/Fib"),
        ("silent", {"action_type": Fibonacci.Goal}, TypeError, "must be an action class"),
        ("silent", {"action_type": 3}, TypeError, "action_type=3 must be an action class"),
        ("silent", {"steps": 3}, ValueError, "option steps=3 is for actions of another type"),
        ("silent", {"action_type": NESTED, "steps": "x"}, ValueError, "not of type int"),
        ("scripted", {"action_type": NESTED, "script": [{"abort": [3]}]}, ValueError,
         "the script's step 'abort' has numbers"),
        ("silent", {"action_type": "no_robot/action/Pick"}, RuntimeError,
         "the package 'no_robot' is not installed here"),
        ("silent", {"action_type": "test_msgs/action/Pick"}, RuntimeError,
         "the package 'test_msgs' has no action 'Pick'"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told(
    name: str, arguments: dict[str, Any], error: type[Exception], text: str
) -> None:
    with pytest.raises(error, match=text):
        servers.start(name, **arguments)


def test_on_the_command_line(ros_domain: int) -> None:
    command = [sys.executable, "-m", "actionkit", "serve", "aborts", "--action", "pick"]
    with forked.Popen(
        [*command, "--type", NESTED], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True
    ) as process:
        driver = Driver(ros_domain, NestedMessage, "pick")
        try:
            driver.connect()
            assert driver.wait(driver.accepted()[1].get_result_async()).status == ABORTED
        finally:
            driver.close()
            process.terminate()
        assert process.wait(PATIENCE) == 0


def test_wrong_usage_of_the_command_line() -> None:
    for words, text in (
        (["guarded", "--type", NESTED], "cannot serve test_msgs/action/NestedMessage"),
        (["silent", "--type", "test_msgs/action/Pick"], "has no action 'Pick'"),
    ):
        done = forked.run(
            [sys.executable, "-m", "actionkit.servers", *words],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 2
        assert text in done.stderr
    assert "--type TYPE" in CliRunner().invoke(app, ["serve", "--help"]).output


def test_fields_of_a_foreign_type_are_never_touched_by_name() -> None:
    """They may be anything: an `order` that is a text, a `sequence` of names."""
    odd = SimpleNamespace(order="two coffees", sequence=["a"])
    options = {**COMMON_OPTIONS, "steps": 4}
    process: Any = SimpleNamespace(foreign=True, life=None)
    assert Behaviour(options, process).order_of(odd) == 4
    assert message_of(odd, odd) is odd
