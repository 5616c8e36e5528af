"""A new node misses no answers, and is replaced where it seems to have missed some (C7.6)."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import pytest

from actionkit._ros import graph, joining
from actionkit._ros.joining import SWITCH
from actionkit._ros.rejoining import Rejoining
from tests.unit.clock import Clock

linux = pytest.mark.skipif(sys.platform != "linux", reason="what Linux can do")


# --- one core ----------------------------------------------------------------------------------


@dataclass
class Idle:
    """A thread that does nothing until the test ends."""

    end: threading.Event = field(default_factory=threading.Event)

    def __post_init__(self) -> None:
        self._thread = threading.Thread(target=self.end.wait, daemon=True)
        self._thread.start()
        assert self._thread.native_id is not None
        self.id = self._thread.native_id

    @property
    def state(self) -> tuple[set[int], int]:
        return os.sched_getaffinity(self.id), os.sched_getscheduler(self.id)


@pytest.fixture
def idle_threads() -> Iterator[list[Idle]]:
    threads: list[Idle] = []
    yield threads
    for thread in threads:
        thread.end.set()


def own_state() -> tuple[set[int], int]:
    return os.sched_getaffinity(0), os.sched_getscheduler(0)


@linux
def test_the_maker_and_what_it_starts_share_a_core_and_are_set_back(idle_threads, monkeypatch):
    monkeypatch.delenv(SWITCH, raising=False)
    before = own_state()
    with joining.joining():
        cores, policy = during = own_state()
        assert (len(cores), policy) == (1, os.SCHED_BATCH)
        assert cores <= before[0]
        idle_threads.append(Idle())
        assert idle_threads[0].state == during
    assert own_state() == before
    assert idle_threads[0].state == before


@linux
@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="needs two cores")
def test_threads_of_others_are_left_alone(idle_threads, monkeypatch):
    monkeypatch.delenv(SWITCH, raising=False)
    chosen: list[set[int]] = []
    begun, made = threading.Event(), threading.Event()

    def another() -> None:
        begun.wait()
        chosen.append({max(os.sched_getaffinity(0))})
        os.sched_setaffinity(0, chosen[0])  # of this thread, which its own threads inherit
        idle_threads.append(Idle())
        made.set()

    threading.Thread(target=another, daemon=True).start()
    with joining.joining():
        begun.set()
        assert made.wait(20)
    assert idle_threads[0].state == (chosen[0], os.SCHED_OTHER)


@linux
def test_an_error_in_the_making_goes_on_and_all_is_set_back(monkeypatch):
    monkeypatch.delenv(SWITCH, raising=False)
    before = own_state()
    with pytest.raises(LookupError), joining.joining():
        raise LookupError
    assert own_state() == before


@linux
@pytest.mark.parametrize(
    "forbidden", ["sched_setscheduler", "sched_setaffinity", "sched_getaffinity", "listdir"]
)
def test_where_the_system_forbids_it_nothing_happens(forbidden, monkeypatch):
    monkeypatch.delenv(SWITCH, raising=False)

    def refuse(*_: Any) -> None:
        raise PermissionError(forbidden)

    before = own_state()
    with monkeypatch.context() as patch:
        patch.setattr(os, forbidden, refuse)
        entering = joining.joining()
        entering.__enter__()
    assert own_state() == before
    entering.__exit__(None, None, None)
    assert own_state() == before


@linux
def test_a_real_time_thread_is_left_alone(monkeypatch):
    monkeypatch.delenv(SWITCH, raising=False)
    before = own_state()
    monkeypatch.setattr(os, "sched_getscheduler", lambda _: os.SCHED_FIFO)
    with joining.joining():
        assert os.sched_getaffinity(0) == before[0]


@pytest.mark.parametrize("system", ["darwin", "win32"])
def test_other_systems_are_left_alone(system, monkeypatch):
    monkeypatch.setattr(joining.sys, "platform", system)
    monkeypatch.setattr(joining, "_Alone", None)  # would raise
    with joining.joining():
        pass


@linux
@pytest.mark.parametrize(
    ("value", "wanted"), [("0", False), (" 0 ", False), ("1", True), ("", True)]
)
def test_the_switch(value, wanted, monkeypatch):
    monkeypatch.setenv(SWITCH, value)
    assert joining.is_wanted() == wanted
    before = own_state()
    with joining.joining():
        assert (own_state() != before) == wanted


# --- once more ---------------------------------------------------------------------------------


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
    """What the communication thread does for `Rejoining`."""

    def __init__(self) -> None:
        self.clock = Clock()
        self.events: list[str] = []
        self.failures: list[Exception] = []
        self.free = True
        self.took = 0.02
        self.rejoining = Rejoining(
            self.clock,
            can_leave=lambda links: self.free and links == len(self.rejoining.links),
            renew=self._renew,
            on_failure=self.failures.append,
        )
        self.link = self.add()
        self.rejoining.joined(self.took, 0.02)

    def add(self) -> FakeLink:
        link = FakeLink(self.events)
        self.rejoining.links[link] = None
        return link

    def _renew(self) -> Any:
        self.events.append("renew")
        self.rejoining.joined(self.took, 0.02)
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
    network.clock.advance(0.38)
    assert network.renewed == 1
    network.clock.advance(0.02)
    assert network.renewed == 2
    network.clock.advance(3600)
    assert network.renewed == 2
    assert len(network.clock.queue) == 0


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
    network.rejoining.links.clear()
    network.clock.advance(3600)
    assert network.renewed == 0


def test_a_busy_machine_gets_more_time(network):
    network.took = 0.04  # of which its thread had a core for half the time
    network.clock.advance(0.3)
    assert network.renewed == 1
    network.clock.advance(0.6)
    assert network.renewed == 1
    network.clock.advance(0.2)
    assert network.renewed == 2


def test_a_machine_that_stood_still_does_not_hold_it_up_for_ever(network):
    network.took = 100.0
    network.clock.advance(0.3)
    network.clock.advance(2.0)
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
