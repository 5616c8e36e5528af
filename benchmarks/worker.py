"""A process with one client at work in it, so that what it uses is the client's."""

from __future__ import annotations

import gc
import os
import sys
import threading
import time
from typing import Any

from benchmarks import child
from benchmarks.process import resident, thread_cpu
from benchmarks.server import NAME, STREAM
from benchmarks.variant import Variant
from benchmarks.variants import VARIANTS

_KINDS = {
    "actionkit": "communication",
    "actionkit-callbacks": "callbacks",
    "actionkit-observers": "callbacks",
}


class Worker:
    """Carries out commands on clients of one variant."""

    def __init__(self, variant: str) -> None:
        self._variant = variant
        self._clients: dict[str, Variant] = {}
        self._endless: list[Any] = []

    def open(self, name: str = NAME, variant: str | None = None) -> None:
        """Make a client of an action and connect it; with `variant`, of another kind."""
        client = self._clients[name] = VARIANTS[variant or self._variant]()
        client.open(name)

    def close(self, name: str | None = None) -> None:
        """Close the action's client, or all of them, where there is one."""
        for one in [name] if name else list(self._clients):
            client = self._clients.pop(one, None)
            if client is not None:
                client.close()

    @property
    def client(self) -> Variant:
        """The client that is open, where there is only one."""
        return self._clients[NAME]

    def in_a_row(
        self,
        calls: int,
        order: int,
        feedback: bool = False,
        pace: float = 0.0,
        name: str = NAME,
    ) -> dict[str, Any]:
        """Call one after the other; with `pace`, one in so many seconds."""
        client = self._clients[name]
        seen: list[Any] = []
        callback = seen.append if feedback else None
        before = thread_cpu(os.getpid())
        cpu, wall = time.process_time(), time.perf_counter()
        if not pace:
            took = client.in_a_row(calls, order, callback)
        else:
            took = []
            for number in range(calls):
                took += client.in_a_row(1, order, callback)
                time.sleep(max(0.0, wall + (number + 1) * pace - time.perf_counter()))
        used = time.process_time() - cpu
        return {
            "took": took,
            "cpu": used / calls,
            "wall": (time.perf_counter() - wall) / calls,
            **{kind: seconds / calls for kind, seconds in _by_thread(before).items()},
            "feedback": len(seen) / calls,
        }

    def at_once(self, goals: int, order: int, name: str = NAME) -> dict[str, Any]:
        """Have so many goals in flight at a time."""
        cpu, wall = time.process_time(), time.perf_counter()
        took = self._clients[name].at_once(goals, order)
        return {
            "took": took,
            "cpu": (time.process_time() - cpu) / goals,
            "wall": (time.perf_counter() - wall) / goals,
        }

    def fill(self, goals: int, name: str) -> None:
        """Let the action's server remember so many goals more."""
        client = self._clients[name].client  # type: ignore[attr-defined]  of ActionKit
        for future in [client.call_async({"order": 0}, timeout=300) for _ in range(goals)]:
            future.result()

    def endless(self, clients: int, name: str) -> None:
        """Be so many clients of an action, with a goal each that never ends."""
        from test_msgs.action import Fibonacci

        from actionkit import Client

        for _ in range(clients):
            client = Client(Fibonacci, name, on_close="abandon")
            future = client.call_async({"order": STREAM})
            next(iter(future.feedback()))
            self._endless.append((client, future))

    def forget_endless(self) -> None:
        """Close them."""
        for client, _ in self._endless:
            client.close()
        self._endless.clear()

    def server_is_gone(self) -> None:
        """Wait until it is."""
        until = time.monotonic() + 30.0
        while self.client.is_connected():
            assert time.monotonic() < until
            time.sleep(0.01)

    def await_server(self) -> float:
        """Wait for a server; return the monotonic time at which it was there."""
        assert self.client.await_server()
        return time.monotonic()

    def state(self) -> dict[str, Any]:
        """What has grown, or has not."""
        gc.collect()
        tables: dict[str, int] = {}
        if hasattr(self.client, "client") and hasattr(self.client.client, "pending"):
            tables = self.client.client._session.connection.table_sizes()
        return {
            "memory": resident(os.getpid()),
            "objects": len(gc.get_objects()),
            "threads": threading.active_count(),
            "tables": sum(count for name, count in tables.items() if name != "timers"),
            "timers": tables.get("timers", 0),
        }


def _by_thread(before: dict[int, float]) -> dict[str, float]:
    """Return the CPU that threads have used since, by what they are for."""
    kinds = {
        thread.native_id: _KINDS.get(thread.name, "caller") for thread in threading.enumerate()
    }
    used = dict.fromkeys([*_KINDS.values(), "caller", "middleware"], 0.0)
    for number, seconds in thread_cpu(os.getpid()).items():
        used[kinds.get(number, "middleware")] += seconds - before.get(number, 0.0)
    return used


if __name__ == "__main__":
    answers = child.claim_stdout()
    worker = Worker(sys.argv[1])
    commands = [name for name in vars(Worker) if not name.startswith("_") and name != "client"]
    child.serve(answers, {name: getattr(worker, name) for name in commands})
    worker.close()
