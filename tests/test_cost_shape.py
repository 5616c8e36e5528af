"""Work and objects that must not exist (C7). `benchmarks` measure the speed."""

from __future__ import annotations

import gc
import logging
import re
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from test_msgs.action import Fibonacci

from actionkit import Client, Timeouts
from actionkit._ros.endpoints.entities import Entities
from actionkit._ros.rclpy_private.wait_set import MessageSource, Waiter
from actionkit._ros.sending.connection import Connection
from tests.conftest import NEVER
from tests.waiting import until


@pytest.fixture
def count(monkeypatch: pytest.MonkeyPatch) -> Callable[[type, str], Counter[Any]]:
    """Count the calls of a method, by the object that they are made on."""

    def start(owner: type, name: str) -> Counter[Any]:
        calls: Counter[Any] = Counter()
        original = getattr(owner, name)

        def counted(self: Any, *args: Any, **kwargs: Any) -> Any:
            calls[self] += 1
            return original(self, *args, **kwargs)

        monkeypatch.setattr(owner, name, counted)
        return calls

    return start


def link_of(client: Client) -> Any:
    return client._session.connection.link


def node_of(client: Client) -> Any:
    return client._session.connection.runtime.node


def wakeups(client: Client) -> int:
    """Return how often the communication thread has been woken."""
    thread = client._session.connection.runtime._thread
    text = Path(f"/proc/self/task/{thread.native_id}/status").read_text()
    found = re.search(r"^voluntary_ctxt_switches:\t(\d+)$", text, re.MULTILINE)
    assert found
    return int(found[1])


def wakeups_in(seconds: float, client: Client) -> int:
    before = wakeups(client)
    NEVER.wait(seconds)
    return wakeups(client) - before


# --- growth ------------------------------------------------------------------------------------


def settled() -> int:
    """Return how many objects there are, when no thread is left that holds some for a moment."""

    def holds(name: str) -> bool:
        # That of a ledger that an earlier test has used in this process stays, and holds nothing.
        return name.startswith("actionkit-") and name != "actionkit-ledger"

    until(lambda: not any(holds(thread.name) for thread in threading.enumerate()), bound=10)
    gc.collect()
    return len(gc.get_objects())


def test_nothing_is_left_of_calls_that_are_over(action_server, make_client):
    earlier = set(threading.enumerate())  # of earlier tests: one may end meanwhile
    action_server("fibonacci", journal="none")  # it would grow here
    client = make_client()
    seen: list[int] = []

    def call(times: int) -> tuple[int, int]:
        for n in range(times):
            on_feedback = (lambda fb: seen.append(1)) if n % 10 == 0 else None
            client.call({"order": 3}, 20, on_feedback=on_feedback)
        seen.clear()
        return settled(), len(set(threading.enumerate()) - earlier)

    call(100)  # what is made once and kept
    objects, threads = call(50)
    more_objects, more_threads = call(200)
    assert more_objects - objects < 100  # of 200 calls
    assert more_threads == threads
    sizes = client._session.connection.table_sizes()
    assert sizes.pop("timers") <= 1
    assert set(sizes.values()) == {0}


def test_nothing_is_left_of_calls_that_failed(action_server, make_client, monkeypatch):
    # pytest keeps every record of the log.
    monkeypatch.setattr(logging.getLogger("actionkit.goal"), "disabled", True)
    action_server("fibonacci", max_order=5, journal="none")
    client = make_client()

    def fail(times: int) -> int:
        for n in range(times):
            future = client.call_async({"order": 6 if n % 2 else 3}, timeout=20)
            if n % 3 == 0:
                future.cancel()
            future.outcome(20)
            del future
        # A goal that was cancelled may end after its future.
        until(lambda: not any(link_of(client).table_sizes().values()), bound=20)
        return settled()

    fail(50)
    before = fail(30)
    # Up to 60 timers that were cancelled are still in their queue, each with a tuple.
    assert fail(300) - before < 200


def test_the_node_keeps_nothing_of_clients_that_are_closed(action_server, make_client):
    action_server("fibonacci", journal="none")
    client = make_client()  # stays open, and so does the node of all clients
    client.wait_for_server(20)
    kept = node_of(client).default_callback_group.entities  # for as long as the node lives
    before = len(kept)
    for _ in range(3):
        with Client(Fibonacci, "fibonacci", timeouts=Timeouts(server=30.0)) as other:
            other.call({"order": 3}, 20)
    assert len(kept) == before


@pytest.mark.long
def test_what_a_call_held_is_freed_when_its_user_lets_go(action_server, make_client):
    """And not by the next collection, which costs time, and is late for a large result."""
    action_server("fibonacci", max_order=5, journal="none")
    client = make_client()

    def call() -> None:
        for order in (3, 6):
            future = client.call_async({"order": order}, lambda _: None, 20)
            future.outcome(20)
            assert future.done()

    def ours() -> list[type]:
        settled()
        found = [type(each) for each in gc.garbage]
        return [each for each in found if each.__module__.startswith(("actionkit", "test_msgs"))]

    call()
    settled()
    gc.disable()
    gc.set_debug(gc.DEBUG_SAVEALL)
    try:
        call()
        assert ours() == []
    finally:
        gc.set_debug(0)
        gc.garbage.clear()
        gc.enable()


# --- what must not be made -------------------------------------------------------------------


def test_a_client_has_four_entities_and_shares_the_rest(action_server, make_client, own_threads):
    action_server("fibonacci")
    clients = [make_client() for _ in range(5)]
    for client in clients:
        client.call({"order": 3}, 20)
    node = node_of(clients[0])  # not before: it may be replaced until a server is seen
    assert {node_of(client) for client in clients} == {node}
    assert len(list(node.clients)) == 3 * len(clients)
    assert len(list(node.subscriptions)) == len(clients)
    assert len(list(node.services)) == len(list(node.timers)) == 0
    assert own_threads().count("actionkit") == 1
    clients[0].close()
    assert len(list(node.clients)) == 3 * (len(clients) - 1)


@pytest.mark.long
def test_status_is_subscribed_to_only_while_a_goal_lasts(action_server, make_client, count):
    server = action_server("fibonacci", gate=1)
    client = make_client()
    client.wait_for_server(20)
    made = count(Entities, "subscribe_status")
    server.release()
    for _ in range(20):
        client.call({"order": 3}, 20)
    assert sum(made.values()) == 0  # none of the 20 goals that the server remembers was looked at
    server.command("hold")
    server.wait_for("held")
    future = client.call_async({"order": 3}, timeout=30)
    until(lambda: made, bound=20)
    server.release()
    future.result(20)
    assert sum(made.values()) == 1
    connection = client._session.connection
    assert connection.runtime.run(lambda: len(list(node_of(client).subscriptions))) == 1


# --- what must not be done -------------------------------------------------------------------


def test_nobody_elses_feedback_is_decoded(action_server, make_client, count):
    action_server("fibonacci")
    decoded = count(Connection, "decode_feedback")
    ours, theirs = make_client(), make_client()
    ours.call({"order": 3}, 20)
    theirs.call({"order": 40}, 20, on_feedback=lambda _: None)
    assert decoded[ours._session.connection] == 0  # not even its own: nobody has asked for it
    assert decoded[theirs._session.connection] > 0


def test_status_is_read_ten_times_a_second_at_most(action_server, make_client, count):
    server = action_server("fibonacci", gate=1)
    ours, others = make_client(), make_client()
    futures = [ours.call_async({"order": 3}, timeout=60)]
    server.wait_for("executing")
    feedback = {link_of(client)._entities.feedback for client in (ours, others)}
    taken = count(MessageSource, "take")

    def reads() -> int:
        return sum(n for source, n in dict(taken).items() if source not in feedback)

    until(reads, "status is not watched", bound=20)
    before, began = reads(), time.monotonic()
    for _ in range(40):  # each changes its state twice
        futures.append(others.call_async({"order": 1}, timeout=60))
        NEVER.wait(0.02)
    took = time.monotonic() - began
    assert reads() - before <= 2 * (10 * took + 2)  # of two clients
    server.release()
    for future in futures:
        future.result(20)


@pytest.mark.long
def test_feedback_does_not_cost_a_turn_each(action_server, make_client, count):
    action_server("fibonacci")
    client = make_client()
    client.call({"order": 3}, 20)
    waits = count(Waiter, "wait")
    feedback = 0
    for _ in range(10):
        future = client.call_async({"order": 90}, timeout=20)
        feedback += future.outcome(20).feedback_count
    assert feedback > 400
    assert sum(waits.values()) < feedback


# --- wake-ups ----------------------------------------------------------------------------------


def test_an_idle_client_is_not_woken(action_server, make_client):
    action_server("fibonacci")
    clients = [make_client() for _ in range(5)]
    for client in clients:
        client.call({"order": 3}, 20)
    NEVER.wait(2.5)  # what discovery has to say, and the others' feedback
    assert wakeups_in(1.5, clients[0]) <= 2


def test_who_waits_for_a_server_is_woken_once_a_second(make_client, monkeypatch):
    # A new node is replaced in its first second, for which the thread wakes a few times more.
    monkeypatch.setenv("ACTIONKIT_QUICK_DISCOVERY", "0")
    client = make_client(timeouts=Timeouts(server=30.0))
    future = client.call_async({"order": 3})
    NEVER.wait(0.2)
    assert wakeups_in(2.5, client) <= 6
    future.cancel()


def test_who_waits_for_a_result_is_woken_now_and_then(action_server, make_client):
    server = action_server("fibonacci", gate=1)
    client = make_client()
    futures = [client.call_async({"order": 1}, timeout=30) for _ in range(20)]
    server.wait_for("executing", count=20)
    NEVER.wait(2.5)  # status has been subscribed to, and its first message read
    # Each goal asks anew from time to time whether its result is there (R1).
    assert wakeups_in(2.0, client) <= 2 * len(futures)
    server.release()
    for future in futures:
        future.result(20)
