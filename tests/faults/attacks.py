"""The attacks of docs/maintainers/faults.md: the required rows."""

from __future__ import annotations

from dataclasses import dataclass

from tests.tables import Key

GIVEN_UP = "Many goals given up on at once"
DEAF = "The server does not answer"
RACE = "The deadline and the goal's own end come together"
LOSS = "Packets are lost"
JUDGES = "Callbacks that block, and a judge"
SOAK = "Everything at once, for an hour"
SOAK_TIME = "60 minutes"

#: How a client gives up on all its goals, with how it is written.
WAYS = {
    "cancel_all": "`cancel_all()`",
    "close": "`close()`",
    "with": "the end of the `with` block",
    "deadline": "all deadlines pass at the same time",
    "ctrl_c": "Ctrl-C in a blocking wait",
    "term_close": "SIGTERM, with a handler that calls `close()`",
    "term_exit": "SIGTERM, with a handler that calls `sys.exit()`",
    "exit": "the program ends without `close()`",
}
SIZES = (10, 100, 500, 1000)
#: What is too much for every run of the suite is done when the page is written.
ALWAYS = {(way, n) for way in WAYS for n in (10, 100)}
TEN_PROCESSES = "Ctrl-C in ten processes of 60 goals, all at the same time"
TWO_PRESSES = (
    "Ctrl-C once a second, until the program ends; the server takes a minute for each cancel"
)
DEAF_WAYS = ("close", "exit")
RACES = {
    "takes": "the server takes the cancel",
    "refuses": "the server refuses the cancel, and the goal ends a moment later",
}
CALLS = 300
LOSSES = (5, 10, 30)
LOSS_CALLS = 50
LOSS_CALLS_ALWAYS = 10
BLOCKED = (8, 80)
BLOCKS = {
    "callbacks": "feedback callbacks that block; `classify=` judges each result a failure",
    "handlers": "clients whose log handler blocks; `classify=` judges each result a failure",
}


@dataclass(frozen=True)
class Attack:
    """What was tried: in which table, what was done, with how many goals."""

    section: str
    what: str
    tried: str


@dataclass(frozen=True)
class Row:
    """What came of it.

    Attributes:
        attack: What was done.
        left: Goals that went on running though nobody waited for them, and nobody was told.
        wrong: Calls with an outcome that differs from the server's journal.
        delay: The longest delay in seconds; of what, the page says.
    """

    attack: Attack
    left: int
    wrong: int
    delay: float


def goals(n: int) -> str:
    return f"{n:,} goals"


def calls(n: int) -> str:
    return f"{n:,} calls"


def given_up(way: str, n: int) -> Attack:
    return Attack(GIVEN_UP, WAYS[way], goals(n))


def deaf(way: str) -> Attack:
    return Attack(DEAF, WAYS[way], goals(100))


def race(kind: str) -> Attack:
    return Attack(RACE, RACES[kind], calls(CALLS))


def loss(percent: int, n: int) -> Attack:
    return Attack(LOSS, f"{percent} % of all packets, in each direction", calls(n))


def blocked(kind: str, n: int) -> Attack:
    return Attack(JUDGES, f"{n} {BLOCKS[kind]}", calls(n))


def attacks() -> list[Attack]:
    """All that is tried, in the order of the page."""
    return [
        *(given_up(way, n) for way in WAYS for n in SIZES),
        Attack(GIVEN_UP, TEN_PROCESSES, goals(600)),
        Attack(GIVEN_UP, TWO_PRESSES, goals(100)),
        *(deaf(way) for way in DEAF_WAYS),
        *(race(kind) for kind in RACES),
        *(loss(percent, LOSS_CALLS) for percent in LOSSES),
        loss(max(LOSSES), LOSS_CALLS_ALWAYS),
        *(blocked(kind, n) for kind in BLOCKS for n in BLOCKED),
    ]


TABLES: dict[str, list[Key]] = {
    section: [(one.what, one.tried) for one in attacks() if one.section == section]
    for section in (GIVEN_UP, DEAF, RACE, LOSS, JUDGES)
} | {SOAK: [(SOAK_TIME,)]}
"""The keys of the rows of each table; the soak writes its own."""
