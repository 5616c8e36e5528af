"""Defines a mutant: one line of ActionKit made wrong, and the tests that must notice it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

SOURCE = "actionkit"


@dataclass(frozen=True)
class Mutant:
    """One line, or a few, made wrong.

    Attributes:
        promise: The number in `docs/promises.md` that it breaks.
        wrong: What ActionKit does wrong with it, as a clause: "a late acceptance is not cancelled".
        path: The file, below `actionkit/`.
        old: What is replaced there; it occurs once.
        new: What is put in its place.
        tests: Below `tests/`: one of these must fail.
        long: Whether only tests that take long notice it, which the promise's row then says.
    """

    promise: str
    wrong: str
    path: str
    old: str
    new: str
    tests: tuple[str, ...]
    long: bool = False

    def file(self, root: Path) -> Path:
        """Return its file in a checkout."""
        return root / SOURCE / self.path

    def problem(self, root: Path) -> str | None:
        """Say why it cannot be made in this checkout; `None` if it can."""
        file = self.file(root)
        if not file.is_file():
            return f"{self.wrong}: there is no file {SOURCE}/{self.path}"
        source = file.read_text("utf-8")
        if (count := source.count(self.old)) != 1:
            return f"{self.wrong}: {self.old!r} occurs {count} times in {SOURCE}/{self.path}"
        try:
            compile(source.replace(self.old, self.new), self.path, "exec")
        except SyntaxError as error:
            return f"{self.wrong}: it makes no Python of {SOURCE}/{self.path}: {error}"
        return None
