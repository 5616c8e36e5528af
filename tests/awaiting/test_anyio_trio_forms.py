"""Every way to await a goal under anyio and trio (C1.4)."""

from __future__ import annotations

import asyncio
import concurrent.futures

import anyio
import pytest
import trio
import trio.testing

from actionkit import ClientClosedError
from tests.awaiting.conftest import QUICK, reached
from tests.awaiting.page import ANYIO, TRIO, record

BACKENDS = ("asyncio", "trio")


@pytest.mark.long
@pytest.mark.parametrize("backend", BACKENDS)
def test_anyio_move_on_after(backend, server, client, begun):
    async def main():
        assert len((await client.call_async(QUICK)).sequence) == 2
        with anyio.move_on_after(0.1) as scope:
            await begun
        assert scope.cancelled_caught

    anyio.run(main, backend=backend)
    record(
        ANYIO,
        f"`with anyio.move_on_after(1.0)`, on {backend}",
        "yes",
        reached(server, client, begun),
    )


@pytest.mark.parametrize("backend", BACKENDS)
def test_anyio_task_group(backend, server, client, begun):
    async def wait(future, results):
        results.append(await future)

    async def main():
        results = []
        async with anyio.create_task_group() as group:
            group.start_soon(wait, client.call_async(QUICK), results)
        assert len(results[0].sequence) == 2
        async with anyio.create_task_group() as group:
            group.start_soon(wait, begun, results)
            await anyio.wait_all_tasks_blocked()
            group.cancel_scope.cancel()

    anyio.run(main, backend=backend)
    record(
        ANYIO,
        f"`TaskGroup.cancel_scope.cancel()`, on {backend}",
        "yes",
        reached(server, client, begun),
    )


def test_trio(server, client, begun):
    async def main():
        assert len((await client.call_async(QUICK)).sequence) == 2
        with trio.move_on_after(0.1) as scope:
            await begun
        assert scope.cancelled_caught

    trio.run(main)
    record(TRIO, "`with trio.move_on_after(1.0)`", "yes", reached(server, client, begun))


def test_trio_nursery(server, client, begun):
    async def wait():
        await begun

    async def main():
        async with trio.open_nursery() as nursery:
            nursery.start_soon(wait)
            await trio.testing.wait_all_tasks_blocked()
            nursery.cancel_scope.cancel()

    trio.run(main)
    record(TRIO, "`nursery.cancel_scope.cancel()`", "yes", reached(server, client, begun))


@pytest.mark.long
def test_trio_cancelled_by_others(server, client, begun):
    async def main():
        begun.cancel()
        with pytest.raises(concurrent.futures.CancelledError):
            await begun

    trio.run(main)
    record(TRIO, "`await future`", "yes", reached(server, client, begun))


@pytest.mark.long
def test_trio_waits_for_servers_and_feedback(action_server, make_client):
    client = make_client()

    async def main():
        async with client:
            assert not await client.wait_for_server_async(0)
            action_server("fibonacci", period=0.05)
            assert await client.wait_for_server_async(20)
            seen = [feedback async for feedback in client.call_async({"order": 3}).feedback()]
            assert seen

    trio.run(main)
    with pytest.raises(ClientClosedError):
        client.call(QUICK)


@pytest.mark.long
def test_the_nearest_counts(client):
    """A loop of one kind may run inside a task of the other."""

    async def wait():
        return len((await client.call_async(QUICK)).sequence)

    async def in_trio():
        return asyncio.run(wait())

    async def in_asyncio():
        return trio.run(wait)

    assert trio.run(in_trio) == 2
    assert asyncio.run(in_asyncio()) == 2
