"""Awaiting goals in coroutines that an executor of rclpy runs (C1.13)."""

from __future__ import annotations

import asyncio
import concurrent.futures
import gc
import itertools
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import pytest
import rclpy
from rclpy.action import ActionClient, ActionServer
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from test_msgs.action import Fibonacci
from test_msgs.msg import Empty as EmptyMessage
from test_msgs.srv import Empty

from actionkit._ros.workarounds.listener_hang import stop_listening
from tests.awaiting.conftest import LONG, QUICK, reached
from tests.awaiting.page import NOWHERE, RCLPY, record
from tests.conftest import until_shutdown

BOUND = 20.0
EXECUTORS = {"single": SingleThreadedExecutor, "multi": lambda **kw: MultiThreadedExecutor(2, **kw)}
KINDS = ("single", "rclpy.spin", "spin_once", "multi")


class Robot:
    """A node of the user on an executor of the user."""

    def __init__(self, domain: int, kind: str) -> None:
        self.context = Context()
        self.context.init([], domain_id=domain)
        self.node = Node("robot", context=self.context, enable_rosout=False)
        self.group = ReentrantCallbackGroup()
        self.kind = kind
        self.executor: Any = EXECUTORS["multi" if kind == "multi" else "single"](
            context=self.context
        )
        self.stopping = threading.Event()
        self.errors: list[BaseException] = []
        self.thread = threading.Thread(target=self._spin)

    def _spin(self) -> None:
        try:
            with until_shutdown():
                self._spin_until_shutdown()
        except BaseException as error:  # noqa: BLE001  looked at by the test
            self.errors.append(error)

    def _spin_until_shutdown(self) -> None:
        if self.kind == "rclpy.spin":
            rclpy.spin(self.node, self.executor)
            return
        self.executor.add_node(self.node)
        if self.kind == "spin_once":
            while self.context.ok() and not self.stopping.is_set():
                self.executor.spin_once(timeout_sec=0.05)
            return
        self.executor.spin()

    def call(self, function: Callable[[], Any]) -> None:
        """Have a timer call it once."""

        async def callback() -> None:
            timer.cancel()
            await function()

        timer = self.node.create_timer(0.01, callback, callback_group=self.group)

    def close(self) -> None:
        self.stopping.set()
        self.context.try_shutdown()
        if self.thread.is_alive():
            self.thread.join(BOUND)
        with suppress(InvalidHandle):  # the test destroyed it
            stop_listening(self.node)
            self.node.destroy_node()
        if self.executor is not None:
            self.executor.shutdown()


@contextmanager
def robot(domain: int, kind: str, *, spin: bool = True) -> Iterator[Robot]:
    made = Robot(domain, kind)
    try:
        if spin:
            made.thread.start()
        yield made
    finally:
        made.close()


class Answers:
    """What coroutines came to."""

    def __init__(self) -> None:
        self.found: list[Any] = []
        self.came = threading.Event()

    async def of(self, awaitable: Any) -> Any:
        try:
            self.found.append(await awaitable)
        except BaseException as error:
            self.found.append(error)
            raise
        finally:
            self.came.set()

    def one(self) -> Any:
        assert self.came.wait(BOUND)
        return self.found[0]


@pytest.mark.parametrize("kind", KINDS)
def test_timer_and_the_nodes_other_callbacks(kind, ros_domain, action_server, make_client):
    """The goal ends only when the node's timer has ticked six times while it was awaited."""
    server = action_server("fibonacci", gate=1)
    client = make_client()
    assert client.wait_for_server(20)
    answers, awaited, ticks = Answers(), threading.Event(), itertools.count(1)

    async def call() -> Any:
        awaited.set()
        return await client.call_async({"order": 3})

    def tick() -> None:
        if awaited.is_set() and next(ticks) == 6:
            server.release()

    with robot(ros_domain, kind) as made:
        made.node.create_timer(0.01, tick)
        made.call(lambda: answers.of(call()))
        assert len(answers.one().sequence) == 4
    assert not made.errors
    record(RCLPY, "`await future` in a timer's callback", "yes", "-")


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_subscription(kind, ros_domain, client):
    answers = Answers()

    async def heard(_: EmptyMessage) -> None:
        await answers.of(client.call_async(QUICK))

    with robot(ros_domain, kind) as made:
        made.node.create_subscription(EmptyMessage, "go", heard, 10, callback_group=made.group)
        publisher = made.node.create_publisher(EmptyMessage, "go", 10)
        made.node.create_timer(0.1, lambda: publisher.publish(EmptyMessage()))
        assert len(answers.one().sequence) == 2
    record(RCLPY, "`await future` in a subscription's callback", "yes", "-")


@pytest.mark.parametrize("kind", KINDS)
def test_service(kind, ros_domain, client):
    answers = Answers()

    async def serve(_: Empty.Request, response: Empty.Response) -> Empty.Response:
        await answers.of(client.call_async(QUICK))
        return response

    with robot(ros_domain, kind) as made:
        made.node.create_service(Empty, "serve", serve, callback_group=made.group)
        caller = made.node.create_client(Empty, "serve", callback_group=made.group)
        made.call(lambda: caller.call_async(Empty.Request()))
        assert len(answers.one().sequence) == 2
    record(RCLPY, "`await future` in a service's callback", "yes", "-")


@pytest.mark.parametrize("kind", KINDS)
def test_execute_callback(kind, ros_domain, client):
    answers = Answers()

    async def execute(handle: Any) -> Fibonacci.Result:
        result = await client.call_async({"order": handle.request.order})
        handle.succeed()
        return result

    with robot(ros_domain, kind) as made:
        server = ActionServer(made.node, Fibonacci, "outer", execute, callback_group=made.group)
        outer = ActionClient(made.node, Fibonacci, "outer", callback_group=made.group)

        async def ask() -> Any:
            handle = await outer.send_goal_async(Fibonacci.Goal(order=1))
            return (await handle.get_result_async()).result

        made.call(lambda: answers.of(ask()))
        assert len(answers.one().sequence) == 2
        made.context.try_shutdown()
        made.thread.join(BOUND)
        outer.destroy()
        server.destroy()
    record(RCLPY, "`await future` in `execute_callback`", "yes", "-")


@pytest.mark.parametrize("kind", EXECUTORS)
@pytest.mark.long
def test_goals_that_end_at_once_wake_their_coroutines(kind, ros_domain, make_client, action_server):
    """In the very step that awaits them, as well as later."""
    action_server("fibonacci", period=0.0)
    client = make_client()
    assert client.wait_for_server(BOUND)
    answers = Answers()

    async def many() -> int:
        found = 0
        for _ in range(50):
            await client.call_async({"order": 0})
            found += 1
        return found

    with robot(ros_domain, kind) as made:
        tasks = [made.executor.create_task(answers.of(many())) for _ in range(4)]
        until = time.monotonic() + 60
        while not all(task.done() for task in tasks):
            assert time.monotonic() < until
            answers.came.wait(0.05)
    assert answers.found == [50] * 4


@pytest.mark.parametrize("kind", EXECUTORS)
def test_waiting_costs_an_executor_nothing(kind, ros_domain, client, begun):
    """Else rclpy would go on with the coroutine at each wake-up, and keep a note of each time."""
    with robot(ros_domain, kind, spin=False) as made:
        made.executor.add_node(made.node)
        task = made.executor.create_task(Answers().of(begun))
        ticks: list[int] = []
        made.node.create_timer(0.005, lambda: ticks.append(1))
        before: list[int] = []
        while len(ticks) < 50:
            made.executor.spin_once(timeout_sec=1.0)
            if len(ticks) == 10:
                before.append(len(getattr(made.executor, "_futures", [])))
        assert not task.done()
        assert len(getattr(made.executor, "_futures", [])) < max(before, default=0) + 10
        task.cancel()


@pytest.mark.long
def test_a_task_that_is_cancelled(ros_domain, server, client, begun):
    with robot(ros_domain, "single") as made:
        answers = Answers()
        task = made.executor.create_task(answers.of(begun))
        until = time.monotonic() + BOUND
        while not begun._awaiters._waiting:
            assert time.monotonic() < until
            answers.came.wait(0.01)
        task.cancel()
        assert isinstance(answers.one(), GeneratorExit)
        begun.outcome(BOUND)
        seen = reached(server, client, begun)
    record(
        RCLPY, "`executor.create_task(coroutine)`, `task.cancel()`", "yes", seen.partition(",")[0]
    )


def waiting(made: Robot, begun: Any) -> Answers:
    """Have a callback wait for the goal."""
    answers = Answers()
    made.call(lambda: answers.of(begun))
    until = time.monotonic() + BOUND
    while not begun._awaiters._waiting:
        assert time.monotonic() < until
        answers.came.wait(0.01)
    return answers


@pytest.mark.long
@pytest.mark.parametrize("kind", EXECUTORS)
def test_an_executor_that_is_shut_down(kind, ros_domain, server, client, begun):
    with robot(ros_domain, kind) as made:
        waiting(made, begun)
        made.executor.shutdown()
        server.wait_for("canceled", goal_id=str(begun.goal_id))
        begun.outcome(BOUND)
    record(RCLPY, "`executor.shutdown()` while a callback waits", "yes", "cancelled")


@pytest.mark.long
def test_a_context_that_is_shut_down(ros_domain, server, client, begun):
    with robot(ros_domain, "rclpy.spin") as made:
        waiting(made, begun)
        made.context.shutdown()
        server.wait_for("canceled", goal_id=str(begun.goal_id))
        begun.outcome(BOUND)
    record(RCLPY, "`rclpy.shutdown()` while a callback waits", "yes", "cancelled")


@pytest.mark.long
def test_an_executor_that_is_dropped(ros_domain, server, client, begun):
    with robot(ros_domain, "single", spin=False) as made:
        made.executor.create_task(Answers().of(begun))
        made.executor.spin_once(timeout_sec=1.0)
        assert begun._awaiters._waiting
        made.executor = None
        gc.collect()
        server.wait_for("canceled", goal_id=str(begun.goal_id))
        begun.outcome(BOUND)
    record(RCLPY, "the executor is dropped while a callback waits", "yes", "cancelled")


@pytest.mark.long
def test_a_node_that_is_destroyed(ros_domain, server, client, begun):
    with robot(ros_domain, "single") as made:
        answers = waiting(made, begun)
        made.node.destroy_node()
        seen = reached(server, client, begun)
        assert isinstance(answers.one(), concurrent.futures.CancelledError)
    record(RCLPY, "`node.destroy_node()` while a callback waits", "yes", seen)


@pytest.mark.long
def test_servers_and_feedback_are_awaited(ros_domain, action_server, make_client):
    client, answers = make_client(), Answers()

    async def all_of_it() -> Any:
        async with client:
            soon = await client.wait_for_server_async(0)
            action_server("fibonacci", period=0.05)
            later = await client.wait_for_server_async(BOUND)
            future = client.call_async({"order": 3})
            return soon, later, [feedback async for feedback in future.feedback()]

    with robot(ros_domain, "single") as made:
        made.call(lambda: answers.of(all_of_it()))
        soon, later, seen = answers.one()
    assert (soon, later) == (False, True)
    assert seen


def test_an_executor_inside_a_coroutine_of_asyncio(ros_domain, client):
    """The nearest that drives counts, whichever loop runs around it."""
    answers = Answers()

    async def main() -> None:
        with robot(ros_domain, "single", spin=False) as made:
            made.executor.add_node(made.node)
            task = made.executor.create_task(answers.of(client.call_async(QUICK)))
            made.executor.spin_until_future_complete(task, BOUND)

    asyncio.run(main())
    assert len(answers.one().sequence) == 2


def test_a_loop_of_asyncio_inside_a_callback(ros_domain, client):
    answers = Answers()

    async def wait() -> Any:
        return await client.call_async(QUICK)

    async def callback() -> Any:
        return asyncio.run(wait())

    with robot(ros_domain, "single") as made:
        made.call(lambda: answers.of(callback()))
        assert len(answers.one().sequence) == 2


# --- nothing that could wait -------------------------------------------------------------------


def test_a_future_that_is_driven_by_hand(server, client, begun):
    with pytest.raises(RuntimeError, match="nothing runs this coroutine"):
        begun.send(None)
    begun.outcome(BOUND)
    record(
        NOWHERE,
        "`future.send(None)` by hand, without a loop",
        "no: `RuntimeError`",
        reached(server, client, begun).partition(",")[0],
    )


def test_a_coroutine_that_is_driven_by_hand(server, client):
    future = client.call_async(LONG)
    server.wait_for("executing", goal_id=str(future.goal_id))

    async def wait() -> Any:
        return await future

    coroutine = wait()
    with pytest.raises(RuntimeError, match="nothing runs this coroutine"):
        coroutine.send(None)
    with suppress(RuntimeError):
        coroutine.close()
    future.outcome(BOUND)
    record(
        NOWHERE,
        "a coroutine driven by hand",
        "no: `RuntimeError`",
        reached(server, client, future).partition(",")[0],
    )


@pytest.mark.long
def test_waiting_for_a_server_by_hand(client):
    with pytest.raises(RuntimeError, match="nothing runs this coroutine"):
        client.wait_for_server_async(1).send(None)
