"""A process with clients of many actions: ActionKit's, or rclpy's on one node that a thread spins.

Each way gets the best of what it has: ActionKit submits everything and waits; the raw client sends
from done callbacks, and leaves at most eight requests of an action unanswered.
"""

from __future__ import annotations

import concurrent.futures
import os
import sys
import threading
import time
from functools import partial
from typing import Any

from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from test_msgs.action import Fibonacci

from actionkit import Client, Timeouts
from actionkit._ros.workarounds.listener_hang import stop_listening
from benchmarks import child, process
from benchmarks.clients import connect, send
from benchmarks.variant import PATIENCE

_WINDOW = 8
_ORDER = 5

Future = concurrent.futures.Future[Any]


class OfActionKit:
    """Clients of ActionKit."""

    def __init__(self) -> None:
        self._clients: list[Client[Any]] = []

    def open(self, names: list[str]) -> None:
        """Make a client of each action, and connect it."""
        # A server that has much to do takes long to accept: that is not an error here.
        waiting = Timeouts(accept=None)
        self._clients = [Client(Fibonacci, name, timeouts=waiting) for name in names]
        for client in self._clients:
            assert client.wait_for_server(PATIENCE)

    def start(self, action: int, seconds: float) -> Future:
        """Send a goal."""
        goal = Fibonacci.Goal(order=_ORDER)
        return self._clients[action].call_async(goal, timeout=seconds)

    def close(self) -> None:
        """Close them."""
        for client in self._clients:
            client.close()


class OfRclpy:
    """rclpy's action clients on a node that a thread spins."""

    def __init__(self) -> None:
        self._context = Context()
        self._context.init(args=[], initialize_logging=False)
        self._node = Node("fleet", context=self._context, start_parameter_services=False)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._clients: list[ActionClient] = []
        self._windows: list[threading.Semaphore] = []
        self._spinner = threading.Thread(target=self._executor.spin, daemon=True)

    def open(self, names: list[str]) -> None:
        """Make a client of each action, and connect it."""
        deep = QoSProfile(depth=2000)
        for name in names:
            self._clients.append(
                ActionClient(
                    self._node,
                    Fibonacci,
                    name,
                    goal_service_qos_profile=deep,
                    result_service_qos_profile=deep,
                )
            )
            self._windows.append(threading.Semaphore(_WINDOW))
        self._spinner.start()
        for client in self._clients:
            assert client.wait_for_server(PATIENCE)
            connect(client, self._wait)

    def _wait(self, future: Any, timeout: float) -> Any:
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        return future.result() if done.wait(timeout) else None

    def start(self, action: int, seconds: float) -> Future:
        """Send a goal, when there is room for it."""
        window = self._windows[action]
        if not window.acquire(timeout=seconds):
            raise TimeoutError
        return send(self._clients[action], _ORDER, None, window.release)

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._spinner.join()
        for client in self._clients:
            client.destroy()
        stop_listening(self._node)
        self._node.destroy_node()
        self._context.shutdown()


KINDS = {"ActionKit": OfActionKit, "rclpy": OfRclpy}


class Fleet:
    """Carries out commands."""

    def __init__(self, kind: str) -> None:
        self._clients: OfActionKit | OfRclpy = KINDS[kind]()
        self._names: list[str] = []

    def open(self, names: list[str]) -> dict[str, float]:
        """Call each for the first time; return what that took."""
        cpu, wall, memory = time.process_time(), time.perf_counter(), process.resident(os.getpid())
        self._names = names
        self._clients.open(names)
        for first in [self._clients.start(action, PATIENCE) for action in range(len(names))]:
            first.result(PATIENCE)
        return {
            "connect": time.perf_counter() - wall,
            "connect_cpu": (time.process_time() - cpu) / len(names),
            "memory": (process.resident(os.getpid()) - memory) / len(names),
        }

    def chains(self, goals: int) -> dict[str, Any]:
        """Call all actions at a time, each so often, one after the other."""
        began, ends = time.perf_counter(), [0.0] * len(self._names)
        over: Future = concurrent.futures.Future()
        left = [goals] * len(self._names)
        lock, running = threading.Lock(), len(self._names)

        def next_one(action: int, ended: Future | None) -> None:
            nonlocal running
            try:
                if ended is not None:
                    result = ended.result()
                    assert len(getattr(result, "sequence", result)) == _ORDER + 1
                if left[action]:
                    left[action] -= 1
                    future = self._clients.start(action, PATIENCE)
                    future.add_done_callback(partial(next_one, action))
                    return
                ends[action] = time.perf_counter() - began
                with lock:
                    running -= 1
                    last = not running
                if last:
                    over.set_result(None)
            except Exception as error:  # noqa: BLE001  raised where it is waited for
                if not over.done():
                    over.set_exception(error)

        cpu = time.process_time()
        for action in range(len(self._names)):
            next_one(action, None)
        over.result(PATIENCE)
        number = goals * len(self._names)
        return {
            "wall": (time.perf_counter() - began) / number,
            "cpu": (time.process_time() - cpu) / number,
            "took": ends,
        }

    def flood(self, goals: int, seconds: float) -> dict[str, Any]:
        """Have so many goals in flight at a time, spread over the actions.

        Raises:
            RuntimeError: They did not all end within the time.
        """
        before = process.forget_peak(os.getpid())
        cpu, began = time.process_time(), time.perf_counter()
        took: list[float] = []
        futures = []
        try:
            for number in range(goals):
                left = seconds - (time.perf_counter() - began)
                future = self._clients.start(number % len(self._names), max(0.0, left))
                future.add_done_callback(lambda _: took.append(time.perf_counter() - began))
                futures.append(future)
        except TimeoutError:
            pass
        left = seconds - (time.perf_counter() - began)
        concurrent.futures.wait(futures, max(0.0, left))
        wall = time.perf_counter() - began
        failed = [str(f.exception()) for f in futures if f.done() and f.exception() is not None]
        ended = sum(future.done() for future in futures) - len(failed)
        if ended < goals:
            why = f"; {failed[0]}" if failed else ""
            raise RuntimeError(f"{ended:,} of {goals:,} had ended after {wall:.0f} s{why}")
        return {
            "wall": wall / goals,
            "cpu": (time.process_time() - cpu) / goals,
            "took": took,
            "memory": (process.peak(os.getpid()) - before) / goals,
        }

    def close(self) -> None:
        """End."""
        self._clients.close()


if __name__ == "__main__":
    answers = child.claim_stdout()
    fleet = Fleet(sys.argv[1])
    child.serve(answers, {"open": fleet.open, "chains": fleet.chains, "flood": fleet.flood})
    fleet.close()
