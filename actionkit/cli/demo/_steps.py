"""The steps of `actionkit demo`: the code that each shows and runs, and the check of its result.

The demo shows each function without an underscore as a user would write it: its docstring is the
title and the explanation; then follows its body without the final `return`. `print` prints to the
demo's screen.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import CancelledError
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, TypeVar

from test_msgs.action import Fibonacci

from actionkit import (
    ActionKitError,
    CancelReport,
    Client,
    DeadlineExceededError,
    GoalFuture,
    GoalRejectedError,
    GoalState,
    ServerUnavailableError,
    Timeouts,
)
from actionkit.cli.demo._screen import DemoScreen
from actionkit.servers import Server

FibonacciClient = Client[Fibonacci]
Print = Callable[..., None]
_E = TypeVar("_E", bound=ActionKitError)


class UnexpectedError(Exception):
    """A step's result was not as expected."""


@dataclass
class Demo:
    """What the steps work with. `lengths` has the length of each feedback shown as progress."""

    client: FibonacciClient  # of all steps but the last
    server: Server  # the one that the client calls
    screen: DemoScreen
    printed: list[Any] = field(default_factory=list)  # by the code of the current step
    lengths: list[int] = field(default_factory=list)

    def print(self, *values: Any) -> None:
        """Show and keep what the code of a step prints."""
        self.printed.extend(values)
        self.screen.said(" ".join(str(value) for value in values))

    def show_progress(self, feedback: Fibonacci.Feedback) -> None:
        """Show how far the goal of order 10 is."""
        self.lengths.append(len(feedback.sequence))
        words = f"newest number: {feedback.sequence[-1]}"
        self.screen.progress(len(feedback.sequence) - 1, 10, words)

    def error(self, kind: type[_E]) -> _E:
        """Return the one printed error of that kind."""
        errors = [value for value in self.printed if isinstance(value, kind)]
        _expect(len(errors) == 1, f"the call did not end in {kind.__name__}")
        return errors[0]

    def expect_stopped(self, goal_id: str) -> None:
        """Show what the server itself saw of a goal, and check that the goal has stopped."""
        self.server.wait_for("canceled", goal_id=goal_id)
        _expect(goal_id not in self.server.running(), "the server still runs the goal")
        events = [event for event in self.server.events if event.goal_id == goal_id]
        shown = ", ".join(
            f"{event.event.replace('_', ' ')} at {event.monotonic - events[0].monotonic:.2f} s"
            for event in events
            if event.event in ("accepted", "cancel_requested", "canceled")
        )
        self.screen.note(f"The server's own journal: {shown}.")


def _expect(condition: object, otherwise: str) -> None:
    if not condition:
        raise UnexpectedError(otherwise)


def connect() -> FibonacciClient:
    """Make the client of all the steps."""
    from test_msgs.action import Fibonacci

    from actionkit import Client

    client = Client(Fibonacci, "fibonacci")
    return client  # noqa: RET504


def blocking(
    client: FibonacciClient, print: Print, show_progress: Callable[[Fibonacci.Feedback], None]
) -> None:
    """A call that waits, with its progress

    The simplest form. The goal has 20 seconds for everything.
    """
    goal = Fibonacci.Goal(order=10)
    result = client.call(goal, timeout=20.0, on_feedback=show_progress)
    print(list(result.sequence))


def _blocking(demo: Demo) -> None:
    blocking(demo.client, demo.print, demo.show_progress)
    _expect(demo.printed == [_fibonacci(10)], f"the result should be {_fibonacci(10)}")
    _expect(demo.lengths, "no feedback came")
    in_order = all(a < b for a, b in pairwise(demo.lengths))
    _expect(in_order, f"feedback out of order: {demo.lengths}")


def concurrently(client: FibonacciClient, print: Print) -> None:
    """Two goals at once, under asyncio

    What call_async returns can be awaited, gathered, and waited for in threads.
    """

    async def main() -> None:
        short, long = await asyncio.gather(
            client.call_async(Fibonacci.Goal(order=5), timeout=20.0),
            client.call_async(Fibonacci.Goal(order=8), timeout=20.0),
        )
        print(list(short.sequence))
        print(list(long.sequence))

    asyncio.run(main())


def _concurrently(demo: Demo) -> None:
    concurrently(demo.client, demo.print)
    _expect(demo.printed == [_fibonacci(5), _fibonacci(8)], "these are not the two sequences")
    _expect(demo.server.max_running == 2, "the server did not run both at one time")
    demo.screen.note("The server ran both at one time.")


def cancelled(
    client: FibonacciClient, print: Print
) -> GoalFuture[Fibonacci.Result, Fibonacci.Feedback]:
    """Cancelling a goal

    The goal stops on the server, not just here, and the server's word is waited for.
    """
    future = client.call_async(Fibonacci.Goal(order=50), timeout=20.0)
    for feedback in future.feedback():
        print("feedback:", list(feedback.sequence))
        if len(feedback.sequence) > 4:
            future.cancel()
    try:
        future.result()
    except CancelledError:
        print("server confirms:", future.outcome().status)
    return future


def _cancelled(demo: Demo) -> None:
    future = cancelled(demo.client, demo.print)
    outcome = future.outcome(0)
    _expect(future.cancelled(), "the future is not cancelled")
    _expect(outcome.status is GoalState.CANCELED, f"the goal ended as {outcome.status}")
    _expect(outcome.cancel is CancelReport.CONFIRMED, f"the cancel is {outcome.cancel}")
    demo.expect_stopped(str(future.goal_id))


def rejected(client: FibonacciClient, print: Print) -> None:
    """A goal that the server rejects

    This server takes orders from 0 to 100. A rejection is an error, never an empty result.
    """
    try:
        client.call(Fibonacci.Goal(order=-1), timeout=20.0)
    except GoalRejectedError as error:
        print(error)


def _rejected(demo: Demo) -> None:
    rejected(demo.client, demo.print)
    goal_id = demo.error(GoalRejectedError).goal_id
    demo.server.wait_for("rejected", goal_id=str(goal_id))


def timed_out(client: FibonacciClient, print: Print) -> None:
    """A deadline

    The goal would take 25 seconds and gets one. It is not left running on the robot.
    """
    try:
        client.call(Fibonacci.Goal(order=100), timeout=1.0)
    except DeadlineExceededError as error:
        print(error)
        print("cancel:", error.cancel)


def _timed_out(demo: Demo) -> None:
    timed_out(demo.client, demo.print)
    error = demo.error(DeadlineExceededError)
    _expect(error.cancel is CancelReport.CONFIRMED, f"the cancel is {error.cancel}")
    demo.expect_stopped(str(error.goal_id))


def without_server(print: Print) -> None:
    """No server

    The name has a letter too few: the error looks for what was meant.
    """
    with Client(Fibonacci, "fibonaci", timeouts=Timeouts(server=1.0)) as typo:
        try:
            typo.call(Fibonacci.Goal(order=5))
        except ServerUnavailableError as error:
            print(error)


def _without_server(demo: Demo) -> None:
    without_server(demo.print)
    near = f"'{demo.client.action_name}'" in str(demo.error(ServerUnavailableError))
    _expect(near, "the error does not name the near miss")


def _fibonacci(order: int) -> list[int]:
    """Return the correct result for an order."""
    numbers = [0, 1]
    while len(numbers) <= order:
        numbers.append(numbers[-1] + numbers[-2])
    return numbers


STEPS: tuple[tuple[Callable[..., object], Callable[[Demo], None]], ...] = (
    (blocking, _blocking),
    (concurrently, _concurrently),
    (cancelled, _cancelled),
    (rejected, _rejected),
    (timed_out, _timed_out),
    (without_server, _without_server),
)
"""For each step: the code to show, and the function that runs and checks it."""
