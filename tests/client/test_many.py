"""Many goals and many processes: none lost, none run twice (C1.12, C7.3, C7.5; R3, R4)."""

from __future__ import annotations

import concurrent.futures
import gc
import json
import os
import subprocess
import sys
import threading
import weakref
from collections import Counter

import pytest
from test_msgs.action import Fibonacci

from actionkit import Client, GoalState, RetryPolicy, Timeouts
from actionkit._ros.communication.outbox import WINDOW
from actionkit._ros.servers_in_sight.readiness import State
from tests.conftest import without_noise
from tests.hunting import REPEAT

_CALLS = 300 * REPEAT
"""Calls in a row. What keeps an entry for each of them shows after a hundred."""
_FRESH = 20 * REPEAT
"""Processes. Were one goal in nine lost, 20 of them would show it in 9 of 10 runs."""


class Ignorant:
    """An observer that keeps nothing."""

    def on_event(self, event, call) -> None:
        """Do nothing."""


def executed(server) -> Counter[str]:
    return Counter(e.goal_id for e in server.events if e.event == "executing")


def leftovers(sizes: dict[str, int]) -> dict[str, int]:
    """Return the tables that are not empty; a few timers may have a moment to run."""
    return {name: n for name, n in sizes.items() if n > (4 if name == "timers" else 0)}


@pytest.mark.heavy
def test_500_goals_at_once_from_8_threads(action_server, make_client, own_threads, capfd):
    server = action_server("fibonacci", gate=1, journal="goals")
    client = make_client()
    orders = {thread: [1 + (thread + n) % 40 for n in range(63)] for thread in range(8)}
    futures: dict[int, list] = {}

    def submit(thread: int) -> None:
        futures[thread] = [client.call_async({"order": order}) for order in orders[thread]]

    threads = [threading.Thread(target=submit, args=(thread,)) for thread in orders]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    server.wait_for("executing", count=504, timeout=60)
    assert client.pending == 504
    server.release()  # they all finish together
    flat = [future for some in futures.values() for future in some]
    _, pending = concurrent.futures.wait(flat, timeout=60)
    assert not pending
    for thread, some in futures.items():
        for order, future in zip(orders[thread], some, strict=True):
            assert len(future.result().sequence) == order + 1
    server.wait_for("succeeded", count=504)
    runs = executed(server)
    assert set(runs) == {str(future.goal_id) for future in flat}
    assert set(runs.values()) == {1}
    # Acceptance followed submission, in each thread.
    position = {e.goal_id: i for i, e in enumerate(server.events) if e.event == "accepted"}
    for some in futures.values():
        places = [position[str(future.goal_id)] for future in some]
        assert places == sorted(places)
    assert client.pending == 0
    assert leftovers(client._session.connection.table_sizes()) == {}
    assert own_threads().count("actionkit") == 1
    assert without_noise(capfd.readouterr().err) == ""


@pytest.mark.heavy
def test_very_many_calls_in_a_row_leave_nothing_behind(action_server, make_client, capfd):
    server = action_server("fibonacci", journal="goals")
    client = make_client()
    sizes = []
    for n in range(_CALLS):
        order = 1 + n % 20
        seen: list[Fibonacci.Feedback] = []
        result = client.call({"order": order}, 20, on_feedback=seen.append if n % 10 == 0 else None)
        assert len(result.sequence) == order + 1
        if n in (_CALLS // 4, _CALLS - 1):
            sizes.append(client._session.connection.table_sizes())
            assert client._session.connection.runtime.timers.size < 200
    assert [leftovers(size) for size in sizes] == [{}, {}]
    server.wait_for("succeeded", count=_CALLS)
    runs = executed(server)
    assert len(runs) == _CALLS
    assert set(runs.values()) == {1}
    assert threading.active_count() < 12
    assert without_noise(capfd.readouterr().err) == ""


FRESH = """
import json
from actionkit import Client, Timeouts
from test_msgs.action import Fibonacci
with Client(Fibonacci, "fibonacci", timeouts=Timeouts(server=30.0)) as client:
    future = client.call_async({"order": 7})  # sent the moment the server is ready
    result = future.result(60)
    print(json.dumps([str(future.goal_id), list(result.sequence)]))
"""


@pytest.mark.long
@pytest.mark.heavy
@pytest.mark.timeout(240 * REPEAT)
def test_fresh_processes_that_send_at_once(action_server, ros_domain):
    """Of plain rclpy's goals that are sent so, one in nine loses its acknowledgement (R4)."""
    server = action_server("fibonacci", journal="goals")

    def fresh(_: int) -> list:
        done = subprocess.run(
            [sys.executable, "-c", FRESH],
            capture_output=True,
            text=True,
            env=dict(os.environ),
            timeout=90,
            check=False,
        )
        assert (done.returncode, without_noise(done.stderr)) == (0, "")
        return json.loads(done.stdout.splitlines()[-1])  # Fast DDS may have complained before

    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        answers = list(pool.map(fresh, range(_FRESH)))
    assert all(sequence == [0, 1, 1, 2, 3, 5, 8, 13] for _, sequence in answers)
    server.wait_for("succeeded", count=_FRESH)
    runs = executed(server)
    assert set(runs) == {goal_id for goal_id, _ in answers}
    assert set(runs.values()) == {1}


@pytest.mark.long
def test_clients_of_one_process_share_the_queue_of_the_server(action_server, make_client):
    server = action_server("slow_accept", delay=0.02)
    clients = [make_client(timeouts=Timeouts(accept=None)) for _ in range(4)]
    assert all(client.wait_for_server(10) for client in clients)
    futures = [client.call_async({"order": 1}, timeout=30) for _ in range(20) for client in clients]
    outcomes = [future.outcome(60) for future in futures]
    # A request that the server's queue had no room for would have been sent again (R3).
    assert {(outcome.status, outcome.attempts) for outcome in outcomes} == {
        (GoalState.SUCCEEDED, 1)
    }
    received = [event.goal_id for event in server.wait_for("goal_received", count=80)]
    assert sorted(received) == sorted(str(outcome.goal_id) for outcome in outcomes)


@pytest.mark.long
def test_clients_come_and_go_while_others_work(action_server, make_client, own_threads):
    action_server("fibonacci")
    steady = make_client()
    stop = threading.Event()
    calls = []

    def work() -> None:
        while not stop.is_set():
            calls.append(steady.call({"order": 3}, 20))

    worker = threading.Thread(target=work)
    worker.start()
    for _ in range(20):
        with Client(Fibonacci, "fibonacci") as passing:
            assert passing.call({"order": 2}, 20)
    stop.set()
    worker.join(30)
    assert len(calls) > 20
    assert own_threads().count("actionkit") == 1


@pytest.mark.long
def test_what_is_queued_is_sent_when_a_new_server_has_settled(action_server, make_client):
    server = action_server("slow_accept", gate=1)
    client = make_client(retry=RetryPolicy.none(), timeouts=Timeouts(accept=30.0))
    client.wait_for_server(20)
    futures = [client.call_async({"order": 1}, timeout=30) for _ in range(WINDOW + 1)]
    server.wait_for("goal_received", count=WINDOW)
    connection = client._session.connection
    readiness = connection.link.readiness

    def unsettle() -> None:
        readiness.state = State.SETTLING  # as when another server has come

    connection.runtime.run(unsettle)
    server.release()
    concurrent.futures.wait(futures[:-1], timeout=20)
    assert not futures[-1].done()
    connection.runtime.run(readiness._become_ready)
    assert futures[-1].result(20)


@pytest.mark.long
def test_a_closed_client_is_gone_at_once(action_server, make_client):
    """With another client that keeps the communication thread: 2,000 that came and went held
    47 MB for half a minute.
    """
    action_server("fibonacci")
    stays = make_client()
    assert stays.call({"order": 1}, timeout=20.0)

    def come_and_go(name: str, **kwargs) -> list[weakref.ref]:
        client = Client(Fibonacci, name, **kwargs)
        if name == "fibonacci":
            assert client.call({"order": 1}, timeout=20.0)
        session = client._session
        connection = session.connection
        held = (client, session, connection, connection.link, session.dispatcher)
        client.close()
        assert connection.freed.is_set()
        return [weakref.ref(each) for each in held]

    policy = {"observers": [Ignorant()], "timeouts": Timeouts(liveness=5.0)}
    refs = [
        *come_and_go("fibonacci"),
        *come_and_go("never_served"),
        *come_and_go("fibonacci", **policy),
    ]
    # What is freed is freed on the communication thread, which may be about to let go of it.
    stays.server_is_ready()
    gc.collect()
    assert [ref() for ref in refs if ref() is not None] == []
    assert stays.call({"order": 1}, timeout=20.0)
