"""Visits every state of a world of machines and servers, those that are reached soonest first."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import Any, Protocol

from typing_extensions import Self


class Broken(Exception):
    """A promise does not hold."""


class World(Protocol):
    """What can be explored."""

    def key(self) -> tuple[Any, ...]:
        """Return what the future depends on."""

    def events(self) -> Iterable[tuple[str, Any]]:
        """Return what can happen now."""

    def happens(self, event: str, arg: Any) -> None: ...
    def copy(self) -> Self: ...
    def check(self) -> None:
        """Raise `Broken` if a promise does not hold."""


def step_of(event: tuple[str, Any]) -> str:
    """Return an event as text."""
    name, arg = event
    return name if arg is None else f"{name} {arg}"


def explore(first: World, most: int = 2_000_000) -> tuple[int, int]:
    """Return how many states and transitions there are. Raise `Broken` with the shortest way."""
    parents: dict[Any, Any] = {first.key(): None}
    queue, transitions = deque([(first, first.key())]), 0
    while queue:
        world, key = queue.popleft()
        for event in list(world.events()):
            after = world.copy()
            transitions += 1
            try:
                after.happens(*event)
                new = after.key()
                if new in parents:
                    continue
                after.check()
            except Broken as problem:
                way = [step_of(event)]
                while parents[key]:
                    key, before = parents[key]
                    way.append(before)
                raise Broken(f"{problem}\n   after: " + "; ".join(reversed(way))) from None
            parents[new] = key, step_of(event)
            queue.append((after, new))
            if len(parents) >= most:
                return len(parents), transitions
    return len(parents), transitions
