"""Reading plain values out of a configuration, noting what is wrong with its place."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from actionkit._model.field_errors import shown
from actionkit._model.similar_names import similar_names
from actionkit.agents._values import ConfigError


class Reader:
    """Notes every problem; each method returns something of the right type all the same.

    Attributes:
        problems: What was found to be wrong.
    """

    def __init__(self, source: str) -> None:
        self.problems: list[str] = []
        self._source = source

    def add(self, place: str, problem: str) -> None:
        """Note a problem at a place, such as `tools.navigate.timeout`."""
        self.problems.append(": ".join(filter(None, (self._source, place, problem))))

    def raise_problems(self) -> None:
        """Raise if anything is wrong.

        Raises:
            ConfigError: It is.
        """
        if self.problems:
            raise ConfigError(tuple(self.problems))

    def table(self, place: str, value: object, known: Sequence[str]) -> Mapping[str, Any]:
        """Return a table; a key that is not known is a problem."""
        if not isinstance(value, Mapping):
            self.add(place, f"{shown(value)} must be a table")
            return {}
        for key in value:
            if key not in known:
                near = similar_names(str(key), known)
                hint = f"did you mean {near[0]!r}? " if near else ""
                path = f"{place}.{key}" if place else str(key)
                self.add(path, f"there is no such key; {hint}the keys are: {', '.join(known)}")
        return value

    def tables(self, place: str, value: object) -> list[tuple[str, object]]:
        """Return what a table of tables holds, by name; nothing where it is left out."""
        if value is None:
            return []
        if not isinstance(value, Mapping):
            self.add(place, f"{shown(value)} must be a table, as in [{place}.NAME]")
            return []
        found = []
        for name, one in value.items():
            if isinstance(name, str):
                found.append((name, one))
            else:
                self.add(place, f"the name {shown(name)} must be a string")
        return found

    def text(self, place: str, value: object, *, needed: bool = False) -> str:
        """Return a string, `""` where it is left out."""
        if value is None and not needed:
            return ""
        if value is None:
            self.add(place, "is missing")
            return ""
        if not isinstance(value, str) or (needed and not value):
            self.add(place, f"{shown(value)} must be a string" + (", not empty" if needed else ""))
            return ""
        return value

    def whole(self, place: str, value: object, low: int, high: int) -> int | None:
        """Return a whole number, `None` where it is left out."""
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            self.add(place, f"{shown(value)} must be a whole number from {low} to {high}")
            return None
        return value

    def number(self, place: str, value: object, low: float, high: float) -> float | None:
        """Return a number, `None` where it is left out."""
        if value is None:
            return None
        wrong = isinstance(value, bool) or not isinstance(value, (int, float))
        if wrong or not low <= value <= high:  # type: ignore[operator]
            self.add(place, f"{shown(value)} must be a number from {low:g} to {high:g}")
            return None
        return float(value)  # type: ignore[arg-type]
