"""The findings of `actionkit doctor`: each has a remedy, unless all is well."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Level = Literal["ok", "note", "problem"]


@dataclass(frozen=True)
class Finding:
    """One result of `actionkit doctor`.

    Attributes:
        level: `"ok"`; `"note"`: it may be on purpose, or the reason why a call does not work;
            `"problem"`: something does not work.
        topic: A word or two.
        text: What was found.
        remedy: What to do about it; only `"ok"` has none.
    """

    level: Level
    topic: str
    text: str
    remedy: str = ""

    def __post_init__(self) -> None:
        if self.level != "ok" and not self.remedy:
            raise ValueError(f"a finding without a remedy: {self}")


def ok(topic: str, text: str) -> Finding:
    """Return a finding that is all right."""
    return Finding("ok", topic, text)


def note(topic: str, text: str, remedy: str) -> Finding:
    """Return a finding that may be why a call does not work."""
    return Finding("note", topic, text, remedy)


def problem(topic: str, text: str, remedy: str) -> Finding:
    """Return a finding of something that does not work."""
    return Finding("problem", topic, text, remedy)
