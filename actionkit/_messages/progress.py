"""Reads the progress of a goal from a field of its feedback. Pure: no clock, no terminal."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

from actionkit._messages.paths import field_type, get_field, message_class, slots_of
from actionkit._model.field_errors import FieldError

_DONE = "progress|complete|completed|completion|done"
_PERCENT = re.compile(rf"(({_DONE})_)?(percent|percentage|pct)(_({_DONE}))?")
_SHARE = re.compile(r"(^|_)(progress|fraction|completion|completed_ratio|ratio)$")
_REMAINING = re.compile(r"(^|_)((remaining|remains|to_go)($|_)|left$)")
_NUMBER = re.compile(r"u?int(8|16|32|64)|float|double")
_DURATIONS = ("builtin_interfaces/Duration", "builtin_interfaces/msg/Duration")
_DEEP = 3
"""Levels of nested messages that are searched; deeper fields are seldom about the whole goal."""
_KINDS = ("percent", "share", "remaining")


@dataclass(frozen=True)
class Field:
    """The field that has the progress, and how to read it.

    `kind` is `"percent"` (from 0 to 100), `"share"` (from 0 to 1, or to 100 if a value exceeds 1),
    `"remaining"` (down to 0), or `"count"` (up to `total`).
    """

    path: str
    kind: str
    total: float = 0.0


def chosen(text: str, feedback_class: type) -> Field:
    """Return the field that a user named.

    `text` is `PATH`, `PATH:percent`, `PATH:share`, `PATH:remaining`, or `PATH:20` for a field that
    counts up to 20. An array counts by its length.

    Raises:
        ValueError: There is no such field, it cannot be read so, or the word is unknown.
    """
    path, _, word = text.partition(":")
    kind = field_type(feedback_class, path)  # its FieldError is a ValueError
    array = kind.endswith("]") or kind.startswith("sequence")
    if not (array or _is_number(kind)):
        raise ValueError(f"{path} is a {kind}, which is no number, duration or array")
    if word in _KINDS:
        return Field(path, word)
    if not word:
        return Field(path, _kind_of(path.rsplit(".", 1)[-1]) or "percent")
    try:
        total = float(word)
    except ValueError:
        total = 0.0
    if not 0 < total < math.inf:
        raise ValueError(f"{word!r} must be percent, share, remaining, or the number it counts to")
    return Field(path, "count", total)


def found(feedback_class: type) -> Field | None:
    """Return the outermost field with a name for progress, or `None`."""
    level: list[tuple[str, type]] = [("", feedback_class)]
    for _ in range(_DEEP):
        candidates: list[Field] = []
        below: list[tuple[str, type]] = []
        for prefix, cls in level:
            for name, (slot, text) in slots_of(cls).items():
                path = prefix + name
                kind = _kind_of(name)
                if kind is not None and _is_number(text):
                    candidates.append(Field(path, kind))
                elif hasattr(slot, "namespaces"):
                    below.append((f"{path}.", message_class(slot)))
        if candidates:
            # A percentage is better than a remaining value, which may grow; a distance is better
            # than a time.
            order = {"percent": 0, "share": 1, "remaining": 2}
            return min(candidates, key=lambda field: (order[field.kind], "time" in field.path))
        level = below
    return None


def _kind_of(name: str) -> str | None:
    name = name.lower()
    if _REMAINING.search(name):
        return "remaining"
    if _PERCENT.fullmatch(name):
        return "percent"
    return "share" if _SHARE.search(name) else None


def _is_number(text: str) -> bool:
    return _NUMBER.fullmatch(text) is not None or text in _DURATIONS


class Progress:
    """Computes from each feedback how much is done."""

    def __init__(self, field: Field) -> None:
        self.field = field
        self._largest = 0.0

    def share(self, feedback: Any) -> float | None:
        """Return how much is done, 0 to 1; `None` if the feedback does not say."""
        try:
            value = get_field(feedback, self.field.path)
        except FieldError:  # the array is still too short
            return None
        value = _number(value)
        if not math.isfinite(value):
            return None
        self._largest = max(self._largest, value)
        if self.field.kind == "remaining":
            # The largest value is the whole way. nav2 reports 0 until it has a path.
            share = 1 - value / self._largest if self._largest > 0 else None
        elif self.field.kind == "count":
            share = value / self.field.total
        elif self.field.kind == "share" and self._largest <= 1:
            share = value
        else:
            share = value / 100
        return None if share is None else min(1.0, max(0.0, share))


def _number(value: Any) -> float:
    if hasattr(value, "nanosec"):
        return float(value.sec) + float(value.nanosec) * 1e-9
    return float(len(value)) if hasattr(value, "__len__") else float(value)
