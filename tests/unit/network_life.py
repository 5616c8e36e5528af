"""Goals of one client, a server, and a network that loses and delays packets.

Everything of the client's is real, from the attempt down to its requests; only the middleware is
not. Requests and answers of one service arrive in their order, as they do with a reliable
middleware: what is lost comes seconds later, and so does all that was sent after it. The server
does what rclpy's does, the moment included in which it knows a goal only in part.
"""

from __future__ import annotations

import random
import uuid
from collections.abc import Callable
from functools import partial
from types import SimpleNamespace
from typing import Any
from unittest import mock

from rclpy.qos import QoSProfile
from test_msgs.action import Fibonacci

from actionkit import Timeouts
from actionkit._calls.sending.attempt import Attempt
from actionkit._goal.effects import Ending, Record
from actionkit._goal.stages import CancelReason
from actionkit._ros.endpoints.names import ActionNames
from actionkit._ros.sending import link as link_module
from tests.unit.clock import CommunicationThread

TYPE = "test_msgs/action/Fibonacci"
EXECUTING, CANCELING, SUCCEEDED, CANCELED = 2, 3, 4, 5
ACCEPTED, UNKNOWN_GOAL, TERMINATED = 0, 2, 3


class Service:
    """A service client: sends over the simulated network, and returns what has come."""

    def __init__(self, life: NetworkLife, name: str, on_response: Callable[[int, Any], None]):
        self.name = name
        self.inbox: list[tuple[int, Any]] = []
        self._life = life
        self._on_response = on_response
        self._sent = 0

    def send(self, request: Any) -> int:
        self._sent += 1
        about = request.goal_info if self.name == "cancel" else request
        self._life.request(self, self._sent, bytes(about.goal_id.uuid))
        return self._sent

    def take(self) -> None:
        while self.inbox:
            self._on_response(*self.inbox.pop(0))


class Topic:
    """A topic on which nothing comes."""

    def take(self) -> list[bytes]:
        return []

    def discard(self) -> None: ...


class Entities:
    """A client's entities: three services, and topics on which nothing comes."""

    def __init__(self, life: NetworkLife, _node: Any, _impl: Any, _name: str, **callbacks: Any):
        self.goal = Service(life, "goal", callbacks["on_goal"])
        self.result = Service(life, "result", callbacks["on_result"])
        self.cancel = Service(life, "cancel", callbacks["on_cancel"])
        self.feedback = self.matched = Topic()
        self.sources = [self.goal, self.result, self.cancel, self.feedback]
        self.on_matched = callbacks["on_matched"]

    def services_ready(self) -> bool:
        return True

    def subscribe_status(self, _on_status: Any) -> Any:
        return Topic()

    def unsubscribe_status(self, _source: Topic) -> None: ...

    def destroy(self) -> None: ...


class OnServer:
    """A goal on the server.

    Attributes:
        state: Its status code.
        known: Whether all of the server knows it, and not the middleware's part alone.
        waiting: The numbers of the requests for its result.
    """

    def __init__(self) -> None:
        self.state = EXECUTING
        self.known = False
        self.waiting: list[int] = []

    @property
    def runs(self) -> bool:
        return self.state in (EXECUTING, CANCELING)


class Waiter:
    """Sends one goal when a server is ready and its turn has come."""

    def __init__(self, link: Any, attempt: Attempt) -> None:
        self._link, self._attempt = link, attempt
        self._goal_id = attempt.goal_id
        self._sent = False

    def on_server_ready(self) -> None:
        self._link.enqueue(self, self._goal_id)

    def on_turn(self) -> None:
        self._sent = True
        self._attempt.send(Fibonacci.Goal())
        self._attempt.start()

    def give_up(self, why: CancelReason) -> None:
        if self._sent:
            self._attempt.give_up(why)
        else:
            self._link.dequeue(self, self._goal_id)


class NetworkLife(CommunicationThread):
    """Goals that are sent, given up on and answered in an order that a seed makes."""

    def __init__(self, seed: int) -> None:
        super().__init__()
        self.chance = random.Random(seed)
        self.loss = self.chance.choice([0.0, 0.05, 0.1, 0.3])
        self.story: list[str] = []
        self.goals: dict[bytes, OnServer] = {}
        self.attempts: list[Attempt] = []
        self.endings: dict[bytes, Ending] = {}
        self.unwanted = self.urgent = False
        self.timers = self.queue
        self.node = SimpleNamespace(
            get_publishers_info_by_topic=self._publishers,
            get_subscriptions_info_by_topic=lambda *_, **__: [],
            get_name=lambda: "ours",
        )
        self.node_replacement = SimpleNamespace(links={})
        self.standstill = SimpleNamespace(watch=lambda: None)
        self._windows: dict[type, Any] = {}
        self._free_at: dict[str, float] = {}
        self.enable = self._enable  # type: ignore[method-assign]
        entities = lambda *args, **callbacks: Entities(self, *args, **callbacks)  # noqa: E731
        with mock.patch.object(link_module, "Entities", entities):
            self.link: Any = link_module.Link(  # type: ignore[arg-type]
                self, Fibonacci, TYPE, ActionNames.of("/a")
            )
        self.link._entities.on_matched(1, 1)

    def run(self) -> None:
        """Send goals, give some of them up, and let a minute and a half pass."""
        timeouts = Timeouts(accept=self.chance.choice([1.0, 10.0]))
        for _ in range(self.chance.choice([1, 3, 12, 40])):
            begins = 0.5 + self.chance.choice([0.0, 0.5]) * self.chance.random()
            deadline = self.now() + begins + self.chance.uniform(0.05, 5.0)
            attempt = Attempt(
                self.link,
                uuid.UUID(int=self.chance.getrandbits(128)),
                timeouts,
                self,
                on_change=lambda _: None,
            )
            waiter = Waiter(self.link, attempt)
            if self.chance.random() < 0.5:
                self.call_at(deadline, partial(waiter.give_up, CancelReason.DEADLINE))
            self.call_at(self.now() + begins, partial(self.link.await_server, waiter))
            self.attempts.append(attempt)
            if self.chance.random() < 0.7:
                wait = 3.0 * self.chance.random() ** 2
                cancel = partial(waiter.give_up, CancelReason.CANCELLED)
                self.call_at(self.now() + begins + wait, cancel)
        self.advance(90.0)

    # -- the thread ----------------------------------------------------------------------------

    def _enable(self, source: Any) -> None:
        self.sources.add(source)
        if getattr(source, "inbox", None):
            self.call_at(self.now(), lambda: self._read(source))

    def _read(self, source: Any) -> None:
        if source in self.sources:
            source.take()

    def window(self, kind: type, _action_name: str) -> Any:
        return self._windows.setdefault(kind, kind())

    def keep_until(self, _at: float) -> None: ...

    def _publishers(self, topic: str, *, no_mangle: bool = False) -> list[Any]:
        if no_mangle and "send_goalReply" not in topic:  # versions of types: none are told here
            return []
        return [
            SimpleNamespace(
                qos_profile=QoSProfile(depth=1),
                endpoint_gid=list(b"a" * 16),
                topic_type=TYPE + "_FeedbackMessage",
                node_name="server",
                node_namespace="/",
            )
        ]

    # -- the network ---------------------------------------------------------------------------

    def _travels(self, way: str) -> float:
        """When something that is sent now arrives: after all that was sent before it."""
        arrives = self.now() + self.chance.uniform(0.0003, 0.002)
        if self.chance.random() < self.loss:
            arrives += self.chance.uniform(0.05, 3.0)
        arrives = self._free_at[way] = max(arrives, self._free_at.get(way, 0.0))
        return arrives

    def request(self, service: Service, seq: int, key: bytes) -> None:
        self.note(f"request {service.name} {seq}", key)
        serve = {"goal": self._accept, "result": self._tell_result, "cancel": self._cancel}
        self.call_at(
            self._travels(f"to {service.name}"), lambda: serve[service.name](service, seq, key)
        )

    def _answer(self, service: Service, seq: int, key: bytes, **fields: Any) -> None:
        def arrive() -> None:
            self.note(f"answer {service.name} {seq} {fields}", key)
            service.inbox.append((seq, SimpleNamespace(**fields)))
            late = self.chance.choice([0.0, 0.001, 0.05]) * self.chance.random()
            self.call_at(self.now() + late, lambda: self._read(service))

        self.call_at(self._travels(f"from {service.name}"), arrive)

    # -- the server ----------------------------------------------------------------------------

    def _accept(self, service: Service, seq: int, key: bytes) -> None:
        if key in self.goals:
            self._answer(service, seq, key, accepted=False)
            return
        goal = self.goals[key] = OnServer()

        def register() -> None:
            goal.known = True
            self.note("server knows it", key)
            if self.chance.random() < 0.3:
                ends = self.now() + self.chance.uniform(0.0, 4.0)
                self.call_at(ends, lambda: self._end(key, SUCCEEDED))
            self._answer(service, seq, key, accepted=True)

        busy = self.chance.choice([0.0, 0.01, 0.1]) * self.chance.random()
        self.call_at(self.now() + busy, register)

    def _tell_result(self, service: Service, seq: int, key: bytes) -> None:
        goal = self.goals.get(key)
        if goal is None or not goal.known:
            self._answer(service, seq, key, status=0, result=None)
        elif goal.runs:
            goal.waiting.append(seq)
        else:
            self._answer(service, seq, key, status=goal.state, result=None)

    def _cancel(self, service: Service, seq: int, key: bytes) -> None:
        goal = self.goals.get(key)
        canceling: list[Any] = []
        code = ACCEPTED
        if goal is None:
            code = UNKNOWN_GOAL
        elif goal.known and not goal.runs:
            code = TERMINATED
        elif goal.known:
            goal.state = CANCELING
            canceling = [SimpleNamespace(goal_id=SimpleNamespace(uuid=key))]
            ends = self.now() + self.chance.uniform(0.0005, 0.01)
            self.call_at(ends, lambda: self._end(key, CANCELED))
        self._answer(service, seq, key, return_code=code, goals_canceling=canceling)

    def _end(self, key: bytes, state: int) -> None:
        goal = self.goals[key]
        if goal.runs:
            goal.state = state
            self.note(f"server ends it: {state}", key)
            for seq in goal.waiting:
                self._answer(self.link._entities.result, seq, key, status=state, result=None)

    # -- owners of goals ----------------------------------------------------------------------

    def on_record(self, attempt: Attempt, record: Record) -> None:
        self.note(str(record), attempt.goal_id.bytes)

    def on_end(self, attempt: Attempt, ending: Ending) -> None:
        self.endings[attempt.goal_id.bytes] = ending
        self.note(f"END {ending}", attempt.goal_id.bytes)

    def on_feedback(self, *_: Any) -> None: ...
    def on_late_result(self, *_: Any) -> None: ...
    def on_over(self, _: Attempt) -> None: ...

    def note(self, what: str, key: bytes) -> None:
        self.story.append(f"{key.hex()[:6]} {self.now() - 100.0:7.3f} {what}")

    def told_of(self, attempt: Attempt) -> str:
        """The story of one goal."""
        name = attempt.goal_id.bytes.hex()[:6]
        return "\n".join(line for line in self.story if line.startswith(name))
