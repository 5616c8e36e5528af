"""Which goals are lost with which servers: servers come and go, and are seen late.

What comes from the graph and what comes as the middleware's event is not in step, and neither is
in step with the servers themselves. The world here knows what is true; whoever is told that a
goal's server is gone must not be told so of a server that is there.
"""

from __future__ import annotations

import random
import uuid
from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, cast

import pytest

from actionkit._ros.entities import Entities
from actionkit._ros.listener import GoalListener
from actionkit._ros.runtime import Runtime
from actionkit._ros.servers.monitor import ServerMonitor
from tests.unit.clock import Clock

TYPE = "test_msgs/action/Fibonacci"
_FEEDBACK_TYPE = "test_msgs/action/Fibonacci_FeedbackMessage"


@dataclass
class Goal:
    """A goal of ours, and the server that really has it."""

    home: bytes | None
    goal_id: uuid.UUID = field(default_factory=uuid.uuid4)
    unwanted: bool = False
    lost: list[str] = field(default_factory=list)

    def on_server_ready(self) -> None: ...

    def on_server_lost(self, reason: str) -> None:
        self.lost.append(reason)


class World:
    """Servers, and what a client's middleware and graph show of them, each in its own time."""

    def __init__(self) -> None:
        self.clock = Clock()
        self.alive: set[bytes] = set()
        self.matched: set[bytes] = set()
        self.graph: list[bytes] = []
        self.story: list[str] = []
        self.listeners: dict[bytes, GoalListener] = {}
        self._came = 0
        runtime = SimpleNamespace(
            cancel_timer=self.clock.queue.cancel,
            now=self.clock.now,
            call_at=self.clock.call_at,
            node=SimpleNamespace(get_publishers_info_by_topic=self._publishers),
        )
        self.monitor = ServerMonitor(
            cast(Runtime, runtime),
            cast(
                Entities,
                SimpleNamespace(matched=object(), services_ready=lambda: bool(self.matched)),
            ),
            name="/fibonacci",
            type_name=TYPE,
            probe=self.probe,
            listeners=self.listeners,
            queued=list,
            on_ready=lambda: None,
        )
        self.answers_after: Callable[[], float] = lambda: 0.001

    def _publishers(self, _topic: str) -> list[Any]:
        return [
            SimpleNamespace(
                endpoint_gid=list(gid),
                topic_type=_FEEDBACK_TYPE,
                node_name="server",
                node_namespace="/",
            )
            for gid in self.graph
        ]

    def probe(self) -> int:
        if self.alive & self.matched:
            self.clock.call_at(self.clock.time + self.answers_after(), self._answer)
        return 0

    def _answer(self) -> None:
        if self.alive & self.matched:
            self.monitor.readiness.answered()

    # -- what happens --------------------------------------------------------------------------

    def see(self, gid: bytes) -> None:
        """Let requests reach a server, and those that it sends reach us."""
        self.matched.add(gid)
        self._came += 1

    def lose(self, gid: bytes) -> None:
        """Let the middleware forget a server."""
        self.matched.discard(gid)

    def read_event(self) -> None:
        """Let the communication thread read the middleware's event, of all that happened."""
        came, self._came = self._came, 0
        self._note(f"event: {len(self.matched)}, {came} came")
        self.monitor.matched(len(self.matched), came)

    def send(self) -> Goal | None:
        """Send a goal, as a link does; it is run by the one server that it reaches."""
        if not self.monitor.readiness.ready:
            return None
        goal = Goal(home=next(iter(self.alive & self.matched), None))
        servers = self.monitor.readiness.servers
        self.listeners[goal.goal_id.bytes] = cast(GoalListener, goal)
        self.monitor.goal_sent(goal.goal_id.bytes)
        self._note(f"goal to {goal.home!r}, view {sorted(servers)}")
        return goal

    def _note(self, text: str) -> None:
        self.story.append(f"{self.clock.time:.3f} {text}")

    def at(self, when: float, text: str, what: Callable[[], object]) -> None:
        def do() -> None:
            if text:
                self._note(text)
            what()

        self.clock.call_at(when, do)


def _a_life(seed: int) -> tuple[World, list[str]]:
    """Restart a server again and again, with goals in between; returns what was told wrongly."""
    chance = random.Random(seed)
    world = World()
    world.answers_after = lambda: chance.uniform(0.0005, 0.01)
    wrong: list[str] = []
    goals: list[Goal] = []

    def soon() -> float:
        return chance.choice([0.0, 0.001, 0.05, 0.3]) * chance.random()

    def heard() -> None:
        # The event comes after the endpoints of the services, and the thread may be late.
        world.clock.call_at(world.clock.time + 0.3 * chance.random() ** 3, world.read_event)

    def come(gid: bytes) -> None:
        world.alive.add(gid)
        shown = world.clock.time + soon()
        world.at(shown, f"graph shows {gid!r}", lambda: world.graph.append(gid))
        world.at(
            world.clock.time + soon(), f"{gid!r} is matched", lambda: (world.see(gid), heard())
        )

    def go(gid: bytes) -> None:
        world.alive.discard(gid)
        # At once where it ended cleanly, and with its lease where it was killed.
        forgotten = world.clock.time + chance.choice([0.0, 0.0, 20.0]) + 1.1
        world.at(
            forgotten + soon(), f"graph shows {gid!r} no more", lambda: world.graph.remove(gid)
        )
        world.at(forgotten + soon(), f"{gid!r} is forgotten", lambda: (world.lose(gid), heard()))

    def send() -> None:
        goal = world.send()
        if goal is not None:
            goals.append(goal)

    def look() -> None:
        for goal in goals:
            if goal.lost and goal.home in world.alive and goal.home in world.matched:
                wrong.append(f"the server {goal.home!r} is there, and: {goal.lost[0]}")
        del goals[:-30]

    when = world.clock.time
    for number in range(chance.randint(2, 6)):
        gid = b"%d" % number
        when += chance.choice([0.01, 0.3, 3.0, 12.0]) * chance.random()
        world.at(when, f"{gid!r} comes", lambda gid=gid: come(gid))
        when += chance.choice([0.01, 0.3, 3.0, 12.0]) * chance.random()
        world.at(when, f"{gid!r} goes", lambda gid=gid: go(gid))
    for _ in range(60):
        world.clock.call_at(100 + (when - 99) * chance.random(), send)
    while world.clock.time < when + 25:
        world.clock.advance(0.05)
        look()
        if wrong:
            break
    return world, wrong


@pytest.mark.parametrize("block", range(20))
def test_no_goal_is_lost_with_a_server_that_is_there(block: int) -> None:
    for seed in range(20 * block, 20 * (block + 1)):
        world, wrong = _a_life(seed)
        assert not wrong, f"seed {seed}: {wrong}\n" + "\n".join(world.story)
