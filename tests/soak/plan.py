"""What is done in a round, as chance has it: the same seed, the same plan. Pure."""

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
]
_WAYS = ("ctrl_c", "term_close", "term_exit", "exit", "close")


@dataclass(frozen=True)
class Fault:
    """Something that is done to a server.

    Attributes:
        at: Seconds from the start of the round.
        kind: The name of its action.
        what: "kill" (SIGKILL, and a start), "restart" (a clean one), "stop" (SIGSTOP, SIGCONT).
        seconds: Until it is undone.
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
        way: How it comes to its end, of `tests.faults.attacks.WAYS`.
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
            seconds=chance.uniform(0.0, 4.0),
        )
        for what in theme
        if what in ("kill", "restart", "stop")
        for _ in range(chance.randint(1, 3))
    ]
    programs = [
        Program(
            at=chance.uniform(0.0, 0.5) * seconds,
            way=chance.choice(_WAYS),
            n=chance.randint(1, 80),
            life=chance.uniform(0.2, 3.0),
        )
        for what in theme
        if what == "programs"
    ]
    return Plan(
        seconds=seconds,
        seed=chance.randrange(2**31),
        faults=tuple(sorted(faults, key=lambda fault: fault.at)),
        programs=tuple(programs),
        loss=chance.choice([5, 10, 20]) if "loss" in theme and with_network else 0,
    )
