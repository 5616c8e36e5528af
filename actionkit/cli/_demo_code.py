"""What `actionkit demo` runs, and shows: the body of each function, as a user would write it.

The last line of a function, its `return`, is for the demo alone and not shown. `print` prints
into the demo's display.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import CancelledError

from test_msgs.action import Fibonacci

from actionkit import (
    Client,
    DeadlineExceededError,
    GoalFuture,
    GoalRejectedError,
    ServerUnavailableError,
    Timeouts,
)

FibonacciClient = Client[Fibonacci.Goal, Fibonacci.Result, Fibonacci.Feedback]
Print = Callable[..., None]


def connect() -> FibonacciClient:
    """Make the client of all the steps."""
    from test_msgs.action import Fibonacci

    from actionkit import Client

    client = Client(Fibonacci, "fibonacci")
    return client  # noqa: RET504


def blocking(
    client: FibonacciClient, print: Print, show_progress: Callable[[Fibonacci.Feedback], None]
) -> None:
    """Call and wait."""
    goal = Fibonacci.Goal(order=10)
    result = client.call(goal, timeout=20.0, on_feedback=show_progress)
    print(list(result.sequence))


def concurrently(client: FibonacciClient, print: Print) -> None:
    """Call twice at once."""

    async def main() -> None:
        short, long = await asyncio.gather(
            client.call_async(Fibonacci.Goal(order=5), timeout=20.0),
            client.call_async(Fibonacci.Goal(order=8), timeout=20.0),
        )
        print(list(short.sequence))
        print(list(long.sequence))

    asyncio.run(main())


def cancelled(
    client: FibonacciClient, print: Print
) -> GoalFuture[Fibonacci.Result, Fibonacci.Feedback]:
    """Cancel a goal that runs."""
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


def rejected(client: FibonacciClient, print: Print) -> None:
    """Ask for what the server refuses."""
    try:
        client.call(Fibonacci.Goal(order=-1), timeout=20.0)
    except GoalRejectedError as error:
        print(error)


def timed_out(client: FibonacciClient, print: Print) -> None:
    """Give a goal less time than it needs."""
    try:
        client.call(Fibonacci.Goal(order=100), timeout=1.0)
    except DeadlineExceededError as error:
        print(error)
        print("cancel:", error.cancel)


def without_server(print: Print) -> None:
    """Call a server that is not there."""
    with Client(Fibonacci, "fibonaci", timeouts=Timeouts(server=1.0)) as typo:
        try:
            typo.call(Fibonacci.Goal(order=5))
        except ServerUnavailableError as error:
            print(error)
