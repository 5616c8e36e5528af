"""Every way to await a goal under asyncio: that it works, and what its end does (C1.4, C1.5)."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import sys
import threading
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

from actionkit import GoalFuture
from tests.awaiting.conftest import LONG, QUICK, reached
from tests.awaiting.page import ASYNCIO, record
from tests.conftest import NEVER

NEW = sys.version_info >= (3, 11)
NEWER = pytest.mark.skipif(not NEW, reason="it is of Python 3.11")
Waits = Callable[[GoalFuture[Any, Any]], Awaitable[Any]]


async def plainly(future):
    return await future


async def in_a_task(future):
    return await asyncio.create_task(future)


async def ensured(future):
    return await asyncio.ensure_future(future)


async def in_a_group(future):
    async with asyncio.TaskGroup() as group:
        task = group.create_task(future)
    return task.result()


async def gathered(future):
    return (await asyncio.gather(future, asyncio.sleep(0)))[0]


async def shielded(future):
    return await asyncio.shield(future)


async def wrapped(future):
    return await asyncio.wrap_future(future)


FORMS = {
    "`await future`": plainly,
    "`await asyncio.create_task(future)`": in_a_task,
    "`await asyncio.ensure_future(future)`": ensured,
    "`TaskGroup.create_task(future)`": in_a_group,
    "`await asyncio.gather(future, other)`": gathered,
    "`await asyncio.shield(future)`": shielded,
    "`await asyncio.wrap_future(future)`": wrapped,
}


async def turns():
    """Let tasks begin, and callbacks run."""
    for _ in range(5):
        await asyncio.sleep(0)


async def cancelled(*tasks: asyncio.Task[Any]) -> None:
    for task in tasks:
        task.cancel()
    for task in tasks:
        with pytest.raises(asyncio.CancelledError):
            await task


@pytest.mark.parametrize("code", FORMS)
def test_form(code, server, client, begun):
    if not NEW and "TaskGroup" in code:
        pytest.skip("it is of Python 3.11")
    form = FORMS[code]

    async def main():
        assert len((await form(client.call_async(QUICK))).sequence) == 2
        task = asyncio.ensure_future(form(begun))
        await turns()
        await cancelled(task)
        return reached(server, client, begun)

    seen = asyncio.run(main())
    if form is wrapped:  # it is told at once that it is cancelled; the goal may be faster
        seen = seen.partition(",")[0]
    record(ASYNCIO, code, "yes", seen)


def test_uvloop(server, client, begun):
    uvloop = pytest.importorskip("uvloop", reason="uvloop is not installed")

    async def main():
        assert len((await client.call_async(QUICK)).sequence) == 2
        task = asyncio.create_task(begun)
        await turns()
        await cancelled(task)

    loop = uvloop.new_event_loop()
    loop.run_until_complete(main())
    loop.close()
    record(ASYNCIO, "`await future`, with uvloop", "yes", reached(server, client, begun))


def test_asyncio_run_takes_it(server, client):
    assert len(asyncio.run(client.call_async(QUICK)).sequence) == 2
    futures = []
    waits = f"/proc/self/task/{os.getpid()}/wchan"  # where Linux keeps the main thread

    def interrupt():
        server.wait_for("executing", goal_id=str(futures[0].goal_id))
        for _ in range(1000):
            # So `asyncio.run` is ready for Ctrl-C. Right before `epoll`, Python would not see it.
            if futures[0]._awaiters._waiting and "epoll" in Path(waits).read_text():
                break
            NEVER.wait(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    futures.append(client.call_async(LONG))
    threading.Thread(target=interrupt).start()
    with pytest.raises(KeyboardInterrupt):
        asyncio.run(futures[0])
    seen = reached(server, client, futures[0])
    record(ASYNCIO, "`asyncio.run(client.call_async(goal))`, Ctrl-C", "yes", seen)


def test_run_until_complete_takes_it(client):
    loop = asyncio.new_event_loop()
    assert len(loop.run_until_complete(client.call_async(QUICK)).sequence) == 2
    loop.close()
    record(ASYNCIO, "`loop.run_until_complete(future)`", "yes", "-")


@pytest.mark.long
def test_wait_for(server, client, begun):
    async def main():
        assert len((await asyncio.wait_for(client.call_async(QUICK), 20)).sequence) == 2
        with pytest.raises(asyncio.TimeoutError):
            await asyncio.wait_for(begun, 0.1)

    asyncio.run(main())
    code = "`await asyncio.wait_for(future, 1.0)`"
    record(ASYNCIO, code, "yes", reached(server, client, begun))


@NEWER
def test_timeout(server, client, begun):
    async def main():
        async with asyncio.timeout(20):
            assert len((await client.call_async(QUICK)).sequence) == 2
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.1):
                await begun

    asyncio.run(main())
    code = "`async with asyncio.timeout(1.0)`"
    record(ASYNCIO, code, "yes", reached(server, client, begun))


def test_run_coroutine_threadsafe(server, client, begun):
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever)
    thread.start()
    quick = asyncio.run_coroutine_threadsafe(client.call_async(QUICK), loop)
    assert len(quick.result(20).sequence) == 2
    long = asyncio.run_coroutine_threadsafe(begun, loop)
    asyncio.run_coroutine_threadsafe(turns(), loop).result(20)
    long.cancel()
    begun.outcome(20)  # the loop's thread is told of it, and takes its time
    code = "`asyncio.run_coroutine_threadsafe(future, loop)`"
    seen = reached(server, client, begun)
    loop.call_soon_threadsafe(loop.stop)
    thread.join()
    loop.close()
    record(ASYNCIO, code, "yes", seen.partition(",")[0])


@pytest.mark.long
def test_before_the_first_step(server, client, begun):
    async def main():
        await cancelled(asyncio.create_task(begun))

    asyncio.run(main())
    code = "`asyncio.create_task(future)`, cancelled before its first step"
    record(ASYNCIO, code, "yes", reached(server, client, begun))


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("begin", [True, False])
def test_two_tasks(server, client, begun, begin, first):
    """The second is cancelled when the first was, and the goal with it."""

    async def main():
        tasks = [asyncio.create_task(begun if not begin else plainly(begun)) for _ in range(2)]
        if begin:
            await turns()
        await cancelled(tasks[first])
        await turns()
        assert not any(event.state.name == "CANCELING" for event in begun.timeline)
        assert not tasks[1 - first].done()
        await cancelled(tasks[1 - first])

    asyncio.run(main())
    seen = reached(server, client, begun)
    if begin:
        record(ASYNCIO, "the last of two tasks that await one future", "yes", seen)


@pytest.mark.parametrize("begin", [True, False])
def test_one_of_two_tasks(server, client, begun, begin):
    async def main():
        tasks = [asyncio.create_task(begun) for _ in range(2)]
        if begin:
            await turns()
        await cancelled(tasks[0])
        seen = reached(server, client, begun)  # which cancels it at last
        with pytest.raises(asyncio.CancelledError):
            await tasks[1]
        return seen

    code = "one of two `asyncio.create_task(future)`, before its first step"
    if begin:
        code = "one of two tasks that await one future"
    record(ASYNCIO, code, "yes", asyncio.run(main()))


def test_one_future_for_many_tasks_that_succeed(client):
    async def main():
        future = client.call_async(QUICK)
        return await asyncio.gather(*(asyncio.create_task(future) for _ in range(5)), future)

    results = asyncio.run(main())
    assert len(results) == 6
    assert all(result is results[0] for result in results)


def test_cancelled_by_others(server, client, begun):
    async def main():
        asyncio.get_running_loop().call_soon(begun.cancel)
        with pytest.raises(asyncio.CancelledError):
            await begun

    asyncio.run(main())
    code = "`future.cancel()` elsewhere: `CancelledError`"
    record(ASYNCIO, code, "yes", reached(server, client, begun))


@NEWER
def test_asyncio_wait_refuses_it(server, client, begun):
    async def main():
        with pytest.raises(TypeError):
            await asyncio.wait([begun])

    asyncio.run(main())
    record(
        ASYNCIO,
        "`asyncio.wait([future])`",
        "no: `TypeError`, as of a coroutine",
        reached(server, client, begun),
    )


def test_asyncio_run_where_a_loop_runs(server, client, begun):
    async def main():
        with pytest.raises(RuntimeError, match="running event loop"):
            asyncio.run(begun)

    asyncio.run(main())
    record(
        ASYNCIO,
        "`asyncio.run(client.call_async(goal))` where a loop runs",
        "no: `RuntimeError`",
        reached(server, client, begun),
    )


@pytest.mark.parametrize("ensure", [True, False])
def test_a_closed_loop(server, client, begun, ensure):
    loop = asyncio.new_event_loop()
    loop.close()
    with pytest.raises(RuntimeError, match="closed"):
        asyncio.ensure_future(begun, loop=loop) if ensure else loop.create_task(begun)
    code = "`loop.create_task(future)`, closed loop"
    if ensure:
        code = "`asyncio.ensure_future(future, loop=loop)`, closed loop"
    record(ASYNCIO, code, "no: `RuntimeError`", reached(server, client, begun))


@NEWER
def test_a_group_that_shuts_down(server, client, begun):
    async def main():
        async with asyncio.TaskGroup() as group:

            async def fail():
                raise ValueError("for the test")

            group.create_task(fail())
            with contextlib.suppress(asyncio.CancelledError):  # by the group
                await asyncio.get_running_loop().create_future()
            group.create_task(begun)

    with pytest.raises(BaseException, match="unhandled errors") as caught:
        asyncio.run(main())
    assert "shutting down" in str(caught.value.exceptions)
    seen = reached(server, client, begun)
    if sys.version_info >= (3, 13):
        assert seen == "cancelled"
        return
    code = "`TaskGroup.create_task(future)` while the group shuts down, before Python 3.13"
    record(ASYNCIO, code, "no: `RuntimeError`", seen)


@pytest.mark.long
def test_a_loop_that_is_closed_under_a_waiting_task(server, client, begun):
    loop = asyncio.new_event_loop()
    task = loop.create_task(begun)
    loop.run_until_complete(turns())
    loop.close()
    task._log_destroy_pending = False  # dropped on purpose
    record(ASYNCIO, "the loop is closed while a task waits", "no", reached(server, client, begun))


@pytest.mark.long
def test_a_second_cancellation_ends_the_wait_for_the_confirmation(action_server, make_client):
    server = action_server("ignores_cancel")
    client = make_client()
    begun = client.call_async(LONG)
    server.wait_for("executing")

    async def main():
        task = asyncio.create_task(begun)
        await turns()
        task.cancel()
        await turns()
        assert not task.done()
        await cancelled(task)
        assert not begun.done()

    asyncio.run(main())
    server.wait_for("cancel_requested", goal_id=str(begun.goal_id))
