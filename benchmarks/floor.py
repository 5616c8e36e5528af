"""The floor: what a call costs where a client does nothing but call.

ActionKit's own wait over its own entities, and straight code on top: one goal at a time, without a
deadline, a cancel, a retry, a log, a timeline, or a thought of a server that goes. What a client
that does those could save at most is the way from its figure to this one. All feedback is decoded
and delivered off the communication thread, before the result: that is promised (C1.8). It is looked
for every 2 ms and with the result, as ActionKit does: to wake for each message costs more.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import queue
import threading
import time
import uuid
from collections.abc import Callable
from typing import Any

from rclpy.context import Context
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from test_msgs.action import Fibonacci
from unique_identifier_msgs.msg import UUID

from actionkit._ros.discovery import stop_listening
from actionkit._ros.entities import Entities
from actionkit._ros.names import ActionNames
from actionkit._ros.native import Waiter
from actionkit._ros.wire import feedback_alone, feedback_goal_id
from benchmarks.variant import PATIENCE, OnFeedback, Variant

_IMPL = Fibonacci.Impl
_PAUSE = 0.002


class Floor(Variant):
    """Waits for the result as `Client.call` does."""

    def open(self, name: str) -> None:
        self.context = Context()
        self.context.init(args=[], initialize_logging=False)
        self.node = Node(
            "floor", context=self.context, enable_rosout=False, start_parameter_services=False
        )
        self._entities = Entities(
            self.node,
            _IMPL,
            ActionNames.of(f"/{name}"),
            on_goal=self._on_goal,
            on_result=self._on_result,
            on_cancel=lambda seq, response: None,
            on_feedback=lambda: None,
            on_matched=lambda count, came: None,
        )
        self._key = b""
        self._callback: OnFeedback | None = None
        self._tell: Callable[[Any], object] = lambda sequence: None
        self._connected = threading.Event()
        self._jobs: queue.SimpleQueue[Callable[[], object] | None] = queue.SimpleQueue()
        self._waiter = Waiter(self.context)
        self._closing = False
        self._threads = [threading.Thread(target=work) for work in (self._wait, self._call_back)]
        for thread in self._threads:
            thread.start()
        assert self.await_server()

    def close(self) -> None:
        self._closing = True
        self._waiter.wake()
        self._jobs.put(None)
        for thread in self._threads:
            thread.join()
        self._waiter.destroy()
        self._entities.destroy()
        stop_listening(self.node)
        self.node.destroy_node()
        self.context.shutdown()

    def is_connected(self) -> bool:
        return self._entities.services_ready()

    def await_server(self) -> bool:
        until = time.monotonic() + PATIENCE
        while not self._connected.wait(0.5) and time.monotonic() < until:
            self._ask_result(uuid.uuid4().bytes)
        return self._connected.is_set()

    def call(self, order: int, on_feedback: OnFeedback | None) -> Any:
        done: concurrent.futures.Future[Any] = concurrent.futures.Future()
        self._send(order, on_feedback, done.set_result)
        return done.result(PATIENCE)

    def _send(
        self, order: int, on_feedback: OnFeedback | None, tell: Callable[[Any], object]
    ) -> None:
        self._key, self._tell = uuid.uuid4().bytes, tell
        if on_feedback is not self._callback:
            self._callback = on_feedback
            self._waiter.wake()  # it looks for feedback only where somebody wants it
        request = _IMPL.SendGoalService.Request()
        request.goal_id = UUID(uuid=list(self._key))
        request.goal = Fibonacci.Goal(order=order)
        self._entities.goal.send(request)

    def _ask_result(self, key: bytes) -> None:
        request = _IMPL.GetResultService.Request()
        request.goal_id = UUID(uuid=list(key))
        self._entities.result.send(request)

    def _on_goal(self, _: int, response: Any) -> None:
        assert response.accepted
        self._ask_result(self._key)

    def _look_at_feedback(self) -> None:
        messages = self._entities.feedback.take()
        if self._callback is not None and messages:
            self._jobs.put(lambda: self._deliver(messages))

    def _deliver(self, messages: list[bytes]) -> None:
        assert self._callback is not None
        for message in messages:
            if feedback_goal_id(message) == self._key:
                self._callback(deserialize_message(feedback_alone(message), Fibonacci.Feedback))

    def _on_result(self, _: int, response: Any) -> None:
        if response.status == 0:  # the answer about a goal that there never was
            self._connected.set()
            return
        if self._callback is None:
            self._entities.feedback.discard()
            self._tell(response.result.sequence)
        else:
            self._look_at_feedback()
            self._jobs.put(lambda: self._tell(response.result.sequence))

    def _wait(self) -> None:
        answers = (self._entities.goal, self._entities.result)
        looked = 0.0
        while not self._closing:
            pause = None if self._callback is None else _PAUSE
            for source in self._waiter.wait(answers, pause):
                source.on_readable()
            if pause is not None and time.monotonic() - looked >= _PAUSE:
                self._look_at_feedback()
                looked = time.monotonic()

    def _call_back(self) -> None:
        while (job := self._jobs.get()) is not None:
            job()


class AwaitedFloor(Floor):
    """Waits for the result as `await` does: an event loop has to be woken."""

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

    async def _timed(self, order: int, on_feedback: OnFeedback | None) -> float:
        began = time.perf_counter()
        done: asyncio.Future[Any] = self._loop.create_future()
        self._send(
            order,
            on_feedback,
            lambda sequence: self._loop.call_soon_threadsafe(done.set_result, sequence),
        )
        assert len(await done) == order + 1
        return time.perf_counter() - began
