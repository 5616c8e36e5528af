"""The random plan of a round: the same seed gives the same plan. Pure."""

from __future__ import annotations

import random
from dataclasses import dataclass

from tests.soak.records import KINDS

#: What may be done to servers in a round; each list has its turn by chance.
_THEMES: list[tuple[str, ...]] = [
    (),
    ("kill",),
    ("restart",),
    ("stop",),
    ("kill", "restart", "stop"),
    ("programs",),
    ("programs", "programs"),
    ("programs", "stop"),
    ("programs", "kill"),
    ("loss",),
    ("loss", "restart"),
    ("loss", "programs"),
    ("duplicate",),
    ("twin", "stop"),
    ("duplicate", "twin", "kill"),
    ("linger",),
    ("vanish",),
    ("linger", "vanish", "restart"),
    ("children", "children", "children"),
    ("children", "programs", "stop"),
    ("loss", "duplicate", "linger"),
]
_FAULTS = ("kill", "restart", "stop", "duplicate", "twin", "linger", "vanish")
_WAYS = ("ctrl_c", "term_close", "term_exit", "exit", "close")
CHILDREN = tuple(
    f"{how}, {end}"
    for how in ("fork", "forkserver")
    for end in ("returns", "raises", "exits", "pool")
)
"""How the children of a program are made, and how they end: see `tests.soak.children`."""
BEYOND_LEASE = 24.0
"""Seconds after which the middleware drops a server that hangs; it does so after about 20."""
STAYS = 1000.0
"""Seconds of a fault that is not undone before the end of the round."""


@dataclass(frozen=True)
class Fault:
    """Something that is done to a server.

    Attributes:
        at: Seconds from the start of the round.
        kind: The name of its action.
        what: "kill" (SIGKILL, and a start), "restart" (a clean one), "stop" (SIGSTOP, SIGCONT);
            "duplicate" (a second server serves the same name), "twin" (with the same name of its
            node, too); "linger" (SIGSTOP, another server takes its place, SIGCONT), "vanish" (its
            action server is destroyed, and another process takes its place: it lives on).
        seconds: Until it is undone, or `STAYS`.
    """

    at: float
    kind: str
    what: str
    seconds: float


@dataclass(frozen=True)
class Program:
    """A program with goals of its own, which is told to end.

    Attributes:
        at: Seconds from the start of the round.
        way: How it comes to its end, of `tests.faults.attacks.WAYS`, or of `CHILDREN`.
        n: How many goals it sends to the server "endless".
        life: Seconds from its first goal until it is told.
    """

    at: float
    way: str
    n: int
    life: float


@dataclass(frozen=True)
class Plan:
    """What is done in a round.

    Attributes:
        seconds: For which calls are made.
        seed: Of the calls.
        faults: In the order of their times.
        programs: Those that come and are told to end.
        loss: Percent of the packets lost, where there is a network.
    """

    seconds: float
    seed: int
    faults: tuple[Fault, ...]
    programs: tuple[Program, ...]
    loss: int

    @property
    def text(self) -> str:
        """In a few words."""
        parts = [f"{fault.what} {fault.kind}" for fault in self.faults]
        parts += [f"{one.way} {one.n}" for one in self.programs]
        parts += [f"{self.loss} % loss"] if self.loss else []
        return ", ".join(parts) or "nothing"


def make(seed: int, number: int, seconds: float, *, with_network: bool) -> Plan:
    """Make the plan of a round.

    Args:
        seed: Of the soak.
        number: Of the round.
        seconds: For which calls are made.
        with_network: Whether packets can be lost.
    """
    chance = random.Random(f"{seed}/{number}")
    theme = chance.choice(_THEMES)
    faults = [
        Fault(
            at=chance.uniform(0.1, 0.7) * seconds,
            kind=chance.choice(list(KINDS)),
            what=what,
            seconds=_seconds(chance, what),
        )
        for what in theme
        if what in _FAULTS
        for _ in range(chance.randint(1, 3))
    ]
    programs = [
        Program(
            at=chance.uniform(0.0, 0.5) * seconds,
            way=chance.choice(CHILDREN if what == "children" else _WAYS),
            n=chance.randint(1, 80),
            life=chance.uniform(0.2, 3.0),
        )
        for what in theme
        if what in ("programs", "children")
    ]
    return Plan(
        seconds=seconds,
        seed=chance.randrange(2**31),
        faults=tuple(sorted(faults, key=lambda fault: fault.at)),
        programs=tuple(programs),
        loss=chance.choice([5, 10, 20]) if "loss" in theme and with_network else 0,
    )


def _seconds(chance: random.Random, what: str) -> float:
    """Until a fault is undone: short, or, of those that come to stay, for long."""
    if what in ("duplicate", "twin") and chance.random() < 0.5:
        return STAYS
    if what == "linger" and chance.random() < 0.2:
        return BEYOND_LEASE
    return chance.uniform(0.0, 4.0 if what in ("kill", "restart", "stop") else 10.0)
