"""The clients that are compared: ActionKit's two forms, and three written by hand.

The hand-written ones are as good as careful users make them: each checks acceptance and status,
bounds every wait, and, with many goals at a time, leaves no more than eight requests unanswered
(a server's queue is ten deep) and has queues of its own that are deep enough.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import itertools
import tempfile
import threading
import time
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rclpy
from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.context import Context
from rclpy.executors import Executor, MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from test_msgs.action import Fibonacci
from unique_identifier_msgs.msg import UUID

from actionkit import Client, Ledger
from actionkit._calls.ledger.file import flush
from actionkit._ros.workarounds.listener_hang import stop_listening
from benchmarks.variant import PATIENCE, OnFeedback, Variant

DEEP = QoSProfile(depth=2000)
WINDOW = 8


class Blocking(Variant):
    """`client.call`; many at once from as many threads."""

    def open(self, name: str) -> None:
        self.client = Client(Fibonacci, name)
        assert self.client.wait_for_server(PATIENCE)

    def close(self) -> None:
        self.client.close()

    def call(self, order: int, on_feedback: OnFeedback | None) -> Any:
        return self.client.call(
            Fibonacci.Goal(order=order), PATIENCE, on_feedback=on_feedback
        ).sequence

    def at_once(self, goals: int, order: int) -> list[float]:
        return from_threads(self, goals, order)


class WithLedger(Blocking):
    """`client.call`, of a client that writes each goal into a file before it sends it."""

    def open(self, name: str) -> None:
        self._folder = tempfile.TemporaryDirectory()
        self._ledger = Ledger(Path(self._folder.name, "goals.db"))
        self.client = Client(Fibonacci, name, ledger=self._ledger)
        assert self.client.wait_for_server(PATIENCE)

    def close(self) -> None:
        super().close()
        self._folder.cleanup()

    def in_a_row(self, calls: int, order: int, on_feedback: OnFeedback | None) -> list[float]:
        took = super().in_a_row(calls, order, on_feedback)
        flush()  # what it does a little later counts, too
        return took


class WithKeys(WithLedger):
    """The same, where each call has a key."""

    others = 0
    """How many other keys are in the file."""

    def open(self, name: str) -> None:
        super().open(name)
        self._numbers = itertools.count()
        rows = [(f"old {number}",) for number in range(self.others)]
        with self._ledger._store.change() as file:
            file.executemany(
                "INSERT INTO keys SELECT ?, 'a', 'b', 'c', 0, zeroblob(16), hex(randomblob(16)), 1,"
                " 2, zeroblob(60), 0.0",
                rows,
            )

    def call(self, order: int, on_feedback: OnFeedback | None) -> Any:
        return self.client.call(
            Fibonacci.Goal(order=order),
            PATIENCE,
            on_feedback=on_feedback,
            key=f"leg {next(self._numbers)}",
        ).sequence


class WithManyKeys(WithKeys):
    """The same, with a file that has many."""

    others = 100_000


class Awaiting(Blocking):
    """`await client.call_async`; many at once. One event loop for all, as applications have."""

    def open(self, name: str) -> None:
        self._loop = asyncio.new_event_loop()
        super().open(name)

    def close(self) -> None:
        super().close()
        self._loop.close()

    def in_a_row(self, calls: int, order: int, on_feedback: OnFeedback | None) -> list[float]:
        async def main() -> list[float]:
            return [await self._timed(order, on_feedback) for _ in range(calls)]

        return self._loop.run_until_complete(main())

    def at_once(self, goals: int, order: int) -> list[float]:
        async def main() -> list[float]:
            return await asyncio.gather(*(self._timed(order, None) for _ in range(goals)))

        return self._loop.run_until_complete(main())

    async def _timed(self, order: int, on_feedback: OnFeedback | None) -> float:
        began = time.perf_counter()
        goal = Fibonacci.Goal(order=order)
        result = await self.client.call_async(goal, on_feedback, PATIENCE)
        assert len(result.sequence) == order + 1
        return time.perf_counter() - began


class Tutorial(Variant):
    """`spin_until_future_complete`, twice per call."""

    def open(self, name: str) -> None:
        rclpy.init(args=[])
        self.node = rclpy.create_node("tutorial")
        self.client = ActionClient(self.node, Fibonacci, name)
        assert self.client.wait_for_server(PATIENCE)
        connect(self.client, self._spin)

    def close(self) -> None:
        rclpy.get_global_executor().remove_node(self.node)
        self.client.destroy()
        stop_listening(self.node)
        self.node.destroy_node()
        rclpy.shutdown()

    def call(self, order: int, on_feedback: OnFeedback | None) -> Any:
        callback = None if on_feedback is None else lambda msg: on_feedback(msg.feedback)
        handle = self._spin(self.client.send_goal_async(Fibonacci.Goal(order=order), callback))
        assert handle.accepted
        answer = self._spin(handle.get_result_async())
        assert answer.status == GoalStatus.STATUS_SUCCEEDED
        return answer.result.sequence

    def _spin(self, future: Any, timeout: float = PATIENCE) -> Any:
        rclpy.spin_until_future_complete(self.node, future, timeout_sec=timeout)
        return future.result() if future.done() else None


class OneThread(Variant):
    """A thread that spins; the caller waits for an event that done callbacks set."""

    def open(self, name: str) -> None:
        self.context = Context()
        self.context.init(args=[], initialize_logging=False)
        self.node = Node("one_thread", context=self.context)
        self.executor = self.make_executor()
        self.executor.add_node(self.node)
        self.client = ActionClient(
            self.node,
            Fibonacci,
            name,
            callback_group=self.make_group(),
            goal_service_qos_profile=DEEP,
            result_service_qos_profile=DEEP,
            feedback_sub_qos_profile=DEEP,
        )
        self._window = threading.Semaphore(WINDOW)
        self._thread = threading.Thread(target=self.executor.spin, daemon=True)
        self._thread.start()
        assert self.client.wait_for_server(PATIENCE)
        connect(self.client, self._wait)

    def make_executor(self) -> Executor:
        return SingleThreadedExecutor(context=self.context)

    def make_group(self) -> Any:
        return None

    def close(self) -> None:
        self.executor.shutdown()
        self._thread.join()
        self.client.destroy()
        stop_listening(self.node)
        self.node.destroy_node()
        self.context.shutdown()

    def call(self, order: int, on_feedback: OnFeedback | None) -> Any:
        return self.start(order, on_feedback).result(PATIENCE)

    def start(
        self, order: int, on_feedback: OnFeedback | None = None
    ) -> concurrent.futures.Future[Any]:
        """Send a goal; the future gets the result's sequence."""
        self._window.acquire()
        return send(self.client, order, on_feedback, self._window.release)

    def at_once(self, goals: int, order: int) -> list[float]:
        return from_threads(self, goals, order)

    def _wait(self, future: Any, timeout: float = PATIENCE) -> Any:
        event = threading.Event()
        future.add_done_callback(lambda _: event.set())
        return future.result() if event.wait(timeout) else None


class MultiThreaded(OneThread):
    """The same with a MultiThreadedExecutor and a reentrant callback group."""

    def make_executor(self) -> Executor:
        return MultiThreadedExecutor(context=self.context)

    def make_group(self) -> Any:
        return ReentrantCallbackGroup()


OURS = ("ActionKit blocking", "ActionKit await")
LEDGER, FLOOR = "ActionKit with ledger", "least in Python"
KEYS, MANY_KEYS = "ActionKit with keys", "ActionKit with 100,000 keys"
BEST_RAW = "rclpy one thread"
"""The best of the raw ones where only one is measured."""


def send(
    client: ActionClient,
    order: int,
    on_feedback: OnFeedback | None = None,
    answered: Callable[[], object] = lambda: None,
) -> concurrent.futures.Future[Any]:
    """Send a goal by rclpy's client, which somebody spins; the future gets the result's sequence.

    `answered` is called when the server has accepted or rejected it.
    """
    done: concurrent.futures.Future[Any] = concurrent.futures.Future()

    def accepted(future: Any) -> None:
        answered()
        handle = future.result()
        if not handle.accepted:
            done.set_exception(RuntimeError("rejected"))
            return
        handle.get_result_async().add_done_callback(ended)

    def ended(future: Any) -> None:
        answer = future.result()
        if answer.status == GoalStatus.STATUS_SUCCEEDED:
            done.set_result(answer.result.sequence)
        else:
            done.set_exception(RuntimeError(f"ended with status {answer.status}"))

    callback = None if on_feedback is None else lambda msg: on_feedback(msg.feedback)
    client.send_goal_async(Fibonacci.Goal(order=order), callback).add_done_callback(accepted)
    return done


def connect(client: ActionClient, wait: Callable[[Any, float], Any]) -> None:
    """Ask for the result of an unknown goal until that is answered.

    A server that is ready may not know our endpoints so far, and its answers would be lost.
    """
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until:
        unknown = UUID(uuid=list(uuid.uuid4().bytes))
        future = ClientGoalHandle(client, unknown, None).get_result_async()
        if wait(future, 1.0) is not None:
            return
        future.cancel()
    raise TimeoutError("the server does not answer")


def from_threads(variant: Variant, goals: int, order: int) -> list[float]:
    """Call from as many threads as there are goals."""
    start = threading.Barrier(goals)

    def one(_: int) -> float:
        start.wait()
        return variant.in_a_row(1, order, None)[0]

    with concurrent.futures.ThreadPoolExecutor(goals) as pool:
        return list(pool.map(one, range(goals)))
