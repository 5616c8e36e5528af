"""The steps of `actionkit demo`: each runs what `_demo_code` shows, and checks what came back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from test_msgs.action import Fibonacci

import actionkit
from actionkit import CancelReport, GoalState
from actionkit.cli import _demo_code as code
from actionkit.cli._demo_screen import Said, Screen
from actionkit.servers import Server

_PATIENCE = 5.0
"""Seconds for the server's journal to show what the client knows already."""


class UnexpectedError(Exception):
    """A step did not come out as it should."""


@dataclass(frozen=True)
class Stage:
    """What a step works with."""

    client: code.FibonacciClient
    server: Server
    screen: Screen


@dataclass(frozen=True)
class Step:
    """One thing to show."""

    title: str
    why: str
    shown: Callable[..., object]
    run: Callable[[Stage], None]


def _expect(condition: object, otherwise: str) -> None:
    if not condition:
        raise UnexpectedError(otherwise)


def fibonacci(order: int) -> list[int]:
    """Return the sequence that the server owes for an order."""
    numbers = [0, 1]
    while len(numbers) <= order:
        numbers.append(numbers[-1] + numbers[-2])
    return numbers


def _only_error(said: Said, cls: type[actionkit.ActionKitError]) -> Any:
    errors = [value for value in said.values if isinstance(value, cls)]
    _expect(len(errors) == 1, f"the call did not end in {cls.__name__}")
    return errors[0]


def _blocking(stage: Stage) -> None:
    said = Said(stage.screen, hold=True)
    order = 10
    lengths: list[int] = []
    with stage.screen.progress(order) as show:

        def show_progress(feedback: Fibonacci.Feedback) -> None:
            lengths.append(len(feedback.sequence))
            show(len(feedback.sequence) - 1, f"newest number: {feedback.sequence[-1]}")

        code.blocking(stage.client, said, show_progress)
    said.release()
    _expect(said.values == [fibonacci(order)], f"the result should be {fibonacci(order)}")
    _expect(lengths, "no feedback came")
    _expect(all(a < b for a, b in pairwise(lengths)), f"feedback out of order: {lengths}")


def _concurrently(stage: Stage) -> None:
    said = Said(stage.screen)
    code.concurrently(stage.client, said)
    _expect(said.values == [fibonacci(5), fibonacci(8)], "these are not the two sequences")
    _expect(stage.server.max_running == 2, "the server did not run both at one time")
    stage.screen.note("The server ran both at one time.")


def _cancelled(stage: Stage) -> None:
    said = Said(stage.screen)
    future = code.cancelled(stage.client, said)
    outcome = future.outcome(0)
    _expect(future.cancelled(), "the future is not cancelled")
    _expect(outcome.status is GoalState.CANCELED, f"the goal ended as {outcome.status}")
    _expect(outcome.cancel is CancelReport.CONFIRMED, f"the cancel is {outcome.cancel}")
    _show_journal(stage, str(future.goal_id))


def _rejected(stage: Stage) -> None:
    said = Said(stage.screen)
    code.rejected(stage.client, said)
    error = _only_error(said, actionkit.GoalRejectedError)
    stage.server.wait_for("rejected", goal_id=str(error.goal_id), timeout=_PATIENCE)


def _timed_out(stage: Stage) -> None:
    said = Said(stage.screen)
    code.timed_out(stage.client, said)
    error = _only_error(said, actionkit.DeadlineExceededError)
    _expect(error.cancel is CancelReport.CONFIRMED, f"the cancel is {error.cancel}")
    _show_journal(stage, str(error.goal_id))


def _without_server(stage: Stage) -> None:
    said = Said(stage.screen)
    code.without_server(said)
    error = _only_error(said, actionkit.ServerUnavailableError)
    _expect(f"'{stage.client.action_name}'" in str(error), "the error does not name the near miss")


def _show_journal(stage: Stage, goal_id: str) -> None:
    """Show what the server itself saw of a goal, and that the goal runs no more."""
    stage.server.wait_for("canceled", goal_id=goal_id, timeout=_PATIENCE)
    _expect(goal_id not in stage.server.running(), "the server still runs the goal")
    events = [event for event in stage.server.events if event.goal_id == goal_id]
    wanted = ("accepted", "cancel_requested", "canceled")
    told = [
        f"{event.event.replace('_', ' ')} at {event.monotonic - events[0].monotonic:.2f} s"
        for event in events
        if event.event in wanted
    ]
    stage.screen.note(f"The server's own journal: {', '.join(told)}.")


STEPS = (
    Step(
        "A call that waits, with its progress",
        "The simplest form. The goal has 20 seconds for everything.",
        code.blocking,
        _blocking,
    ),
    Step(
        "Two goals at once, under asyncio",
        "What call_async returns can be awaited, gathered, and waited for in threads.",
        code.concurrently,
        _concurrently,
    ),
    Step(
        "Cancelling a goal",
        "The goal stops on the server, not just here, and the server's word is waited for.",
        code.cancelled,
        _cancelled,
    ),
    Step(
        "A goal that the server rejects",
        "This server takes orders from 0 to 100. A rejection is an error, never an empty result.",
        code.rejected,
        _rejected,
    ),
    Step(
        "A deadline",
        "The goal would take 25 seconds and gets one. It is not left running on the robot.",
        code.timed_out,
        _timed_out,
    ),
    Step(
        "No server",
        "The name has a letter too few: the error looks for what was meant.",
        code.without_server,
        _without_server,
    ),
)
