"""The table of docs/faults.md: written by the tests of this folder, and read back by them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

PATH = Path(__file__).parents[2] / "docs" / "faults.md"

#: Seconds, each with how it is written. Times differ from run to run: what is written is a
#: bound with room to spare, and no run may exceed it.
_BOUNDS = {2.0: "< 2 s", 4.0: "< 4 s", 15.0: "< 15 s", 40.0: "about 20 s"}
_ROOM = 1.9
_NEVER = "-"
_WITH_UNKNOWN = "result, goal UNKNOWN, attempt 2"

_HEAD = (
    "policy",
    "outcome",
    "noticed after",
    "executed",
    "at one time",
    "left running",
)


@dataclass(frozen=True)
class Case:
    """One call: which fault strikes it, when, and what it may do about it."""

    fault: str
    phase: str
    policy: str


_OUTAGE = "Network outage, longer than the lease"
VARIES = {
    Case("SIGSTOP, SIGCONT", "before accept", "always"),
    Case(_OUTAGE, "executing, no feedback", "always"),
    Case(_OUTAGE, "during feedback", "always"),
}
"""Chance decides whether the first goal confirms its end before the second one's result comes."""


@dataclass(frozen=True)
class Row:
    """What came of it.

    Attributes:
        case: What was done.
        outcome: How the call ended, in a few words.
        noticed: Seconds from the fault until the client knew; `None` where it did not need to.
        executed: How many goals of the call began to execute on the server.
        at_once: The most of them that executed at one time.
        left: How many of them were left running.
    """

    case: Case
    outcome: str
    noticed: float | None
    executed: int
    at_once: int
    left: int


@dataclass(frozen=True)
class Written:
    """A row as it is written."""

    outcome: str
    noticed: str
    executed: str
    at_once: str
    left: str

    @classmethod
    def of(cls, row: Row) -> Written:
        noticed = _NEVER
        if row.noticed is not None:
            noticed = next(
                (text for bound, text in _BOUNDS.items() if row.noticed * _ROOM <= bound),
                f"{row.noticed:.0f} s",
            )
        outcome, executed, at_once = row.outcome, str(row.executed), str(row.at_once)
        if row.case.policy == "always" and outcome.startswith("result, attempt"):
            # Whether the goal or a later one comes first is a matter of chance.
            executed = at_once = f"up to {outcome.split()[-1]}"
        if row.case in VARIES and outcome in ("result, attempt 2", _WITH_UNKNOWN):
            outcome, executed, at_once = "result, goal varies, attempt 2", "up to 2", "up to 2"
        return cls(outcome, noticed, executed, at_once, str(row.left))

    def differs(self, row: Row) -> str:
        """How an observed row is not what is written here; `""` where it is."""
        seen = Written.of(row)
        wrong = [
            f"{name} is {getattr(seen, name)}, and was {getattr(self, name)}"
            for name in ("outcome", "executed", "at_once", "left")
            if getattr(self, name) != getattr(seen, name)
        ]
        bound = {text: bound for bound, text in _BOUNDS.items()}.get(self.noticed)
        if (row.noticed is None) != (bound is None):
            wrong.append(f"noticed after {row.noticed} s, and was {self.noticed}")
        elif row.noticed is not None and bound is not None and row.noticed > bound:
            wrong.append(f"noticed after {row.noticed:.1f} s, and was {self.noticed}")
        return "; ".join(wrong)


def render(intro: str, explained: dict[str, str], rows: Iterable[Row]) -> str:
    """The page.

    Args:
        intro: What stands above.
        explained: Each fault, in the order of the page, with what is done.
        rows: All rows, those of a phase together.
    """
    found = list(rows)
    parts = [intro.strip()]
    for fault, text in explained.items():
        parts.append(f"## {fault}\n\n{text.strip()}")
        lines = [_line(("phase", *_HEAD)), "|---" * (len(_HEAD) + 1) + "|"]
        for phase, of_phase in groupby(
            (row for row in found if row.case.fault == fault), key=lambda row: row.case.phase
        ):
            # Policies that come to the same share a line.
            same: dict[Written, list[str]] = {}
            for row in of_phase:
                same.setdefault(Written.of(row), []).append(row.case.policy)
            for written, policies in same.items():
                cells = (written.outcome, written.noticed, written.executed, written.at_once)
                lines.append(_line((phase, "; ".join(policies), *cells, written.left)))
        parts.append("\n".join(lines))
    return "\n\n".join(parts) + "\n"


def read(text: str) -> dict[Case, Written]:
    """The rows of a page."""
    found: dict[Case, Written] = {}
    fault = ""
    for line in text.splitlines():
        if line.startswith("## "):
            fault = line.removeprefix("## ")
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        if len(cells) != len(_HEAD) + 1 or cells[0] in ("phase", "---"):
            continue
        for policy in cells[1].split("; "):
            found[Case(fault, cells[0], policy)] = Written(*cells[2:])
    return found


def _line(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cells) + " |"
