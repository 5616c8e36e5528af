"""The tables of docs/awaiting.md: the required rows, and how a test records a row."""

from __future__ import annotations

from tests.tables import Page

ASYNCIO = "asyncio"
ANYIO = "anyio"
TRIO = "trio"
RCLPY = "Coroutines of rclpy"
NOWHERE = "Anything else"

FORMS = {
    ASYNCIO: [
        "`await future`",
        "`await future`, with uvloop",
        "`asyncio.run(client.call_async(goal))`, Ctrl-C",
        "`loop.run_until_complete(future)`",
        "`await asyncio.create_task(future)`",
        "`await asyncio.ensure_future(future)`",
        "`TaskGroup.create_task(future)`",
        "`await asyncio.gather(future, other)`",
        "`await asyncio.wait_for(future, 1.0)`",
        "`async with asyncio.timeout(1.0)`",
        "`await asyncio.shield(future)`",
        "`await asyncio.wrap_future(future)`",
        "`asyncio.run_coroutine_threadsafe(future, loop)`",
        "`asyncio.create_task(future)`, cancelled before its first step",
        "one of two tasks that await one future",
        "the last of two tasks that await one future",
        "one of two `asyncio.create_task(future)`, before its first step",
        "`future.cancel()` elsewhere: `CancelledError`",
        "`asyncio.wait([future])`",
        "`asyncio.run(client.call_async(goal))` where a loop runs",
        "`loop.create_task(future)`, closed loop",
        "`asyncio.ensure_future(future, loop=loop)`, closed loop",
        "`TaskGroup.create_task(future)` while the group shuts down, before Python 3.13",
        "the loop is closed while a task waits",
    ],
    ANYIO: [
        "`with anyio.move_on_after(1.0)`, on asyncio",
        "`TaskGroup.cancel_scope.cancel()`, on asyncio",
        "`with anyio.move_on_after(1.0)`, on trio",
        "`TaskGroup.cancel_scope.cancel()`, on trio",
    ],
    TRIO: [
        "`await future`",
        "`with trio.move_on_after(1.0)`",
        "`nursery.cancel_scope.cancel()`",
    ],
    RCLPY: [
        "`await future` in a timer's callback",
        "`await future` in a subscription's callback",
        "`await future` in a service's callback",
        "`await future` in `execute_callback`",
        "`executor.create_task(coroutine)`, `task.cancel()`",
        "`executor.shutdown()` while a callback waits",
        "`rclpy.shutdown()` while a callback waits",
        "the executor is dropped while a callback waits",
        "`node.destroy_node()` while a callback waits",
    ],
    NOWHERE: ["`future.send(None)` by hand, without a loop", "a coroutine driven by hand"],
}

PAGE = Page(
    "awaiting.md", {section: [(code,) for code in codes] for section, codes in FORMS.items()}
)


def record(section: str, code: str, works: str, reached: str) -> None:
    """Compare a row with the page.

    Args:
        section: How the goal was awaited: by what.
        code: By which code.
        works: "yes", or the error.
        reached: What reached the server when the wait was cancelled or refused.
    """
    PAGE.record(section, {(code,): (works, reached)})
