"""The table of docs/agents-faults.md: written by the tests of this folder, and read by them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

PATH = Path(__file__).parents[3] / "docs" / "agents-faults.md"
HEAD = (
    "fault",
    "over",
    "what reached the action server",
    "what the agent was told",
    "`actionkit mcp`",
)


@dataclass(frozen=True)
class Case:
    """A fault, and how the agent that it strikes talks to the robot."""

    group: str
    fault: str
    over: str


@dataclass(frozen=True)
class Row:
    """What came of it.

    Attributes:
        case: What was done.
        reached: What reached the action server.
        told: What the agent was told.
        process: What became of the process that serves.
    """

    case: Case
    reached: str
    told: str
    process: str = "serves on"

    @property
    def seen(self) -> tuple[str, str, str]:
        return self.reached, self.told, self.process


def render(intro: str, groups: dict[str, str], rows: Iterable[Row]) -> str:
    """The page.

    Args:
        intro: What stands above.
        groups: The headings, each with its text, in order.
        rows: All rows, in order.
    """
    found = list(rows)
    parts = [intro.strip()]
    for group, text in groups.items():
        parts.append(f"## {group}\n\n{text.strip()}")
        lines = [_line(HEAD), "|---" * len(HEAD) + "|"]
        same: dict[tuple[str, tuple[str, str, str]], list[str]] = {}
        for row in found:
            if row.case.group == group:
                same.setdefault((row.case.fault, row.seen), []).append(row.case.over)
        for (fault, seen), over in same.items():
            lines.append(_line((fault, "; ".join(over), *seen)))
        parts.append("\n".join(lines))
    return "\n\n".join(parts) + "\n"


def read(text: str) -> dict[Case, tuple[str, str, str]]:
    """The rows of a page."""
    found: dict[Case, tuple[str, str, str]] = {}
    group = ""
    for line in text.splitlines():
        if line.startswith("## "):
            group = line.removeprefix("## ")
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        if len(cells) != len(HEAD) or cells[0] in (HEAD[0], "---"):
            continue
        for over in cells[1].split("; "):
            reached, told, process = cells[2:]
            found[Case(group, cells[0], over)] = (reached, told, process)
    return found


def _line(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cells) + " |"
