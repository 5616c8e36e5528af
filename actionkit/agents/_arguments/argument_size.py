"""Whether arguments are small enough to be looked at, and of what JSON has."""
# C10.2

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from actionkit._model.field_errors import shown

_MOST_VALUES = 50_000
"""In the arguments of one call: a path of ten thousand points has fewer."""
_MOST_CHARACTERS = 1_000_000
_DEEPEST = 32
"""Levels; messages have ten at most."""


def check_size(arguments: object) -> str | None:
    """Return what is wrong with the size of arguments, or `None`.

    It also refuses what is not JSON. Fast with any input: nothing that is too large is walked
    through, and nothing is recursive.
    """
    values = characters = 0
    level: list[Any] = [arguments]
    for _ in range(_DEEPEST):
        below: list[Any] = []
        for value in level:
            if isinstance(value, str):
                characters += len(value)
            elif isinstance(value, Mapping):
                values += len(value)
                if values > _MOST_VALUES:
                    break
                for name in value:
                    if not isinstance(name, str):
                        return f"the name {shown(name)} must be a string"
                    characters += len(name)
                below.extend(value.values())
            elif isinstance(value, (list, tuple)):
                values += len(value)
                if values > _MOST_VALUES:
                    break
                below.extend(value)
            elif value is not None and not isinstance(value, (bool, int, float)):
                return f"there is a {type(value).__name__}, which JSON does not have"
        if values > _MOST_VALUES:
            return f"too large: more than {_MOST_VALUES} values"
        if characters > _MOST_CHARACTERS:
            return f"too large: more than {_MOST_CHARACTERS} characters"
        if not below:
            return None
        level = below
    return f"nested too deeply: more than {_DEEPEST} levels"
