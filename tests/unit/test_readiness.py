"""Whether servers are there: the logic, on a clock that the test moves."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from actionkit._ros.endpoints import graph
from actionkit._ros.endpoints.graph import Endpoint
from actionkit._ros.endpoints.names import ActionNames
from actionkit._ros.servers_in_sight.readiness import ServerReadiness, State
from tests.unit.clock import Clock

OURS = "test_msgs/action/Fibonacci"
PATIENCE = 0.5
HEAD_START = 0.1  # as long as `readiness` gives a server, at least
KEPT = 0.1
"""Seconds for which a server keeps an answer until it knows the way back."""
A, B, C = b"a", b"b", b"c"


class World:
    """A graph, and what a readiness makes of it."""

    def __init__(self) -> None:
        self.clock = Clock()
        self.graph: list[Endpoint] | None = []
        self.services = True
        self.versions: tuple[str, ...] = ()
        self.told: list[object] = []
        self.probes: list[float] = []
        self.looks = self.completed = 0
        self.readiness = ServerReadiness(
            self.clock,
            list_publishers=self._list,
            services_ready=lambda: self.services,
            other_versions=lambda: self.versions,
            probe=lambda: self.probes.append(self.clock.time),
            on_ready=lambda: self.told.append("ready"),
            on_change=self._changed,
            on_mismatch=lambda types: self.told.append(("mismatch", types)),
            on_complete=self._count_complete,
            action_type=OURS,
        )

    def _count_complete(self) -> None:
        self.completed += 1

    def _list(self) -> list[Endpoint] | None:
        self.looks += 1
        return self.graph

    def _changed(self, _came: frozenset[bytes], gone: frozenset[bytes]) -> None:
        if gone:
            self.told.append(("lost", gone))

    def serve(self, *gids: bytes, action_type: str = OURS) -> None:
        """Let the graph show these servers."""
        self.graph = [Endpoint(gid, action_type, "/node") for gid in gids]

    def play(self, *gids: bytes) -> None:
        """Let the graph show that these only publish feedback, too."""
        assert self.graph is not None
        self.graph += [Endpoint(gid, OURS, "/player", serves=False) for gid in gids]

    def match(self, *gids: bytes) -> None:
        """Let these servers be there, seen by the graph and by the middleware's event."""
        self.serve(*gids)
        self.readiness.matched(len(gids))

    def news(self) -> list[object]:
        told, self.told = self.told, []
        return told


@pytest.fixture
def world() -> World:
    return World()


@pytest.fixture
def ready(world: World) -> World:
    world.match(A)
    world.readiness.answered()
    assert world.news() == ["ready"]
    return world


# --- coming ------------------------------------------------------------------------------------


def test_nobody_is_there_and_nothing_is_done(world: World) -> None:
    world.clock.advance(100)
    assert world.readiness.state is State.ABSENT
    assert (world.news(), world.probes, world.looks) == ([], [], 0)


def test_a_server_is_ready_when_it_answers(world: World) -> None:
    world.match(A)
    assert world.readiness.state is State.SETTLING
    assert not world.readiness.ready
    world.clock.advance(HEAD_START)
    assert len(world.probes) == 1
    world.clock.advance(0.01)
    assert world.news() == []
    world.readiness.answered()
    assert world.readiness.ready
    assert (world.readiness.count, world.readiness.servers) == (1, {A})
    assert world.news() == ["ready"]
    asked = len(world.probes)
    world.clock.advance(100)
    world.readiness.answered()  # to a question that was asked again meanwhile
    assert (world.news(), len(world.probes), len(world.clock.queue)) == ([], asked, 0)


def test_a_server_has_time_to_find_us_before_it_is_asked(world: World) -> None:
    """Else an rclpy server is held up for 0.1 s, prints a warning, and the answer is lost."""
    world.services = False
    world.match(A)
    world.clock.advance(0.3)
    world.services = True
    seen = world.clock.time
    world.clock.advance(1.0)
    assert world.probes[0] - seen >= HEAD_START
    pauses = [later - one for one, later in zip(world.probes, world.probes[1:], strict=False)]
    assert len(pauses) == 1
    assert min(pauses) > KEPT


def test_a_server_that_shows_that_it_knows_us_is_asked_at_once(world: World) -> None:
    world.readiness.known()  # what is known before anybody is there means nothing
    world.match(A)
    assert (world.completed, world.probes) == (1, [])
    world.clock.advance(0.003)
    world.readiness.known()
    assert world.probes == [world.clock.time]
    world.readiness.known()
    world.clock.advance(HEAD_START)
    assert len(world.probes) == 1  # the end of the head start is no second question
    world.clock.advance(KEPT)
    assert len(world.probes) == 2
    world.readiness.answered()
    world.readiness.known()
    world.clock.advance(10.0)
    assert (len(world.probes), world.news()) == (2, ["ready"])


def test_of_several_servers_one_that_knows_us_proves_nothing_of_the_others(world: World) -> None:
    world.match(A, B)
    world.readiness.known()
    assert world.probes == []
    world.clock.advance(HEAD_START)
    assert len(world.probes) == 1


def test_who_comes_in_the_place_of_another_has_as_much_time(world: World) -> None:
    world.match(A)
    world.clock.advance(HEAD_START - 0.01)
    world.match()
    world.clock.advance(0.001)
    world.match(B)
    world.clock.advance(HEAD_START - 0.001)
    assert world.probes == []
    world.clock.advance(0.002)
    assert len(world.probes) == 1


def test_a_server_that_is_long_in_coming_is_asked_all_the_same(world: World) -> None:
    """Its services are seen long after itself: it may know even less of us."""
    world.services = False
    world.match(A)
    world.clock.advance(2 * PATIENCE)
    world.services = True
    world.clock.advance(PATIENCE - 0.01)
    assert (len(world.probes), world.news()) == (2, [])


def test_several_servers_are_asked_ever_more_rarely(world: World) -> None:
    world.match(A, B)
    world.clock.advance(4.9)
    assert world.news() == []
    assert 15 < len(world.probes) < 22


def test_a_server_that_answers_nothing_is_busy_not_deaf(world: World) -> None:
    world.match(A)
    world.clock.advance(PATIENCE - 0.01)
    assert not world.readiness.ready
    world.clock.advance(2 * PATIENCE)
    assert world.news() == ["ready"]


def test_nothing_is_asked_before_the_services_are_there(world: World) -> None:
    world.services = False
    world.match(A)
    world.clock.advance(10 * PATIENCE)
    assert (world.probes, world.news(), world.readiness.ready) == ([], [], False)
    world.services = True
    world.clock.advance(1.0)
    assert world.news() == ["ready"]


def test_the_event_may_be_ahead_of_the_graph(world: World) -> None:
    world.readiness.matched(1)
    assert world.readiness.state is State.SETTLING
    assert world.readiness.servers
    world.readiness.answered()
    assert world.news() == ["ready"]


def test_a_context_that_was_shut_down_has_no_graph(ready: World) -> None:
    ready.graph = None
    ready.readiness.matched(1)
    assert (ready.readiness.servers, ready.readiness.ready, ready.news()) == ({A}, True, [])


# --- going -------------------------------------------------------------------------------------


def test_a_server_goes(ready: World) -> None:
    ready.match()
    assert ready.readiness.state is State.ABSENT
    assert (ready.readiness.servers, ready.readiness.count) == (frozenset(), 0)
    assert ready.news() == [("lost", {A})]
    ready.clock.advance(10)
    assert ready.news() == []


@pytest.mark.parametrize("action_type", [OURS, "other_msgs/action/Other"])
def test_a_server_was_seen_however_it_has_gone(world: World, action_type: str) -> None:
    assert not world.readiness.has_seen_servers
    world.serve(A, action_type=action_type)
    assert world.readiness.has_seen_servers
    if action_type == OURS:
        world.match(A)
        world.match()
        assert world.readiness.has_seen_servers


def test_a_server_goes_before_it_was_ready(world: World) -> None:
    world.match(A)
    world.match()
    world.readiness.answered()
    world.clock.advance(10)
    assert world.news() == [("lost", {A})]
    assert world.readiness.state is State.ABSENT


def test_another_comes_in_its_place(ready: World) -> None:
    ready.match(B)
    assert ready.news() == [("lost", {A})]
    assert ready.readiness.state is State.SETTLING
    ready.readiness.answered()
    assert ready.news() == ["ready"]
    assert ready.readiness.servers == {B}


def test_a_restart_shows_two_for_a_while(ready: World) -> None:
    ready.match(A, B)
    assert ready.readiness.state is State.SETTLING  # the new one may not know the way back (R4)
    assert ready.readiness.count == 2
    ready.readiness.answered()
    assert ready.news() == ["ready"]
    ready.match(B)
    assert ready.news() == [("lost", {A})]
    assert ready.readiness.ready


def test_a_server_comes_back(ready: World) -> None:
    ready.match()
    ready.match(A)
    ready.readiness.answered()
    assert ready.news() == [("lost", {A}), "ready"]


def test_a_graph_that_is_behind_while_a_server_settles(ready: World) -> None:
    ready.match()
    ready.news()
    ready.serve(A, B)  # the old one still shows
    ready.readiness.matched(1)
    ready.serve(B)
    ready.clock.advance(0.1)
    assert ready.readiness.servers == {B}
    assert ready.news() == [("lost", {A})]


def test_a_server_that_had_no_name_so_far_is_not_lost(world: World) -> None:
    world.readiness.matched(1)  # the graph does not show it yet
    world.readiness.answered()
    world.match(A, B)
    assert ("lost", {b"unnamed"}) not in world.news()


def test_a_server_that_had_no_name_so_far_is_not_new(world: World) -> None:
    world.readiness.matched(1)  # the graph does not show it yet
    world.readiness.answered()
    world.match(A)
    assert (world.readiness.servers, world.readiness.state) == ({A}, State.READY)
    assert world.news() == ["ready"]


def test_a_graph_that_is_behind_when_a_server_goes(ready: World) -> None:
    ready.match(A, B)
    ready.readiness.answered()
    ready.news()
    ready.readiness.matched(1)  # the graph still shows both
    ready.serve(B)
    ready.clock.advance(10)
    assert ready.news() == [("lost", {A})]


# --- another type on the name (R21) ------------------------------------------------------------


def test_another_type_is_told_once_a_second_while_somebody_waits(world: World) -> None:
    waiting = True
    world.serve(C, action_type="a/action/Other")
    world.readiness.look(lambda: waiting)
    world.readiness.look(lambda: waiting)
    assert world.news() == [("mismatch", ("a/action/Other",))]
    world.clock.advance(3.0)
    assert len(world.news()) == 3
    waiting = False
    world.clock.advance(10.0)
    assert world.news() == []
    assert len(world.clock.queue) == 0
    waiting = True
    world.readiness.look(lambda: waiting)
    assert len(world.news()) == 1


VERSIONS = ("goal RIHS01_1, here RIHS01_2",)
OTHER_VERSION = ("mismatch", (f"{OURS} (goal RIHS01_1, here RIHS01_2)",))


def test_a_server_with_another_version_of_the_type_is_never_ready(world: World) -> None:
    world.versions = VERSIONS
    world.match(A)
    assert world.news() == [OTHER_VERSION]
    world.readiness.look(lambda: True)  # somebody who comes later is told at once
    assert world.news() == [OTHER_VERSION]
    world.clock.advance(5.0)
    assert set(world.news()) == {OTHER_VERSION}
    world.readiness.answered()
    assert not world.probes
    assert not world.readiness.ready
    world.versions = ()  # it was replaced
    world.clock.advance(1.0 + HEAD_START + PATIENCE)
    assert world.news() == ["ready"]


def test_one_with_another_version_beside_the_right_one_gets_no_goals(ready: World) -> None:
    ready.versions = VERSIONS
    ready.match(A, B)
    assert ready.news() == [OTHER_VERSION]
    assert not ready.readiness.ready


def test_our_own_type_among_others_is_no_mismatch(world: World) -> None:
    other = Endpoint(C, "a/action/Other", "/node")
    world.graph = [Endpoint(A, OURS, "/node"), other]
    world.readiness.look(lambda: True)
    world.graph = []
    world.clock.advance(1.0)
    world.graph = None
    world.clock.advance(1.0)
    assert world.news() == []


def test_looking_ends_with_the_coming_of_a_server_and_with_close(world: World) -> None:
    world.readiness.look(lambda: True)
    world.match(A)
    world.readiness.answered()
    world.clock.advance(5.0)
    assert len(world.clock.queue) == 0
    world.match()
    world.readiness.look(lambda: True)
    world.readiness.close()
    world.clock.advance(5.0)
    assert len(world.clock.queue) == 0


def test_a_server_of_another_type_is_none_of_ours(ready: World) -> None:
    other = Endpoint(C, "a/action/Other", "/node")
    ready.graph = [Endpoint(A, OURS, "/node"), other]
    ready.readiness.matched(1)
    assert ready.readiness.servers == {A}
    assert ready.news() == []


def test_closing_ends_the_settling(world: World) -> None:
    world.match(A)
    world.readiness.close()
    world.clock.advance(10.0)
    assert world.news() == []
    assert len(world.clock.queue) == 0


def test_a_server_that_took_the_place_of_another_is_not_lost_with_it(world: World) -> None:
    """Both events are read as one, before the graph tells of either."""
    world.match(A)
    world.readiness.answered()
    world.news()
    world.readiness.matched(1, 1)
    assert world.readiness.state is State.SETTLING  # the new one does not know us yet
    assert world.readiness.servers == {A, b"unnamed"}
    world.readiness.answered()
    assert world.news() == ["ready"]
    sent_to = world.readiness.servers
    world.serve(B)
    world.clock.advance(2.0)
    assert world.readiness.servers == {B}
    lost = frozenset().union(*(gone for what, gone in world.news() if what == "lost"))
    assert lost == {A}
    assert sent_to - lost  # what was sent is with the new one


def test_a_graph_that_never_shows_who_came_is_not_waited_for(world: World) -> None:
    world.match(A)
    world.readiness.answered()
    world.readiness.matched(1, 1)
    world.clock.advance(30.0)
    assert world.readiness.servers == {A}
    assert len(world.clock.queue) == 0
    assert world.readiness.ready


def test_a_server_that_the_graph_shows_at_once_needs_no_name(world: World) -> None:
    world.serve(A)
    world.readiness.matched(1, 1)
    assert world.readiness.servers == {A}
    world.serve(A, B)
    world.readiness.matched(2, 1)
    assert world.readiness.servers == {A, B}


def test_a_server_that_the_graph_shows_before_its_event_is_counted_once(world: World) -> None:
    world.serve(A, B)
    world.readiness.matched(1, 1)
    world.readiness.answered()
    world.readiness.matched(2, 1)
    assert world.readiness.servers == {A, B}
    assert world.readiness.state is State.SETTLING  # the second one may not have discovered us
    world.readiness.answered()
    world.readiness.matched(2, 1)  # and one that takes the place of another counts all the same
    assert world.readiness.servers == {A, B, b"unnamed"}


# --- publishers of feedback that are not servers -----------------------------------------------


def test_a_player_is_no_server(world: World) -> None:
    world.play(C)
    world.readiness.matched(1, 1)
    assert (world.readiness.state, world.readiness.count) == (State.ABSENT, 0)
    assert not world.readiness.has_seen_servers
    world.clock.advance(11.0)
    assert (world.news(), world.probes, len(world.clock.queue)) == ([], [], 0)
    world.readiness.look(lambda: True)
    assert world.news() == []  # nor one of another type


def test_a_player_beside_a_server_changes_nothing(ready: World) -> None:
    ready.play(C)
    ready.readiness.matched(2, 1)
    assert (ready.readiness.servers, ready.readiness.count) == ({A}, 1)
    assert (ready.readiness.ready, ready.news()) == (True, [])
    ready.serve()
    ready.play(C)
    ready.readiness.matched(1)
    assert (ready.readiness.state, ready.news()) == (State.ABSENT, [("lost", {A})])


def test_a_server_is_lost_though_a_player_stays_and_the_graph_is_behind(ready: World) -> None:
    ready.play(C)
    ready.readiness.matched(2, 1)
    ready.readiness.matched(1)
    assert (ready.readiness.count, ready.readiness.state) == (1, State.SETTLING)
    ready.serve()
    ready.play(C)
    ready.clock.advance(0.01)
    assert (ready.readiness.count, ready.news()) == (0, [("lost", {A})])


def test_a_player_whose_event_is_ahead_of_the_graph_is_no_server_either(world: World) -> None:
    world.services = False
    world.readiness.matched(1, 1)
    assert world.readiness.count == 1  # it may be one
    world.play(C)
    world.clock.advance(11.0)
    assert (world.readiness.count, world.readiness.state) == (0, State.ABSENT)
    assert (world.probes, len(world.clock.queue)) == ([], 0)


@pytest.mark.parametrize("late", [0.5, 15.0])
def test_services_may_come_into_sight_after_the_feedback(late: float, world: World) -> None:
    world.play(A)
    world.readiness.matched(1, 1)
    world.readiness.look(lambda: not world.readiness.ready)
    world.clock.advance(late)
    world.serve(A)
    world.clock.advance(1.0 + HEAD_START)
    world.readiness.answered()
    assert world.news() == ["ready"]


def test_a_server_that_takes_the_place_of_a_player_is_seen(world: World) -> None:
    world.play(C)
    world.readiness.matched(1, 1)
    world.graph = []  # the player has gone, and the server does not show yet
    world.readiness.matched(1, 1)
    assert world.readiness.count == 1
    world.serve(A)
    world.clock.advance(HEAD_START)
    assert (world.readiness.servers, world.readiness.count) == ({A}, 1)
    assert world.probes


def test_a_player_that_the_graph_shows_and_that_is_not_matched_hides_no_server(
    ready: World,
) -> None:
    ready.play(C)  # its feedback may be best-effort
    ready.readiness.matched(1)
    assert (ready.readiness.servers, ready.readiness.count) == ({A}, 1)
    ready.readiness.answered()
    ready.clock.advance(11.0)
    assert (ready.readiness.ready, ready.news()) == (True, ["ready"])


@pytest.mark.parametrize(("middleware", "servers"), [("rmw_fastrtps_cpp", 0), ("rmw_zenoh_cpp", 1)])
def test_where_services_are_not_topics_each_publisher_counts_as_a_server(
    middleware: str, servers: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(graph, "middleware", lambda: middleware)
    publisher: Any = SimpleNamespace(
        endpoint_gid=bytes(24),
        topic_type="a/action/A_FeedbackMessage",
        node_name="node",
        node_namespace="/",
        qos_profile=SimpleNamespace(reliability=None),
    )
    node: Any = SimpleNamespace(
        get_publishers_info_by_topic=lambda _, no_mangle=False: [] if no_mangle else [publisher]
    )
    assert len(graph.servers(node, ActionNames.of("/a"))) == servers
