"""The limits of a goal's fields, checked against its type and against each other."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from actionkit._model.field_errors import shown
from actionkit._model.similar_names import similar_names
from actionkit.agents._check import Problems, check_size, fits
from actionkit.agents._limits import ABSENT, Limits
from actionkit.agents._reader import Reader
from actionkit.agents._shapes import Array, Boolean, Group, Number, Shape, Text, shape_of, walk

_KEYS = (
    "minimum",
    "maximum",
    "enum",
    "max_length",
    "max_items",
    "const",
    "default",
    "description",
    "expose",
)
_MOST_ITEMS = 1_000_000


def read_fields(read: Reader, place: str, cls: type, content: object) -> Group | None:
    """Return the shape of a goal with its limits, `None` where something is wrong.

    Args:
        read: Notes what is wrong.
        place: Of the table.
        cls: The goal's message class.
        content: The table: a table of limits for each path.
    """
    before = len(read.problems)
    plain = {shape.path: shape for shape in walk(shape_of(cls, {})) if shape.path}
    limits: dict[str, Limits] = {}
    for written, table in read.tables(place, content):
        path = written.replace("[]", "")
        at = f'{place}."{written}"' if "." in written else f"{place}.{written}"
        if path not in plain:
            near = similar_names(path, plain)
            hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(plain)}"
            read.add(at, f"the goal has no such field; {hint}")
            continue
        limits[path] = _limits(read, at, plain[path], table)
    if len(read.problems) > before:
        return None
    shape = shape_of(cls, limits)
    _check_ancestors(read, place, limits)
    _settle(read, place, shape)
    return None if len(read.problems) > before else shape


def _limits(read: Reader, at: str, shape: Shape, content: object) -> Limits:
    table = read.table(at, content, _KEYS)
    inner = shape.item if isinstance(shape, Array) else shape
    _check_kinds(read, at, shape, inner, table)
    expose = table.get("expose")
    if expose is not None and not isinstance(expose, bool):
        read.add(f"{at}.expose", f"{shown(expose)} must be true or false")
    if "const" in table:
        for key in (set(table) & set(_KEYS)) - {"const", "description"}:
            read.add(f"{at}.{key}", "has no meaning beside const; remove one of them")
    low = high = None
    if isinstance(inner, Number):
        low, high = _bounds(read, at, inner, table)
    return Limits(
        minimum=low,
        maximum=high,
        enum=_enum(read, at, inner, table),
        max_length=_most(read, at, "max_length", table, _MOST_ITEMS, getattr(inner, "most", None)),
        max_items=_most(read, at, "max_items", table, _MOST_ITEMS, getattr(shape, "most", None)),
        const=_value(read, f"{at}.const", shape, table["const"]) if "const" in table else ABSENT,
        default=table.get("default", ABSENT),
        description=read.text(f"{at}.description", table.get("description")),
        expose=expose if isinstance(expose, bool) else None,
    )


def _check_kinds(
    read: Reader, at: str, shape: Shape, inner: Shape, table: Mapping[str, Any]
) -> None:
    """Note limits that the field's type cannot have."""
    kinds: list[tuple[tuple[str, ...], bool, str]] = [
        (("minimum", "maximum"), isinstance(inner, Number), "numbers"),
        (("max_length",), isinstance(inner, Text), "strings"),
        (("max_items",), isinstance(shape, Array), "arrays"),
        (("enum",), isinstance(inner, (Number, Text, Boolean)), "numbers, strings and booleans"),
        (("default",), not isinstance(shape, Group), "single fields and arrays"),
    ]
    for keys, possible, those in kinds:
        for key in keys:
            if key in table and not possible:
                read.add(f"{at}.{key}", f"is for {those}, but this field is a {shape.ros_type}")


def _bounds(
    read: Reader, at: str, shape: Number, table: Mapping[str, Any]
) -> tuple[float | int | None, float | int | None]:
    found: list[float | int | None] = []
    for key in ("minimum", "maximum"):
        value = table.get(key)
        kind = "a whole number" if shape.whole else "a number"
        if value is not None and (
            isinstance(value, bool)
            or not isinstance(value, (int, float))
            or not abs(value) <= sys.float_info.max  # an int may be too large for a float
            or (shape.whole and value != int(value))
        ):
            read.add(f"{at}.{key}", f"{shown(value)} must be {kind}, as the field is")
            value = None
        elif value is not None and not shape.low <= value <= shape.high:
            reach = f"{shape.low:g} to {shape.high:g}"
            read.add(f"{at}.{key}", f"{shown(value)} is outside of {shape.ros_type}, {reach}")
            value = None
        if value is not None:
            value = int(value) if shape.whole else float(value)
        found.append(value)
    low, high = found
    if low is not None and high is not None and low > high:
        read.add(f"{at}.minimum", f"{low} is above the maximum {high}")
    return low, high


def _enum(read: Reader, at: str, inner: Shape, table: Mapping[str, Any]) -> tuple[Any, ...] | None:
    values = table.get("enum")
    if values is None:
        return None
    if not isinstance(values, (list, tuple)) or not values:
        read.add(f"{at}.enum", f"{shown(values)} must be a list of values, not empty")
        return None
    if len(values) != len({repr(value) for value in values}):
        read.add(f"{at}.enum", "names a value twice")
    for value in values:
        _value(read, f"{at}.enum", inner, value)
    return tuple(values)


def _most(
    read: Reader, at: str, key: str, table: Mapping[str, Any], most: int, bound: int | None
) -> int | None:
    value = read.whole(f"{at}.{key}", table.get(key), 0, most)
    if value is not None and bound is not None and value > bound:
        read.add(f"{at}.{key}", f"{value} is more than the type allows, {bound}")
    return value


def _value(read: Reader, at: str, shape: Shape, value: object) -> Any:
    """Return a value of the configuration as it is to be sent."""
    problems = Problems()
    if (too_large := check_size(value)) is not None:
        problems.add("", too_large)
        result = None
    else:
        result = fits(shape, value, "", problems)
    for problem in problems.texts:
        read.add(at, problem)
    return result


def _check_ancestors(read: Reader, place: str, limits: Mapping[str, Limits]) -> None:
    """Note limits of parts of what is constant as a whole."""
    for path in limits:
        parts = path.split(".")
        for length in range(1, len(parts)):
            above = ".".join(parts[:length])
            if above in limits and limits[above].const is not ABSENT:
                read.add(f'{place}."{path}"', f"has no effect, because {above!r} has a const")


def _settle(read: Reader, place: str, shape: Shape) -> None:
    """Work out which fields the model must give; note defaults that are outside of the limits."""
    limits = shape.limits
    at = f'{place}."{shape.path}"' if "." in shape.path else f"{place}.{shape.path}"
    if limits.const is not ABSENT:
        return
    if isinstance(shape, Group):
        for below in shape.fields.values():
            _settle(read, place, below)
        shape.required = any(below.required for below in shape.fields.values())
        return
    if isinstance(shape, Number) and not _reachable(shape):
        read.add(at, f"no {shape.ros_type} lies within {shape.low!r} to {shape.high!r}")
        return
    if isinstance(shape, Array) and isinstance(shape.item, Group):
        for below in shape.item.fields.values():
            _settle(read, place, below)
        required = any(below.required for below in shape.item.fields.values())
        shape.required = shape.least > 0 and required and limits.default is ABSENT
    elif limits.default is ABSENT and (shape.shown or _is_limited(shape)):
        problems = Problems()
        if shape.ros_default is not None:
            fits(shape, shape.ros_default, "", problems)
        shape.required = bool(problems.texts)
    if limits.default is not ABSENT:
        value = _value(read, f"{at}.default", shape, limits.default)
        shape.limits = replace(limits, default=value)
    elif shape.required and not shape.shown:
        read.add(at, "is not exposed, but its default is outside of its limits; set a default")


def _is_limited(shape: Shape) -> bool:
    limits = shape.limits
    return any(
        one is not None
        for one in (
            limits.minimum,
            limits.maximum,
            limits.enum,
            limits.max_length,
            limits.max_items,
        )
    )


def _reachable(shape: Number) -> bool:
    """Whether a value within the limits exists in the field's own type."""
    problems = Problems()
    value = fits(shape, shape.low, "", problems) if shape.limits.enum is None else shape.low
    return not problems.texts and shape.low <= value <= shape.high
