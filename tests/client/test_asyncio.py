"""Awaiting calls wakes without polling; a cancelled task cancels its goal (C1.4, C1.5)."""

from __future__ import annotations

import asyncio
import sys
import threading
import time

import pytest

import actionkit as ak
from actionkit import CancelReport, Client, Timeouts
from actionkit._threads.diagnostics import flush
from tests.conftest import runs_nothing
from tests.waiting import until


def test_gather(action_server, make_client):
    action_server("fibonacci")
    client = make_client()

    async def main():
        return await asyncio.gather(*(client.call_async({"order": n}) for n in range(1, 6)))

    assert [len(r.sequence) for r in asyncio.run(main())] == [2, 3, 4, 5, 6]


def test_async_with_closes_without_blocking_the_loop(action_server, ros_domain):
    from test_msgs.action import Fibonacci

    server = action_server("never_finishes")

    async def main():
        async with Client(Fibonacci, "fibonacci") as client:
            future = client.call_async({"order": 1})
            async for _ in future.feedback():
                break
        return future

    future = asyncio.run(main())
    assert future.done()
    assert future.outcome().cancel is CancelReport.CONFIRMED
    assert runs_nothing(server)


def test_cancelling_the_task_cancels_the_goal(action_server, make_client):
    server = action_server("never_finishes")
    client = make_client()

    async def main():
        future = client.call_async({"order": 1})
        task = asyncio.ensure_future(future)
        async for _ in future.feedback():
            break
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        return future

    future = asyncio.run(main())
    assert future.outcome(0).cancel is CancelReport.CONFIRMED
    assert runs_nothing(server)
    assert len(server.wait_for("canceled")) == 1


@pytest.mark.long
def test_the_wait_for_confirmation_is_bounded(action_server, make_client):
    server = action_server("slow_cancel", gate=1)
    client = make_client(timeouts=Timeouts(cancel=0.3))

    async def main():
        future = client.call_async({"order": 1})
        task = asyncio.ensure_future(future)
        while server.count("executing") == 0:
            await asyncio.to_thread(server.wait_for, "executing")
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await asyncio.wait_for(task, 5)
        return future

    future = asyncio.run(main())
    assert future.outcome(5).cancel is CancelReport.UNKNOWN
    server.wait_for("cancel_accepted")


@pytest.mark.parametrize(
    ("name", "options", "why", "turns"),
    [
        ("refuses_cancel", {"period": 0.2}, "the server refused to cancel it", ()),
        ("slow_cancel", {"gate": 1}, "the server has not said that it ended", ()),
        # It is cancelled again in the next turn of the loop.
        ("slow_cancel", {"gate": 1}, "the server has not", (0,)),
    ],
)
def test_a_cancelled_task_is_told_at_once_what_may_still_run(
    name, options, why, turns, action_server, make_client, caplog, monkeypatch
):
    monkeypatch.setattr("actionkit._calls.futures.goals_left._muted", False)
    server = action_server(name, **options)
    client = make_client(timeouts=Timeouts(cancel=1.0))

    async def main():
        future = client.call_async({"order": 40})

        async def mission():
            try:
                await future
            except asyncio.CancelledError as error:
                told.append(error)
                raise

        task = asyncio.create_task(mission())
        await asyncio.to_thread(server.wait_for, "executing")
        task.cancel("the battery is low")
        for turn in turns:
            await asyncio.sleep(turn)
            task.cancel("the battery is low")
        await asyncio.wait([task])
        return future

    told = []
    future = asyncio.run(main())
    (error,) = told
    news = f"Goal {future.goal_id} of this call MAY STILL BE RUNNING: {why}"
    first, text = error.args
    assert first == "the battery is low"
    assert text.startswith(f"the call of action '/fibonacci' was interrupted. {news}")
    if sys.version_info >= (3, 11):
        (note,) = error.__notes__
        assert f"`actionkit cancel /fibonacci {future.goal_id}`" in note

    def warned():
        ours = [record for record in caplog.records if record.name == "actionkit"]
        return [record for record in ours if "MAY STILL" in record.message]

    until(warned)
    client.close()  # it need not warn again
    flush(time.monotonic() + 10)
    (warning,) = warned()
    assert warning.levelname == "WARNING"
    assert news in warning.message


@pytest.mark.long
@pytest.mark.skipif(sys.version_info < (3, 11), reason="asyncio.timeout is of Python 3.11")
def test_asyncio_timeout(action_server, make_client):
    server = action_server("never_finishes")
    client = make_client()
    assert client.wait_for_server(10)  # so that the short time is not spent on discovery

    async def main():
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.3):
                await client.call_async({"order": 1})

    asyncio.run(main())
    assert runs_nothing(server)
    assert len(server.wait_for("canceled")) == 1


@pytest.mark.long
def test_wait_for(action_server, make_client):
    server = action_server("never_finishes")
    client = make_client()
    assert client.wait_for_server(10)

    async def main():
        with pytest.raises(asyncio.TimeoutError):
            await asyncio.wait_for(client.call_async({"order": 1}), 0.3)

    asyncio.run(main())
    assert runs_nothing(server)


def test_a_cancelled_future_cancels_who_awaits_it(action_server, make_client):
    action_server("never_finishes")
    client = make_client()

    async def main():
        future = client.call_async({"order": 1})
        asyncio.get_running_loop().call_later(0.1, future.cancel)
        with pytest.raises(asyncio.CancelledError):
            await future

    asyncio.run(main())


@pytest.mark.long
def test_errors_reach_who_awaits(action_server, make_client):
    action_server("fibonacci")
    client = make_client()

    async def main():
        return await asyncio.gather(
            client.call_async({"order": -1}),
            client.call_async({"order": "x"}),
            client.call_async({"order": 2}),
            return_exceptions=True,
        )

    rejected, invalid, good = asyncio.run(main())
    assert isinstance(rejected, ak.GoalRejectedError)
    assert isinstance(invalid, ak.InvalidGoalError)
    assert list(good.sequence) == [0, 1, 1]


def test_two_loops_in_two_threads_await_one_future(action_server, make_client):
    server = action_server("fibonacci", gate=1)
    future = make_client().call_async({"order": 4})
    results = []

    async def main():
        results.append(await future)

    threads = [threading.Thread(target=asyncio.run, args=(main(),)) for _ in range(2)]
    for thread in threads:
        thread.start()
    server.wait_for("executing")
    server.release()
    for thread in threads:
        thread.join(10)
    assert len(results) == 2
    assert results[0] == results[1]


@pytest.mark.long
def test_uvloop(action_server, make_client):
    uvloop = pytest.importorskip("uvloop", reason="uvloop is not installed")
    action_server("fibonacci")
    client = make_client()

    async def main():
        return await asyncio.gather(*(client.call_async({"order": n}) for n in (1, 2)))

    loop = uvloop.new_event_loop()
    assert len(loop.run_until_complete(main())) == 2
    loop.close()


def test_a_closed_loop_harms_nobody(action_server, make_client):
    server = action_server("fibonacci", gate=1)
    client = make_client()
    loop = asyncio.new_event_loop()

    async def begin():
        future = client.call_async({"order": 2})
        task = asyncio.ensure_future(future)
        await asyncio.wait([task], timeout=0.05)
        return future, task

    future, task = loop.run_until_complete(begin())
    task._log_destroy_pending = False  # dropped on purpose
    loop.close()
    server.wait_for("executing")
    server.release()
    assert future.result(10)
    assert client.call({"order": 1}, 10)
    del task


WAITING = """
import asyncio, time
from actionkit import Client
from test_msgs.action import Fibonacci

async def main():
    async with Client(Fibonacci, "fibonacci") as client:
        await client.call_async({"order": 1})
        before, began = time.process_time(), time.monotonic()
        await client.call_async({"order": 30})
        print((time.process_time() - before) / (time.monotonic() - began))

asyncio.run(main())
"""


def test_an_awaiting_process_burns_no_cpu(action_server, run_script):
    action_server("fibonacci", period=0.1)  # a goal of 3 seconds, with 30 feedbacks
    code, out, err = run_script(WAITING).finish()
    assert code == 0, err
    assert float(out) < 0.02


def test_calling_never_blocks_the_loop(action_server, make_client):
    client = make_client(timeouts=Timeouts(server=None))

    async def main():
        began = time.monotonic()
        futures = [client.call_async({"order": 1}) for _ in range(100)]
        spent = time.monotonic() - began
        for future in futures:
            future.cancel()
        await asyncio.gather(*futures, return_exceptions=True)
        return spent

    # There is no server: a wait for discovery would take its time a hundred times over.
    assert asyncio.run(main()) < 2.0
