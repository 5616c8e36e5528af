"""Whether arguments fit the shape of a goal. All limits hold, also those that no schema says."""
# C10.2

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from typing import Any

from actionkit._model.field_errors import shown
from actionkit._model.similar_names import similar_names
from actionkit.agents._limits import ABSENT
from actionkit.agents._shapes import Array, Boolean, Group, Number, Shape, Text

MOST_VALUES = 50_000
"""In the arguments of one call: a path of ten thousand points has fewer."""
MOST_CHARACTERS = 1_000_000
DEEPEST = 32
"""Levels; messages have ten at most."""
_MOST_PROBLEMS = 10
_LONGEST_NAME = 64
"""Characters; looking for what somebody meant by a longer one takes too long."""

_SMALLEST = 2.0**-149
"""The smallest 32-bit number above zero."""


class Problems:
    """What is wrong, a text for each; those after the first few are not kept."""

    def __init__(self) -> None:
        self.texts: list[str] = []

    @property
    def full(self) -> bool:
        """Whether there are so many that looking for more is of no use."""
        return len(self.texts) >= _MOST_PROBLEMS

    def add(self, path: str, problem: str) -> None:
        """Note a problem of the field at a path."""
        if not self.full:
            self.texts.append(f"{path}: {problem}" if path else problem)


def check_size(arguments: object) -> str | None:
    """Return what is wrong with the size of arguments, or `None`.

    It also refuses what is not JSON. Fast with any input: nothing that is too large is walked
    through, and nothing is recursive.
    """
    values = characters = 0
    level: list[Any] = [arguments]
    for _ in range(DEEPEST):
        below: list[Any] = []
        for value in level:
            if isinstance(value, str):
                characters += len(value)
            elif isinstance(value, Mapping):
                values += len(value)
                if values > MOST_VALUES:
                    break
                for name in value:
                    if not isinstance(name, str):
                        return f"the name {shown(name)} must be a string"
                    characters += len(name)
                below.extend(value.values())
            elif isinstance(value, (list, tuple)):
                values += len(value)
                if values > MOST_VALUES:
                    break
                below.extend(value)
            elif value is not None and not isinstance(value, (bool, int, float)):
                return f"{shown(value)} is of type {type(value).__name__}, which JSON does not have"
        if values > MOST_VALUES:
            return f"too large: more than {MOST_VALUES} values"
        if characters > MOST_CHARACTERS:
            return f"too large: more than {MOST_CHARACTERS} characters"
        if not below:
            return None
        level = below
    return f"nested too deeply: more than {DEEPEST} levels"


def checked(shape: Group, arguments: Mapping[str, Any], problems: Problems) -> dict[str, Any]:
    """Return the fields that are to be sent: those given, defaults and constants of the limits.

    Args:
        shape: Of the goal.
        arguments: Of a size that `check_size` has nothing against.
        problems: Gets what is wrong; the fields returned are of no use then.
    """
    return _group(shape, arguments, problems, "")


def fits(shape: Shape, value: Any, path: str, problems: Problems) -> Any:
    """Return a value as it is to be sent, also one of the configuration for a hidden field."""
    if value is None:
        problems.add(path, "null is not allowed; leave the field out to keep its default")
        return None
    if isinstance(shape, Group):
        return _group(shape, value, problems, path)
    if isinstance(shape, Array):
        return _array(shape, value, problems, path)
    if isinstance(shape, Number):
        return _number(shape, value, problems, path)
    if isinstance(shape, Text):
        return _text(shape, value, problems, path)
    if isinstance(shape, Boolean):
        if not isinstance(value, bool):
            problems.add(path, f"{shown(value)} must be true or false")
        elif not _in_enum(shape, value):
            problems.add(path, _not_in_enum(shape, value))
        return value
    problems.add(path, f"a {shape.ros_type} cannot be set")
    return None


def _group(shape: Group, value: Any, problems: Problems, path: str) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        problems.add(path, f"{shown(value)} must be an object")
        return {}
    result: dict[str, Any] = {}
    for name in value:
        field = shape.fields.get(name)
        if field is None or not field.shown:
            problems.add(_joined(path, None), _no_field(name, shape))
        if problems.full:
            return {}
    for name, field in shape.fields.items():
        below = _joined(path, name)
        if field.limits.const is not ABSENT:
            result[name] = field.limits.const
        elif field.shown and name in value:
            result[name] = fits(field, value[name], below, problems)
        elif field.required and not isinstance(field, Group):
            problems.add(below, "must be given")
        elif field.limits.default is not ABSENT:
            result[name] = field.limits.default
        elif field.required or field.forced:
            result[name] = _left_out(field, problems, below)
    return result


def _left_out(field: Shape, problems: Problems, path: str) -> Any:
    """Return what is sent for a field if something in it is sent no matter what the model says."""
    if isinstance(field, Group):
        return _group(field, {}, problems, path)
    assert isinstance(field, Array)
    assert isinstance(field.item, Group)
    return [_group(field.item, {}, problems, f"{path}[{i}]") for i in range(field.least)]


def _no_field(name: str, shape: Group) -> str:
    known = [known for known, field in shape.fields.items() if field.shown]
    near = similar_names(name, known) if len(name) <= _LONGEST_NAME else []
    hint = f"did you mean {near[0]!r}? " if near else ""
    fields = f"the fields are: {', '.join(known)}" if known else "it has no fields"
    return f"there is no field {shown(name)}; {hint}{fields}"


def _array(shape: Array, value: Any, problems: Problems, path: str) -> list[Any]:
    if not isinstance(value, (list, tuple)):
        problems.add(path, f"{shown(value)} must be an array")
        return []
    count = len(value)
    if count < shape.least or (shape.most is not None and count > shape.most):
        exact = shape.least == shape.most
        allowed = f"exactly {shape.most}" if exact else f"at most {shape.most}"
        problems.add(path, f"has {count} elements, but must have {allowed}")
        return []
    result = []
    for index, item in enumerate(value):
        result.append(fits(shape.item, item, f"{path}[{index}]", problems))
        if problems.full:
            break
    return result


def _number(shape: Number, value: Any, problems: Problems, path: str) -> float | int:
    kind = "a whole number" if shape.whole else "a number"
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        problems.add(path, f"{shown(value)} must be {kind}")
        return 0
    if isinstance(value, float):
        if not math.isfinite(value):
            problems.add(path, f"{value} must be {kind}, and finite")
            return 0
        if shape.whole:
            # JSON has one kind of numbers, so 1.0 is 1.
            if not value.is_integer():
                problems.add(path, f"{shown(value)} must be {kind}")
                return 0
            value = int(value)
    if not shape.low <= value <= shape.high:
        bounds = f"{shape.low:g} to {shape.high:g}" if not shape.whole else _range(shape)
        problems.add(path, f"{shown(value)} is outside of {bounds}")
        return 0
    if not _in_enum(shape, value):
        problems.add(path, _not_in_enum(shape, value))
    if shape.whole:
        return int(value)
    return _single(float(value), shape) if shape.single else float(value)


def _range(shape: Number) -> str:
    return f"{shape.low} to {shape.high}"


def _single(value: float, shape: Number) -> float:
    """Return the nearest 32-bit number within the limits: rounding may lead just out of them."""
    rounded = _rounded(value)
    if shape.low <= rounded <= shape.high:
        return rounded
    if rounded == 0:
        return math.copysign(_SMALLEST, 1 if rounded < shape.low else -1)
    (bits,) = struct.unpack("<i", struct.pack("<f", rounded))
    # The numbers of a sign follow each other in the order of their bits, away from zero.
    away = (rounded > shape.high) == (rounded < 0)
    nearest: float = struct.unpack("<f", struct.pack("<i", bits + (1 if away else -1)))[0]
    return nearest


def _rounded(value: float) -> float:
    """Return the nearest 32-bit number."""
    return struct.unpack("<f", struct.pack("<f", value))[0]  # type: ignore[no-any-return]


def _text(shape: Text, value: Any, problems: Problems, path: str) -> str:
    if not isinstance(value, str):
        problems.add(path, f"{shown(value)} must be a string")
        return ""
    try:
        size = len(value.encode("utf-16-le")) // 2 if shape.wide else len(value.encode())
    except UnicodeEncodeError as error:
        problems.add(path, f"{shown(value)} holds a lone surrogate at index {error.start}")
        return ""
    if shape.most is not None and size > shape.most:
        unit = "16-bit units" if shape.wide else "bytes of UTF-8"
        problems.add(
            path, f"{shown(value)} has {size} {unit}, but at most {shape.most} are allowed"
        )
        return ""
    if "\0" in value and not shape.wide:
        problems.add(path, f"{shown(value)} holds a NUL character, which ROS cannot send")
        return ""
    if not _in_enum(shape, value):
        problems.add(path, _not_in_enum(shape, value))
    return value


def _in_enum(shape: Shape, value: object) -> bool:
    return shape.limits.enum is None or value in shape.limits.enum


def _not_in_enum(shape: Shape, value: object) -> str:
    return f"{shown(value)} must be one of {', '.join(map(repr, shape.limits.enum or ()))}"


def _joined(path: str, name: str | None) -> str:
    if name is None:
        return path
    return f"{path}.{name}" if path else name
