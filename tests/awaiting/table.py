"""The table of docs/awaiting.md: written by the tests of this folder, and read back by them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

PATH = Path(__file__).parents[2] / "docs" / "awaiting.md"
_HEAD = ("form", "works", "when it is cancelled: what reached the server")


@dataclass(frozen=True)
class Form:
    """One way to await a goal: under which heading, and what is written in the code."""

    section: str
    code: str


@dataclass(frozen=True)
class Row:
    """What came of it.

    Attributes:
        form: How the goal was awaited.
        works: "yes", or the error.
        reached: What reached the server when the wait was cancelled or refused.
    """

    form: Form
    works: str
    reached: str

    @property
    def line(self) -> str:
        return "| " + " | ".join((self.form.code, self.works, self.reached)) + " |"


def read(text: str) -> dict[Form, Row]:
    """The rows of a page."""
    found = {}
    section = ""
    for line in text.splitlines():
        if line.startswith("## "):
            section = line.removeprefix("## ")
        cells = [cell.strip() for cell in line.split("|")[1:-1]]
        if len(cells) == len(_HEAD) and cells[0] not in (_HEAD[0], "---"):
            form = Form(section, cells[0])
            found[form] = Row(form, cells[1], cells[2])
    return found


def merge(rows: Iterable[Row], text: str) -> str:
    """The page with new rows in place of its old ones; what was not tried anew stays."""
    from tests.awaiting.page import CLOSING, FORMS, INTRO, SECTIONS

    known = read(text) | {row.form: row for row in rows}
    parts = [INTRO.strip()]
    for section, explanation in SECTIONS.items():
        lines = ["| " + " | ".join(_HEAD) + " |", "|---" * len(_HEAD) + "|"]
        lines += [known[form].line for form in FORMS if form.section == section and form in known]
        parts.append(f"## {section}\n\n{explanation.strip()}\n\n" + "\n".join(lines))
    return "\n\n".join([*parts, CLOSING.strip()]) + "\n"
