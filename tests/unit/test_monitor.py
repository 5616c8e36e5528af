"""Which goals are lost with which servers, while servers come and go and are seen late.

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
from rclpy.exceptions import InvalidHandle
from rclpy.qos import QoSProfile, ReliabilityPolicy

from actionkit._ros.answers.listener import GoalListener, Waiter
from actionkit._ros.communication.runtime import Runtime
from actionkit._ros.endpoints.entities import Entities
from actionkit._ros.endpoints.names import ActionNames
from actionkit._ros.servers_in_sight.monitor import ServerMonitor
from actionkit._ros.servers_in_sight.restarts import SEEMS_RESTARTED
from tests.conftest import all_is_logged
from tests.hunting import many
from tests.unit.clock import Clock

TYPE = "test_msgs/action/Fibonacci"


@dataclass
class Goal:
    """A goal of ours, and the server that really has it."""

    home: bytes | None
    goal_id: uuid.UUID = field(default_factory=uuid.uuid4)
    unwanted: bool = False
    lost: list[str] = field(default_factory=list)
    ready: int = 0
    servers: list[tuple[int, int]] = field(default_factory=list)
    mismatches: list[tuple[str, ...]] = field(default_factory=list)
    on_lost: Callable[[], object] = lambda: None

    __hash__ = object.__hash__

    def on_server_ready(self) -> None:
        self.ready += 1

    def on_type_mismatch(self, served: tuple[str, ...]) -> None:
        self.mismatches.append(served)

    def on_servers_changed(self, servers: int, away: int) -> None:
        self.servers.append((servers, away))

    def on_server_lost(self, reason: str) -> None:
        self.lost.append(reason)
        self.on_lost()


class World:
    """Servers, and what a client's middleware and graph show of them, each in its own time."""

    def __init__(self, *, matched: object | None = "event") -> None:
        self.clock = Clock()
        self.alive: set[bytes] = set()
        self.players: set[bytes] = set()  # they only publish feedback
        self.matched: set[bytes] = set()
        self.graph: list[bytes] | None = []
        self.nodes: dict[bytes, str] = {}
        self.action_type = TYPE
        self.reliability = ReliabilityPolicy.RELIABLE
        self.probes: list[float] = []
        self.queued: list[Goal] = []
        self.ready = 0
        self.story: list[str] = []
        self.listeners: dict[bytes, GoalListener] = {}
        self._came = 0
        runtime = SimpleNamespace(
            cancel_timer=self.clock.queue.cancel,
            now=self.clock.now,
            call_at=self.clock.call_at,
            node=SimpleNamespace(
                get_publishers_info_by_topic=self._publishers,
                get_subscriptions_info_by_topic=lambda *_, **__: [],
                get_name=lambda: "ours",
            ),
        )
        self.monitor = ServerMonitor(
            cast(Runtime, runtime),
            cast(
                Entities,
                SimpleNamespace(
                    matched=matched,
                    receive_best_effort=lambda: self.story.append("again, best effort"),
                    services_ready=lambda: bool(self.matched - self.players),
                    subscribe_status=self._no_status,
                ),
            ),
            names=ActionNames.of("/fibonacci"),
            type_name=TYPE,
            probe=self.probe,
            listeners=self.listeners,
            queued=lambda: cast(list[Waiter], list(self.queued)),
            on_ready=self._count_ready,
        )
        self.answers_after: Callable[[], float] = lambda: 0.001

    def _count_ready(self) -> None:
        self.ready += 1

    def _no_status(self, _: object) -> Any:
        raise InvalidHandle("no server here has a status to send")

    def _publishers(self, topic: str, *, no_mangle: bool = False) -> list[Any]:
        if no_mangle and "send_goalReply" not in topic:  # versions of types: none are told here
            return []
        if self.graph is None:
            raise InvalidHandle("the context was shut down")
        return [
            SimpleNamespace(
                qos_profile=QoSProfile(depth=1, reliability=self.reliability),
                endpoint_gid=list(gid),
                topic_type=f"{self.action_type}_FeedbackMessage",
                node_name=self.nodes.get(gid, "server"),
                node_namespace="/",
            )
            for gid in self.graph
            if not (no_mangle and gid in self.players)
        ]

    def probe(self) -> int:
        self.probes.append(self.clock.time)
        if self.alive & self.matched:
            self.clock.call_at(self.clock.time + self.answers_after(), self._answer)
        return len(self.probes)

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
        self.monitor.readiness.matched(len(self.matched), came)

    def serve(self, *gids: bytes) -> None:
        """Let these servers be there, seen by everybody, and let them answer."""
        assert self.graph is not None
        for gid in gids:
            self.nodes.setdefault(gid, f"server_{gid.decode()}")
        self.alive, self.graph = set(gids), list(gids)
        for gid in set(gids) - self.matched:
            self.see(gid)
        self.matched = set(gids)
        self.read_event()
        self.clock.advance(0.11)

    def wait(self, goal: Goal | None = None) -> Goal:
        """Let a goal wait for a server."""
        goal = goal or Goal(home=None)
        self.monitor.await_server(cast(Waiter, goal))
        return goal

    def sent(self) -> Goal:
        goal = self.send()
        assert goal is not None
        return goal

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
    graph = world.graph
    assert graph is not None
    world.answers_after = lambda: chance.uniform(0.0005, 0.01)
    wrong: list[str] = []
    goals: list[Goal] = []
    world.players = {b"player %d" % number for number in range(chance.choice([0, 0, 1, 2]))}

    def soon() -> float:
        return chance.choice([0.0, 0.001, 0.05, 0.3]) * chance.random()

    def heard() -> None:
        # The event comes after the endpoints of the services, and the thread may be late.
        world.clock.call_at(world.clock.time + 0.1 * chance.random() ** 3, world.read_event)

    def come(gid: bytes) -> None:
        if world.players and {*graph} - world.matched - world.players:
            # The graph still shows one that has left. To start takes longer than that.
            world.clock.call_at(world.clock.time + 0.01, lambda: come(gid))
            return
        world.alive |= {gid} - world.players
        world.clock.call_at(world.clock.time + soon(), lambda: show(gid))
        if gid not in world.players:
            matched = world.clock.time + soon()
            world.at(matched, f"{gid!r} is matched", lambda: (world.see(gid), heard()))

    def show(gid: bytes) -> None:
        # The graph shows publishers in the order in which they were discovered.
        if gid in world.players and world.matched - world.players - {*graph}:
            world.clock.call_at(world.clock.time + 0.01, lambda: show(gid))
            return
        world._note(f"graph shows {gid!r}")
        graph.append(gid)
        if gid in world.players:
            world.see(gid)
            heard()

    def go(gid: bytes) -> None:
        world.alive.discard(gid)
        # At once where it ended cleanly, and with its lease where it was killed.
        forgotten = world.clock.time + chance.choice([0.0, 0.0, 20.0]) + 1.1
        shown = forgotten + min(soon(), 0.04 if world.players else 1.0)
        world.at(shown, f"graph shows {gid!r} no more", lambda: graph.remove(gid))
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
        # It is seen before it goes: a process needs longer than that to start.
        when += 0.35 + chance.choice([0.01, 0.3, 3.0, 12.0]) * chance.random()
        world.at(when, f"{gid!r} goes", lambda gid=gid: go(gid))
    for gid in sorted(world.players):
        comes = 100 + (when - 99) * chance.random()
        world.at(comes, f"{gid!r} comes", lambda gid=gid: come(gid))
        if chance.random() < 0.5:
            leaves = comes + 0.35 + 10 * chance.random()
            world.at(leaves, f"{gid!r} goes", lambda gid=gid: go(gid))
    for _ in range(60):
        world.clock.call_at(100 + (when - 99) * chance.random(), send)
    while world.clock.time < when + 25:
        world.clock.advance(0.05)
        look()
        if wrong:
            return world, wrong
    wrong += [f"never lost with {goal.home!r}" for goal in goals if not goal.lost]
    world.clock.advance(40.0)  # what seems to be a server without a name is not believed for ever
    if world.monitor.readiness.count:
        wrong.append(f"servers that are not: {world.monitor.readiness.servers}")
    return world, wrong


def test_a_goal_that_was_lost_is_not_on_a_server_that_comes_after_that() -> None:
    """Else it would be waited for, though the new server says that it does not know it."""
    world = World()
    world.serve(b"old")
    goal = world.sent()
    world.serve()
    assert goal.lost == ["its action server is gone"]
    world.serve(b"new")
    assert not world.monitor.sees_server_of(goal.goal_id.bytes)


def test_goals_are_lost_with_their_server_and_not_before() -> None:
    for seed in range(many(400)):
        world, wrong = _a_life(seed)
        assert not wrong, f"seed {seed}: {wrong}\n" + "\n".join(world.story)


# --- who waits for a server --------------------------------------------------------------------


@pytest.fixture
def world() -> World:
    return World()


def test_who_waits_is_told_once(world: World) -> None:
    waiting, other, gone = world.wait(), world.wait(), world.wait()
    world.monitor.stop_waiting(cast(GoalListener, gone))
    assert world.monitor.waiting == 2
    world.serve(b"a")
    assert (waiting.ready, other.ready, gone.ready, world.ready) == (1, 1, 0, 1)
    assert world.wait().ready == 1  # one is there
    assert world.monitor.waiting == 0
    world.serve(b"a", b"b")
    assert (waiting.ready, world.monitor.waiting) == (1, 0)


def test_who_waits_for_the_next_server_is_not_told_of_the_one_that_is_there(world: World) -> None:
    world.serve(b"a")
    goal = Goal(home=None)
    world.monitor.await_next_ready(cast(Waiter, goal))
    world.clock.advance(10.0)
    assert goal.ready == 0
    world.serve(b"b")
    assert goal.ready == 1


def test_a_callback_is_told_each_time_until_it_is_removed(world: World) -> None:
    told: list[int] = []
    callback = lambda: told.append(1)  # noqa: E731
    world.monitor.add_ready_waiter(callback)
    world.serve(b"a")
    world.serve(b"b")
    world.monitor.remove_ready_waiter(callback)
    world.serve(b"c")
    assert (len(told), world.monitor.waiting) == (2, 0)


def test_who_waits_is_told_that_another_type_is_served(world: World) -> None:
    world.action_type, world.graph = "a/action/Other", [b"x"]
    first = world.wait()
    second = world.wait()
    assert first.mismatches == [("a/action/Other",)]
    world.clock.advance(1.0)
    assert second.mismatches == [("a/action/Other",)]
    world.monitor.stop_waiting(cast(GoalListener, first))
    world.monitor.stop_waiting(cast(GoalListener, second))
    world.clock.advance(10.0)
    assert len(second.mismatches) == 1
    assert len(world.clock.queue) == 0  # nobody looks any more


def test_who_waits_for_a_server_to_answer_is_told_what_took_its_place(world: World) -> None:
    """The servers of our type went before they were ready, and another type is served since."""
    world.graph = [b"a"]
    world.see(b"a")
    world.read_event()
    waiting = world.wait()
    assert waiting.mismatches == []
    world.lose(b"a")
    world.graph = []
    world.read_event()
    world.action_type, world.graph = "a/action/Other", [b"x"]
    world.clock.advance(1.0)
    assert waiting.mismatches == [("a/action/Other",)]


def test_who_waits_can_have_the_graph_looked_at_at_any_time(world: World) -> None:
    waiting = world.wait()
    world.monitor.readiness.look_again()
    assert waiting.mismatches == []
    world.action_type, world.graph = "a/action/Other", [b"x"]
    world.monitor.readiness.look_again()
    assert waiting.mismatches == [("a/action/Other",)]
    world.action_type = TYPE
    world.serve(b"a")
    world.action_type = "a/action/Other"
    world.monitor.readiness.look_again()  # a server of our type was there a moment ago
    assert len(waiting.mismatches) == 1


# --- who loses a server ------------------------------------------------------------------------


def test_goals_are_lost_with_the_last_server_that_may_have_them(world: World) -> None:
    world.serve(b"a")
    on_a = world.sent()
    world.clock.advance(5.0)
    world.serve(b"a", b"b")
    on_both = world.sent()
    waiting = Goal(home=None)
    world.queued.append(waiting)
    world.serve(b"b")
    assert (on_a.lost, on_both.lost) == (["its action server is gone"], [])
    assert on_both.servers[-1] == (2, 1)
    world.serve()
    assert on_both.lost == waiting.lost == ["its action server is gone"]
    # Once more for a goal that was lost before: no server at all is left.
    assert len(on_a.lost) == 2


def test_a_server_that_goes_before_it_has_a_name_is_one_server_that_is_gone(world: World) -> None:
    world.alive = {b"a"}
    world.see(b"a")
    world.read_event()
    world.clock.advance(0.7)  # the graph does not show it
    goal = world.sent()
    world.lose(b"a")
    world.read_event()
    assert goal.lost
    assert goal.servers[-1] == (1, 1)


def test_a_player_that_seemed_to_be_a_second_server_does_not_count(world: World) -> None:
    world.serve(b"a")
    goal = world.sent()
    world.players = {b"p"}
    world.see(b"p")
    world.read_event()  # ahead of the graph
    assert goal.servers[-1] == (2, 0)
    world.graph = [b"a", b"p"]
    world.clock.advance(0.1)
    assert goal.servers[-1] == (1, 0)


def test_a_goal_may_be_on_a_server_that_comes_into_sight_just_after(world: World) -> None:
    world.serve(b"a")
    early = world.sent()
    world.clock.advance(0.6)
    late = world.sent()
    world.serve(b"a", b"b")
    asked = early.ready
    world.serve(b"b")
    assert (bool(early.lost), bool(late.lost)) == (True, False)
    assert early.ready == asked + 1  # so b is asked, too: another client may have sent the goal


def test_goals_on_a_server_that_is_back_are_told_so(world: World) -> None:
    world.serve(b"a")
    goal = world.sent()
    key = goal.goal_id.bytes
    assert world.monitor.sees_server_of(key)
    world.clock.advance(1.0)
    world.serve()
    assert not world.monitor.sees_server_of(key)
    world.serve(b"b")
    assert (goal.ready, world.monitor.sees_server_of(key)) == (0, False)  # it has never had it
    world.serve(b"a", b"b")
    assert (goal.ready, world.monitor.sees_server_of(key)) == (1, True)


def test_a_goal_that_is_forgotten_while_others_are_told_is_told_nothing(world: World) -> None:
    world.serve(b"a")
    first, second = world.sent(), world.sent()

    def forget() -> None:
        del world.listeners[second.goal_id.bytes]
        world.monitor.forget(second.goal_id.bytes)

    first.on_lost = forget
    world.serve()
    assert (len(first.lost), second.lost) == (1, [])
    assert not world.monitor.sees_server_of(second.goal_id.bytes)


def test_only_of_several_servers_another_may_have_the_goal(world: World) -> None:
    world.serve(b"a")
    key = world.sent().goal_id.bytes
    assert not world.monitor.may_be_elsewhere(key)
    world.clock.advance(1.0)
    world.serve(b"a", b"b")
    assert world.monitor.may_be_elsewhere(key)
    assert not world.monitor.may_be_elsewhere(b"never sent")
    world.serve(b"b", b"c")
    assert not world.monitor.may_be_elsewhere(key)  # its server is gone


# --- restarts ----------------------------------------------------------------------------------


def restart(world: World, new_node: str, *, answers: int = 1) -> Goal:
    """Kill a server with a goal, let another come, and ask both; return the goal."""
    world.serve(b"a")
    goal = world.sent()
    world.clock.advance(10.0)
    world.nodes[b"b"] = new_node
    world.serve(b"a", b"b")
    goal.ready = 0
    before = len(world.probes)
    world.monitor.restarts.start()
    world.clock.advance(0.6)
    for seq in range(before + 1, len(world.probes) + 1):
        for _ in range(answers):
            world.monitor.restarts.count_answer(seq)
    world.clock.advance(0.2)
    return goal


def test_a_silent_server_with_a_successor_on_a_node_of_its_name_was_restarted(
    world: World,
) -> None:
    goal = restart(world, "server_a")
    assert (goal.lost, goal.ready) == ([SEEMS_RESTARTED], 1)
    assert goal.servers[-1] == (1, 0)  # it is there
    # It may not have it any more, though the middleware still shows it: who answers is another.
    assert not world.monitor.sees_server_of(goal.goal_id.bytes)
    assert world.monitor.seems_replaced(goal.goal_id.bytes)
    world.serve(b"a", b"b", b"c")
    assert goal.servers[-1] == (1, 0)  # and it stays, whatever else comes
    world.serve(b"b")
    assert not world.monitor.seems_replaced(goal.goal_id.bytes)  # it has gone
    assert goal.servers[-1] == (1, 1)
    assert len(goal.lost) == 2  # a call that waits for that is told


@pytest.mark.parametrize(("node", "answers"), [("other", 1), ("server_a", 2), ("server_a", 0)])
def test_a_server_that_may_live_is_not_taken_for_restarted(node: str, answers: int) -> None:
    world = World()
    goal = restart(world, node, answers=answers)
    assert (goal.lost, world.monitor.sees_server_of(goal.goal_id.bytes)) == ([], True)


def test_two_nodes_of_unknown_names_are_not_taken_for_one(world: World) -> None:
    world.nodes[b"a"] = "_NODE_NAME_UNKNOWN_"
    assert restart(world, "_NODE_NAME_UNKNOWN_").lost == []


def test_servers_are_asked_again_until_the_names_of_their_nodes_are_known(world: World) -> None:
    goal = restart(world, "_NODE_NAME_UNKNOWN_")
    assert goal.lost == []
    world.nodes[b"b"] = "server_a"
    asked = len(world.probes)
    world.clock.advance(1.0)
    assert len(world.probes) == asked + 3
    for seq in range(asked + 1, asked + 4):
        world.monitor.restarts.count_answer(seq)
    world.clock.advance(1.0)
    assert goal.lost == [SEEMS_RESTARTED]
    world.clock.advance(100.0)
    assert len(world.probes) == asked + 3


# --- what else is told -------------------------------------------------------------------------


def test_goals_are_told_of_silence_and_of_its_end(world: World) -> None:
    world.serve(b"a")
    goal = world.sent()
    world.monitor.liveness.start(3.0)
    world.clock.advance(3.5)
    assert goal.lost == ["its server answered nothing for 3 s"]
    ready = goal.ready
    world.monitor.liveness.heard()
    assert goal.ready == ready + 1
    world.listeners.clear()
    world.monitor.forget(goal.goal_id.bytes)
    world.clock.advance(10.0)
    assert len(world.clock.queue) == 0  # without goals nothing is asked


def test_several_servers_are_warned_of_once_with_their_nodes(
    world: World, caplog: pytest.LogCaptureFixture
) -> None:
    world.players = {b"p"}
    world.serve(b"a", b"p")
    world.clock.advance(1.0)
    world.serve(b"a")
    world.nodes[b"b"] = "server_b"
    world.graph = [b"a", b"b"]  # before its event
    world.read_event()
    world.serve(b"a", b"b")
    world.clock.advance(1.0)
    assert all_is_logged()
    assert len(caplog.records) == 1
    world.serve(b"a")
    world.serve(b"a", b"b")
    world.clock.advance(1.0)
    assert all_is_logged()
    [record] = caplog.records
    assert "action /fibonacci has 2 servers (/server_a, /server_b)" in record.getMessage()
    assert "after a restart the old one shows for up to 20 s" in record.getMessage()


def test_several_servers_of_one_process_are_not_said_to_go_away(
    world: World, caplog: pytest.LogCaptureFixture
) -> None:
    participant = bytes(12)
    world.serve(participant + b"a", participant + b"b")
    world.clock.advance(1.0)
    assert all_is_logged()
    [record] = caplog.records
    assert record.getMessage().endswith(
        "; they are in one process: start it again, and if it has two again, change it"
    )


def test_servers_with_unknown_nodes_are_warned_of_without_names(
    world: World, caplog: pytest.LogCaptureFixture
) -> None:
    world.nodes |= {b"a": "_NODE_NAME_UNKNOWN_", b"b": "_NODE_NAME_UNKNOWN_"}
    world.serve(b"a", b"b")
    world.clock.advance(1.0)
    assert all_is_logged()
    [record] = caplog.records
    assert record.getMessage().startswith("action /fibonacci has 2 servers: each of them runs")


def test_servers_are_looked_for_once_a_second_where_there_is_no_event() -> None:
    world = World(matched=None)
    waiting = world.wait()
    world.alive = world.matched = {b"a"}
    world.graph = [b"a"]
    world.clock.advance(1.2)
    assert waiting.ready == 1
    goal = world.sent()
    seen: list[int] = []
    world.monitor.readiness.matched = lambda count, came=0: seen.append(count)  # type: ignore[method-assign, assignment]
    world.clock.advance(5.0)
    assert seen == []  # nothing has changed
    del world.monitor.readiness.matched
    world.graph = None  # the context was shut down
    world.clock.advance(2.0)
    assert goal.lost == []
    world.graph = []
    world.clock.advance(1.0)
    assert goal.lost == ["its action server is gone"]


@pytest.mark.parametrize("matched", ["event", None])
def test_closing_leaves_no_timer(matched: object) -> None:
    world = World(matched=matched)
    world.graph = [b"a", b"b"]
    world.alive = world.matched = {b"a", b"b"}
    world.monitor.readiness.matched(2, 2)
    world.clock.advance(1.0)
    world.sent()
    world.monitor.restarts.start()
    world.monitor.liveness.start(1.0)
    world.wait()
    world.monitor.close()
    world.clock.advance(0.002)  # an answer is on its way
    assert len(world.clock.queue) == 0
    probes = len(world.probes)
    world.clock.advance(100.0)
    assert len(world.probes) == probes


def test_a_closed_monitor_begins_no_probes(world: World) -> None:
    world.serve(b"a")
    world.sent()
    world.monitor.close()
    probes = len(world.probes)
    world.monitor.liveness.start(1.0)
    assert len(world.probes) == probes


def test_feedback_is_received_best_effort_only_while_no_server_is_matched(world: World) -> None:
    world.serve(b"a")
    world.sent()
    world.reliability, world.graph = ReliabilityPolicy.BEST_EFFORT, [b"a", b"b"]
    world.read_event()
    assert "again, best effort" not in world.story
    world.serve()
    world.graph = [b"b"]
    world.wait()
    assert world.story[-1] == "again, best effort"


# --- after this process itself stood still (contract C5.4) -------------------------------------


def test_a_server_that_is_back_soon_after_a_standstill_was_never_gone(world: World) -> None:
    world.serve(b"a")
    goal, ready = world.sent(), world.ready
    world.monitor.stood_still(world.clock.time + 8.0)
    world.serve()  # what the middleware concludes from a lease that ran out here
    assert goal.lost == []
    world.serve(b"a")
    world.clock.advance(60.0)
    assert goal.lost == []
    assert world.monitor.sees_server_of(goal.goal_id.bytes)
    assert world.ready == ready + 1
    assert goal.ready > 0  # and is asked about


def test_one_that_stays_away_after_a_standstill_is_gone(world: World) -> None:
    world.serve(b"a")
    goal = world.sent()
    world.monitor.stood_still(world.clock.time + 8.0)
    world.serve()
    world.clock.advance(4.0)
    world.monitor.stood_still(world.clock.time + 8.0)  # once more
    world.clock.advance(7.0)
    assert goal.lost == []
    world.clock.advance(1.1)
    assert goal.lost == ["its action server is gone"]


def test_one_that_was_replaced_during_a_standstill_is_gone(world: World) -> None:
    world.serve(b"a")
    goal = world.sent()
    world.monitor.stood_still(world.clock.time + 8.0)
    world.serve()
    world.serve(b"b")
    world.clock.advance(9.0)
    assert goal.lost == ["its action server is gone"]


def test_a_node_that_was_replaced_discovers_the_same_servers(world: World) -> None:
    world.serve(b"a")
    goal, ready = world.sent(), world.ready
    world.monitor.stood_still(world.clock.time + 8.0)
    world.monitor.leave()
    assert not world.monitor.readiness.ready
    world.matched.clear()
    world.serve(b"a")
    world.clock.advance(60.0)
    assert goal.lost == []
    assert world.ready == ready + 1
