"""When a closed client lets go of its place on the communication thread."""

from __future__ import annotations

import threading
import time
from types import SimpleNamespace
from typing import Any

from actionkit._calls.carrier import LINGER, PortCarrier
from tests.unit.clock import Clock


class Link:
    """Goals that are being cancelled on a second server, or not."""

    def __init__(self) -> None:
        self.cancels_orphans = True

    def on_orphans_gone(self, callback: Any) -> None:
        self.tell = callback


class World(Clock):
    """A carrier over a port on which nothing is in flight."""

    def __init__(self) -> None:
        super().__init__()
        self.time = time.monotonic()
        self.link = Link()
        self.freed = threading.Event()
        self.port = SimpleNamespace(
            identity=SimpleNamespace(action_name="/arm", type_name="some/action/Arm"),
            link=self.link,
            freed=self.freed,
            free=self.freed.set,
            decode_feedback=None,
            call_soon=lambda callback: callback(),
            call_at=self.call_at,
            cancel_timer=self.queue.cancel,
            on_failure=lambda callback: None,
            end_waits=lambda: None,
        )
        self.carrier = PortCarrier(self.port, on_freed=lambda: None)  # type: ignore[arg-type]


def test_it_stays_while_goals_are_cancelled_on_a_second_server() -> None:
    world = World()
    world.carrier.retire()
    assert world.carrier.retired.is_set()  # whoever closes does not wait for it
    assert not world.freed.is_set()
    world.link.cancels_orphans = False
    world.link.tell()
    assert world.freed.is_set()


def test_but_not_for_ever() -> None:
    world = World()
    world.carrier.retire()
    world.link.tell()
    assert not world.freed.is_set()
    world.advance(LINGER + 1)
    assert world.freed.is_set()


def test_nothing_keeps_it_otherwise() -> None:
    world = World()
    world.link.cancels_orphans = False
    world.link.tell()  # while it is in use
    assert not world.freed.is_set()
    world.carrier.retire()
    assert world.freed.is_set()


def test_what_was_freed_is_held_by_no_timer() -> None:
    """Else each closed client stays in memory for as long as its timer runs."""
    world = World()
    world.carrier.retire()
    assert len(world.queue) == 1
    world.link.cancels_orphans = False
    world.link.tell()
    assert world.freed.is_set()
    assert len(world.queue) == 0


def test_what_is_freed_at_once_arms_no_timer() -> None:
    world = World()
    world.link.cancels_orphans = False
    world.carrier.retire()
    assert world.freed.is_set()
    assert len(world.queue) == 0
