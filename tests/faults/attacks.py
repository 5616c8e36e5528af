"""The table of docs/attacks.md: which rows there have to be, how they are written and read."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

PATH = Path(__file__).parents[2] / "docs" / "attacks.md"

GIVEN_UP = "Many goals given up on at once"
DEAF = "The server does not answer"
RACE = "The deadline and the goal's own end come together"
LOSS = "Packets are lost"
JUDGES = "Callbacks that block, and a judge"
SOAK = "Everything at once, for an hour"

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
ALWAYS = {(way, n) for way in WAYS for n in (10, 100)} | {("close", 1000), ("ctrl_c", 1000)}
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

#: Seconds, of which the first with room to spare is written: times differ from run to run.
_BOUNDS = (5, 10, 20, 30, 45, 60, 110)
_ROOM = 2.0
_HEAD = ("what was done", "tried", "left running", "wrong outcomes", "longest delay")


@dataclass(frozen=True)
class Attack:
    """One row's first cells: under which heading, what was done, with how many goals."""

    section: str
    what: str
    tried: str


@dataclass(frozen=True)
class Row:
    """What came of it.

    Attributes:
        attack: What was done.
        left: Goals that went on running though nobody waited for them, and nobody was told.
        wrong: Calls whose outcome is not what the server's journal shows.
        delay: The longest delay in seconds; of what, the section says.
    """

    attack: Attack
    left: int
    wrong: int
    delay: float

    @property
    def bound(self) -> float:
        """The delay as it is written: no later run may take longer."""
        return next((b for b in _BOUNDS if self.delay * _ROOM <= b), float(round(self.delay * 2)))

    @property
    def line(self) -> str:
        what = self.attack
        cells = (what.what, what.tried, str(self.left), str(self.wrong), f"< {self.bound:g} s")
        return "| " + " | ".join(cells) + " |"


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
    """All rows that there have to be, in order; that of the soak is written by the soak."""
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


def read(text: str) -> dict[Attack, float]:
    """The rows of a page, with the bounds of their delays.

    Raises:
        ValueError: The page tells of a goal that was left running, or of a wrong outcome.
    """
    found = {}
    section = ""
    for line in text.splitlines():
        if line.startswith("## "):
            section = line.removeprefix("## ")
        cells = [cell.strip() for cell in line.split("|")[1:-1]]
        if len(cells) != len(_HEAD) or cells[0] in (_HEAD[0], "---"):
            continue
        what, tried, left, wrong, delay = cells
        number = re.fullmatch(r"< (\d+) s", delay)
        if (left, wrong) != ("0", "0") or number is None:
            raise ValueError(f"docs/attacks.md must not say: {line}")
        found[Attack(section, what, tried)] = float(number[1])
    return found


def differs(row: Row, written: dict[Attack, float]) -> str:
    """How an observed row is not what the page says; `""` where it is."""
    if row.attack not in written:
        return "it is not on the page"
    if row.delay > written[row.attack]:
        return f"it took {row.delay:.1f} s, and the page says < {written[row.attack]:g} s"
    return ""


def merge(rows: Iterable[Row], text: str) -> str:
    """The page with new rows in place of its old ones; what was not tried anew stays."""
    from tests.faults.attacks_page import EXPLAINED, INTRO

    known = {
        attack: replace(Row(attack, 0, 0, 0.0), delay=bound / _ROOM)
        for attack, bound in read(text).items()
    }
    known |= {row.attack: row for row in rows}
    # Those that the tests know, in their order, and the soak's.
    order = [*attacks(), *(attack for attack in known if attack.section == SOAK)]
    parts = [INTRO.strip()]
    for section, explanation in EXPLAINED.items():
        lines = ["| " + " | ".join(_HEAD) + " |", "|---" * len(_HEAD) + "|"]
        of_section = (attack for attack in order if attack.section == section)
        lines += [known[attack].line for attack in of_section if attack in known]
        parts.append(f"## {section}\n\n{explanation.strip()}\n\n" + "\n".join(lines))
    return "\n\n".join(parts) + "\n"
