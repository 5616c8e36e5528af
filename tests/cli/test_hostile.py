"""What others wrote, in names, messages and errors, reaches no terminal raw."""

from __future__ import annotations

import io
import json
import logging
import uuid
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import click
import pytest
from rich.console import Console
from test_msgs.action import NestedMessage
from test_msgs.msg import BasicTypes

from actionkit import GoalAbortedError, GoalEvent, GoalState, Outcome, Timeline
from actionkit.cli import _app, _demo_screen, _options, _watch_screens
from actionkit.cli._exits import Exit
from actionkit.cli._findings import note
from actionkit.cli._goal_board import Board
from actionkit.cli._live import LiveReport
from actionkit.cli._problems import Problem
from actionkit.cli._reports import JsonReport, Report, TextReport
from actionkit.cli.doctor import _show as show_finding
from actionkit.cli.info import _show as show_ends

HOSTILE = "\x1b]0;owned\x07\x1b[2J\x9b31m\x7f\r\u202e\ud800"
ESCAPED = r"\u001b]0;owned\u0007\u001b[2J\u009b31m\u007f\r\u202e\ud800"
OWNED = r"\u001b]0;owned"
GOAL = uuid.UUID(int=7)


def told(capsys: pytest.CaptureFixture[str]) -> str:
    """Return what was written, which nothing in it disturbs."""
    captured = capsys.readouterr()
    text = captured.out + captured.err
    text.encode()
    assert not set(text) & set(HOSTILE.replace("owned", "").replace("[2J", "")) - set("]0;31m")
    return text


def aborted() -> Outcome[Any]:
    error = GoalAbortedError(f"The server said: {HOSTILE}")
    return Outcome(GoalState.ABORTED, None, error, 1, Timeline(), GOAL, None)


def a_call(report: Report) -> None:
    report.event(GoalEvent(GOAL, 1, GoalState.ACCEPTED, 1.0, 1.0))
    report.event(GoalEvent(GOAL, 1, GoalState.EXECUTING, 1.0, 1.0, HOSTILE, True))
    report.event(GoalEvent(GOAL, 1, GoalState.RETRYING, 1.0, 1.0, HOSTILE))
    report.finished(aborted(), Exit.ABORTED)


@pytest.mark.parametrize(
    "make", [TextReport, lambda goal: LiveReport(goal, bar=False)], ids=["text", "terminal"]
)
def test_a_call(make: Callable[[Any], Report], capsys: pytest.CaptureFixture[str]) -> None:
    a_call(make(NestedMessage.Goal()))
    assert told(capsys).count(ESCAPED) == 3


def test_a_call_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    a_call(JsonReport(NestedMessage.Goal(), HOSTILE, HOSTILE))
    lines = [json.loads(line) for line in told(capsys).splitlines()]
    assert [line.get("detail") for line in lines[:3]] == ["", HOSTILE, HOSTILE]
    assert lines[-1]["error"] == str(aborted().error)


def test_feedback(capsys: pytest.CaptureFixture[str]) -> None:
    feedback = NestedMessage.Feedback(nested_field=BasicTypes(char_value=0x1B))
    report = JsonReport(NestedMessage.Goal(), HOSTILE, HOSTILE)
    report.event(GoalEvent(GOAL, 1, GoalState.EXECUTING, 1.0, 1.0))
    for each in (TextReport(None), report):
        each.feedback(feedback, 1, 1.0)
    assert "char_value" in told(capsys)


@pytest.mark.parametrize(
    "screen", [_watch_screens.TextScreen(), _watch_screens.JsonScreen(HOSTILE, str)]
)
def test_watched_servers(screen: Any, capsys: pytest.CaptureFixture[str]) -> None:
    board = Board()
    board.take((HOSTILE,), 0.0)
    screen.servers(board)
    assert ESCAPED in told(capsys)


def test_watched_servers_on_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    table = _watch_screens.TableScreen(HOSTILE)
    board = Board()
    board.take((HOSTILE,), 0.0)
    console = Console(width=400)
    console.print(table._drawn(board, 1.0))
    assert told(capsys).count(ESCAPED) == 2


def test_findings_and_ends(capsys: pytest.CaptureFixture[str]) -> None:
    show_finding(note("server", HOSTILE, HOSTILE), as_json=False)
    show_ends("servers", (SimpleNamespace(node=HOSTILE, action_type=HOSTILE),), False, True)  # type: ignore[arg-type]
    assert told(capsys).count(r"\u001b[2J") == 4


def test_the_demo(capsys: pytest.CaptureFixture[str]) -> None:
    _demo_screen.DemoScreen(Console(width=200, markup=False)).failure(HOSTILE)
    assert r"\u001b[2J" in told(capsys)


@pytest.mark.parametrize(
    "error",
    [Problem(Exit.FAILED, HOSTILE), click.UsageError(HOSTILE), ZeroDivisionError(HOSTILE)],
    ids=lambda error: type(error).__name__,
)
def test_errors(
    error: Exception, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(_app.app, "main", fail)
    assert _app.run([]) != 0
    assert told(capsys).count(OWNED) == 1
    monkeypatch.setattr(_app, "debugging", lambda: True)
    assert _app.run([]) != 0
    assert told(capsys).count(OWNED) == 2  # with the traceback


def test_the_log() -> None:
    handler = logging.StreamHandler(io.StringIO())
    handler.setFormatter(_options._Printable("%(message)s"))
    record = logging.LogRecord("actionkit", logging.DEBUG, "", 0, "%s", (HOSTILE,), None)
    assert handler.format(record) == ESCAPED
