"""What docs/awaiting.md says around its tables, and which rows there have to be."""

from __future__ import annotations

from tests.awaiting.table import Form

ASYNCIO = "asyncio"
ANYIO = "anyio"
TRIO = "trio"
RCLPY = "Coroutines of rclpy"
NOWHERE = "Anything else"

INTRO = """
# Awaiting a goal

This page is written by the tests in `tests/awaiting/`, which do what it tells of with real
servers, and fail where it is no longer so (`ACTIONKIT_WRITE_AWAITING=1 pytest -n 0
tests/awaiting` writes the tables anew).

`client.call_async(goal)` sends the goal at once and returns a `GoalFuture`, here called `future`.
That can be awaited wherever coroutines run: under asyncio, under trio, and in callbacks of rclpy.
The wait does not poll and blocks nothing. So can `client.wait_for_server_async()`, `async for`
over `future.feedback()`, and the end of `async with client`.

Cancelling what waits cancels the goal on the server. Where the task can go on to wait, it does so
until the server has confirmed that, for `Timeouts.cancel` seconds at most. Where several
coroutines await one future, it is the last of them that cancels the goal.
"""

SECTIONS = {
    ASYNCIO: """
Also with uvloop. asyncio takes the future for a coroutine, so it can be given to whatever makes a
task of one. Cancelling the task a second time ends the wait for the confirmation; the goal is
cancelled all the same.

Where asyncio refuses to make a task, a coroutine would not have begun, but the goal was sent.
Where asyncio closes what it refuses, the goal is cancelled; where it just raises, the goal goes
on: keep the future in a variable, and `cancel()` it. From Python 3.13 on task groups close what
they refuse, so there the goal is cancelled.""",
    ANYIO: """
With either of its backends. Its cancel scopes cancel a task again and again; the wait for the
confirmation is shielded from them.""",
    TRIO: "A goal that somebody else cancelled raises `concurrent.futures.CancelledError` here.",
    RCLPY: """
With rclpy's `SingleThreadedExecutor`, `MultiThreadedExecutor`, `rclpy.spin` and `spin_once`. The
executor is woken when the goal ends. As with every `await` in rclpy, a callback that waits keeps
its callback group busy: give it a `ReentrantCallbackGroup`, or a group of its own, and the node's
other callbacks go on meanwhile. A goal that somebody else cancelled raises
`concurrent.futures.CancelledError` here.

An executor that is shut down tells its coroutines nothing, and never goes on with them. This is
looked for once a second, and the goals that they await are cancelled. When only its node is
destroyed, or nobody spins it for a while, rclpy keeps a coroutine to go on with it later, so the
goal goes on.""",
    NOWHERE: "The error is raised by the `await`.",
}


def _forms(section: str, *codes: str) -> list[Form]:
    return [Form(section, code) for code in codes]


FORMS = [
    *_forms(
        ASYNCIO,
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
    ),
    *_forms(
        ANYIO,
        "`with anyio.move_on_after(1.0)`, on asyncio",
        "`TaskGroup.cancel_scope.cancel()`, on asyncio",
        "`with anyio.move_on_after(1.0)`, on trio",
        "`TaskGroup.cancel_scope.cancel()`, on trio",
    ),
    *_forms(
        TRIO,
        "`await future`",
        "`with trio.move_on_after(1.0)`",
        "`nursery.cancel_scope.cancel()`",
    ),
    *_forms(
        RCLPY,
        "`await future` in a timer's callback",
        "`await future` in a subscription's callback",
        "`await future` in a service's callback",
        "`await future` in `execute_callback`",
        "`executor.create_task(coroutine)`, `task.cancel()`",
        "`executor.shutdown()` while a callback waits",
        "`rclpy.shutdown()` while a callback waits",
        "the executor is dropped while a callback waits",
        "`node.destroy_node()` while a callback waits",
    ),
    *_forms(NOWHERE, "`future.send(None)` by hand, without a loop", "a coroutine driven by hand"),
]

CLOSING = """
## What waiting costs under rclpy

Up to version 7.1.8 an executor of rclpy runs each coroutine that waits again whenever anything
wakes it, and the `MultiThreadedExecutor` keeps a note of each time until the coroutine has ended.
With a plain rclpy future, ten coroutines that waited beside a timer of 100 Hz took a whole core
after a few seconds. ActionKit takes a coroutine that awaits a goal out of the executor's list
until the goal has ended, so waiting costs nothing there, however busy the executor is; and one
look a second at each executor whose coroutines wait, some microseconds.

## Blocking on an event loop

`client.call()` and `client.wait_for_server()` block their thread. On a thread where an event loop
of asyncio runs this holds up all its tasks, so the first such call in a process gives a
`RuntimeWarning` that names the line.
"""
