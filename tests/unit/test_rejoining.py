"""A node that seems to have missed the servers that are there is replaced (C7.6)."""

from __future__ import annotations

from typing import Any

import pytest

from actionkit._ros.endpoints import graph
from actionkit._ros.workarounds.node_replacement import SWITCH, NodeReplacement, is_wanted
from tests.unit.clock import Clock


class FakeLink:
    def __init__(self, events: list[str]) -> None:
        self.seen = False
        self.refuses = False
        self._events = events

    def has_seen_servers(self) -> bool:
        return self.seen

    def leave(self) -> None:
        self._events.append("leave")

    def enter(self, node: Any) -> None:
        if self.refuses:
            raise RuntimeError("for the test")
        self._events.append(f"enter {node}")


class Graph:
    """What the communication thread does for `NodeReplacement`."""

    def __init__(self) -> None:
        self.clock = Clock()
        self.events: list[str] = []
        self.failures: list[Exception] = []
        self.free = True
        self.alone = False
        self.took = 0.02
        self.node_replacement = NodeReplacement(
            self.clock,
            can_leave=lambda links: self.free and links == len(self.node_replacement.links),
            is_alone=lambda: self.alone,
            renew=self._renew,
            on_failure=self.failures.append,
        )
        self.link = self.add()
        self.node_replacement.joined(self.took, 0.02)

    def add(self) -> FakeLink:
        link = FakeLink(self.events)
        self.node_replacement.links[link] = None
        return link

    def _renew(self) -> Any:
        self.events.append("renew")
        self.node_replacement.joined(self.took, 0.02)
        return "node"

    @property
    def renewed(self) -> int:
        return self.events.count("renew")


@pytest.fixture
def network(monkeypatch: pytest.MonkeyPatch) -> Graph:
    monkeypatch.delenv(SWITCH, raising=False)
    return Graph()


def test_who_sees_no_server_enters_the_graph_anew_twice_and_no_more(network):
    network.add()
    network.clock.advance(0.19)
    assert network.events == []
    network.clock.advance(0.02)
    assert network.events == ["leave", "leave", "renew", "enter node", "enter node"]
    network.clock.advance(0.18)
    assert network.renewed == 1
    network.clock.advance(0.02)
    assert network.renewed == 2
    network.clock.advance(3600)
    assert network.renewed == 2
    assert len(network.clock.queue) == 0


def test_who_sees_no_node_at_all_tries_more_often_for_a_second(network):
    network.alone = True
    network.clock.advance(1.1)
    assert network.renewed == 6
    network.clock.advance(3600)
    assert network.renewed == 6
    assert len(network.clock.queue) == 0


def test_who_sees_another_node_later_tries_no_more(network):
    network.alone = True
    network.clock.advance(0.8)
    tried = network.renewed
    network.alone = False
    network.clock.advance(3600)
    assert network.renewed == tried > 2


def test_who_has_seen_a_server_stays_for_good(network):
    network.add().seen = True
    network.clock.advance(3600)
    assert network.events == []
    assert len(network.clock.queue) == 0


def test_a_server_seen_after_the_first_try_ends_it(network):
    network.clock.advance(0.3)
    network.link.seen = True
    network.clock.advance(3600)
    assert network.renewed == 1


def test_while_the_node_is_in_use_it_stays(network):
    network.free = False
    network.clock.advance(0.5)
    network.free = True
    network.clock.advance(0.2)
    assert network.renewed == 1


def test_a_node_that_stays_in_use_is_looked_at_a_few_times_only(network):
    network.free = False
    network.clock.advance(3600)
    network.free = True
    network.clock.advance(3600)
    assert network.renewed == 0
    assert len(network.clock.queue) == 0


def test_without_clients_the_node_stays(network):
    network.node_replacement.links.clear()
    network.clock.advance(3600)
    assert network.renewed == 0


def test_a_busy_machine_gets_more_time(network):
    network.took = 0.04  # of which its thread had a core for half the time
    network.clock.advance(0.21)
    assert network.renewed == 1
    network.clock.advance(0.38)
    assert network.renewed == 1
    network.clock.advance(0.02)
    assert network.renewed == 2


def test_a_machine_that_stood_still_does_not_hold_it_up_for_ever(network):
    network.took = 100.0
    network.clock.advance(0.3)
    network.clock.advance(1.0)
    assert network.renewed == 2


def test_a_failure_is_told_and_leaves_nothing_half_made(network):
    network.add().refuses = True
    network.clock.advance(3600)
    assert [str(error) for error in network.failures] == ["for the test"]
    assert network.renewed == 1
    assert network.events[-2:] == ["leave", "leave"]
    assert len(network.clock.queue) == 0


@pytest.mark.parametrize("why", ["the switch", "another middleware"])
def test_not_everywhere(why, monkeypatch):
    monkeypatch.setenv(SWITCH, "0" if why == "the switch" else "1")
    if why == "another middleware":
        monkeypatch.setattr(graph, "middleware", lambda: "rmw_cyclonedds_cpp")
    network = Graph()
    network.clock.advance(3600)
    assert network.renewed == 0


@pytest.mark.parametrize(
    ("value", "wanted"), [("0", False), (" 0 ", False), ("1", True), ("", True)]
)
def test_the_switch(value, wanted, monkeypatch):
    monkeypatch.setenv(SWITCH, value)
    assert is_wanted() == wanted
