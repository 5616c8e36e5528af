"""Errors, warnings and logs about awaiting (C1.3, C1.4)."""

from __future__ import annotations

import asyncio
import gc
import logging
import warnings

import pytest

from actionkit import ClientClosedError, GoalAbortedError, Timeouts
from actionkit._calls.awaiting import blocking_guards as blocking
from tests.awaiting.conftest import LONG, QUICK
from tests.conftest import all_is_logged


@pytest.mark.parametrize("number", [5.0, 5, 0])
def test_a_number_in_place_of_the_callback_is_told_apart(client, number):
    with pytest.raises(TypeError, match=f"write timeout={number!r}"):
        client.call_async(QUICK, number)


def test_only_its_call_ends_a_future(client, begun):
    for method, arguments in (
        (begun.set_result, (1,)),
        (begun.set_exception, (ValueError(),)),
        (begun.set_running_or_notify_cancel, ()),
    ):
        with pytest.raises(RuntimeError, match="cancel"):
            method(*arguments)
    assert not begun.done()


def blocks(client):
    client.wait_for_server(1)  # the line that is named
    client.call(QUICK)


def test_blocking_an_event_loop_is_warned_of_once(client, monkeypatch):
    monkeypatch.setattr(blocking, "_warned", [])

    async def main():
        blocks(client)
        blocks(client)

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        blocks(client)  # no loop is running here
        assert caught == []
        asyncio.run(main())
    assert [warning.category for warning in caught] == [RuntimeWarning]
    assert "await client.wait_for_server_async()" in str(caught[0].message)
    assert caught[0].filename == __file__
    assert caught[0].lineno == blocks.__code__.co_firstlineno + 1


@pytest.fixture
def never_asked(caplog):
    def texts():
        gc.collect()
        assert all_is_logged()
        return [r.getMessage() for r in caplog.records if "nobody asked" in r.getMessage()]

    texts()  # of futures of earlier tests
    caplog.clear()
    caplog.set_level(logging.ERROR, "actionkit")
    return texts


def ended(client):
    return client.call_async(QUICK).outcome(20)


@pytest.mark.long
def test_a_failure_that_nobody_looked_at_is_logged(action_server, make_client, never_asked):
    server = action_server("aborts")
    client = make_client()
    future = client.call_async(QUICK)
    with pytest.raises(GoalAbortedError):
        future.result(20)
    del future
    client.call_async(QUICK).add_done_callback(lambda _: None)
    server.wait_for("aborted", count=2)
    ended(client)
    assert never_asked() == []
    client.call_async(QUICK)
    server.wait_for("aborted", count=4)
    ended(client)
    assert len(texts := never_asked()) == 1
    assert "aborted" in texts[0]


def test_what_the_user_ended_is_no_failure(server, client, never_asked):
    goals = [str(client.call_async(LONG).goal_id) for _ in range(2)]
    for goal in goals:
        server.wait_for("executing", goal_id=goal)
    client.cancel_all()
    for goal in goals:
        server.wait_for("canceled", goal_id=goal)
    last = str(client.call_async(LONG).goal_id)
    server.wait_for("executing", goal_id=last)
    client.close()
    with pytest.raises(ClientClosedError):
        client.call_async(QUICK)
    assert never_asked() == []


@pytest.mark.parametrize("timeout", [0, 0.1])
def test_no_server_comes(make_client, timeout):
    client = make_client(timeouts=Timeouts(server=0.5))

    async def main():
        return await client.wait_for_server_async(timeout)

    assert asyncio.run(main()) is False


@pytest.mark.long
def test_closing_ends_the_wait_for_a_server(make_client):
    client = make_client()

    async def main():
        task = asyncio.create_task(client.wait_for_server_async())
        await asyncio.sleep(0)
        async with client:
            pass
        with pytest.raises(ClientClosedError):
            await task

    asyncio.run(main())
