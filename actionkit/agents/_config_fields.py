"""The limits of a goal's fields, checked against its type and against each other."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from rosidl_parser.definition import AbstractGenericString, AbstractNestedType, NamespacedType

from actionkit._messages.paths import message_class, slots_of
from actionkit._model.field_errors import shown
from actionkit._model.similar_names import similar_names
from actionkit.agents._goal_model import DUMMY, GoalModel, check_value, number_bounds
from actionkit.agents._limits import ABSENT, NO_LIMITS, Limits
from actionkit.agents._reader import Reader

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
    "required",
)
_MOST_ITEMS = 1_000_000


@dataclass(frozen=True)
class _Type:
    """The type of a field.

    Attributes:
        slot: As rosidl describes it.
        text: As ROS writes it.
        inner: That of its elements if it is an array, else its own.
        bounds: Of numbers.
    """

    slot: Any
    text: str
    inner: Any
    bounds: tuple[float | int, float | int] | None


def read_fields(
    read: Reader, place: str, cls: type, content: object, *, expose_all: bool
) -> GoalModel | None:
    """Return the model of a goal with its limits, `None` where something is wrong.

    Args:
        read: Notes what is wrong.
        place: Of the table.
        cls: The goal's message class.
        content: The table: a table of limits for each path.
        expose_all: Whether a model sees the fields that are not listed, too.
    """
    before = len(read.problems)
    types = dict(_types(cls, ""))
    limits: dict[str, Limits] = {}
    for written, table in read.tables(place, content):
        path = written.replace("[]", "")
        at = _place(place, written)
        if path not in types:
            near = similar_names(path, types)
            hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(types)}"
            read.add(at, f"the goal has no such field; {hint}")
        elif path in limits:
            read.add(at, "this field is listed twice; [] says nothing")
        elif (whole := _unquoted(path, table)) != path:
            read.add(at, f'a path needs quotes: [{place}."{whole}"]')
        else:
            limits[path] = _limits(read, at, types[path], table)
    if len(read.problems) > before:
        return None
    model = GoalModel(cls, limits, expose_all=expose_all)
    _check_ancestors(read, place, limits)
    _check_exposed(read, place, types, limits, model)
    for path, key, problem in model.problems:
        read.add(".".join(filter(None, (_place(place, path), key))), problem)
    return None if len(read.problems) > before else model


def _types(cls: type, path: str) -> Iterator[tuple[str, _Type]]:
    """Yield the paths and types of all fields, with those in the elements of arrays."""
    for name, (slot, text) in slots_of(cls).items():
        if name == DUMMY:
            continue
        below = f"{path}.{name}" if path else name
        inner = slot.value_type if isinstance(slot, AbstractNestedType) else slot
        yield below, _Type(slot, text, inner, number_bounds(inner))
        if isinstance(inner, NamespacedType):
            yield from _types(message_class(inner), below)


def _unquoted(path: str, content: object) -> str:
    """Return the path that was meant: without quotes, TOML makes a table of each part of it."""
    if isinstance(content, Mapping):
        for key, below in content.items():
            if key not in _KEYS and isinstance(below, Mapping):
                return _unquoted(f"{path}.{key}", below)
    return path


def _place(place: str, path: str) -> str:
    return f'{place}."{path}"' if "." in path else f"{place}.{path}"


def _limits(read: Reader, at: str, of: _Type, content: object) -> Limits:
    table = read.table(at, content, _KEYS)
    _check_kinds(read, at, of, table)
    for key in ("expose", "required"):
        if key in table and not isinstance(table[key], bool):
            read.add(f"{at}.{key}", f"{shown(table[key])} must be true or false")
    if table.get("required") is True and "default" in table:
        read.add(f"{at}.required", "a field that must be given has no default; remove one of them")
    if "const" in table:
        for key in (set(table) & set(_KEYS)) - {"const", "description"}:
            read.add(f"{at}.{key}", "has no meaning beside const; remove one of them")
    low = high = None
    if of.bounds is not None:
        low, high = _bounds(read, at, of.inner, of.bounds, table)
    most = getattr(of.inner, "maximum_size", None)
    size = getattr(of.slot, "size", None)
    if size is not None and "max_items" in table:
        read.add(f"{at}.max_items", f"this array always has {size} elements; remove the limit")
    most_items = getattr(of.slot, "maximum_size", size)
    limits = Limits(
        minimum=low,
        maximum=high,
        max_length=_most(read, at, "max_length", table, sys.maxsize, most),
        max_items=_most(read, at, "max_items", table, _MOST_ITEMS, most_items),
        default=table.get("default", ABSENT),
        description=read.text(f"{at}.description", table.get("description")),
        expose=table.get("expose"),
        required=table.get("required") is True,
    )
    if "const" in table:
        return replace(limits, const=_value(read, f"{at}.const", of.slot, table["const"]))
    return replace(limits, enum=_enum(read, at, of.inner, table, limits))


def _check_kinds(read: Reader, at: str, of: _Type, table: Mapping[str, Any]) -> None:
    """Note limits that the field's type cannot have."""
    number, text = of.bounds is not None, isinstance(of.inner, AbstractGenericString)
    boolean = getattr(of.inner, "typename", "") == "boolean"
    single = not isinstance(of.slot, NamespacedType)
    kinds: list[tuple[tuple[str, ...], bool, str]] = [
        (("minimum", "maximum"), number, "numbers"),
        (("max_length",), text, "strings"),
        (("max_items",), isinstance(of.slot, AbstractNestedType), "arrays"),
        (("enum",), number or text or boolean, "numbers, strings and booleans"),
        (("default",), single, "single fields and arrays"),
    ]
    for keys, possible, those in kinds:
        for key in keys:
            if key in table and not possible:
                read.add(f"{at}.{key}", f"is for {those}, but this field is a {of.text}")


def _bounds(
    read: Reader,
    at: str,
    slot: Any,
    reach: tuple[float | int, float | int],
    table: Mapping[str, Any],
) -> tuple[float | int | None, float | int | None]:
    found: list[float | int | None] = []
    whole = isinstance(reach[0], int)
    for key in ("minimum", "maximum"):
        value = table.get(key)
        kind = "a whole number" if whole else "a number"
        if value is not None and (
            isinstance(value, bool)
            or not isinstance(value, (int, float))
            or not abs(value) <= sys.float_info.max  # an int may be too large for a float
            or (whole and value != int(value))
        ):
            read.add(f"{at}.{key}", f"{shown(value)} must be {kind}, as the field is")
            value = None
        elif value is not None and not reach[0] <= value <= reach[1]:
            within = f"{slot.typename}, {reach[0]:g} to {reach[1]:g}"
            read.add(f"{at}.{key}", f"{shown(value)} is outside of {within}")
            value = None
        if value is not None:
            value = int(value) if whole else float(value)
        found.append(value)
    low, high = found
    if low is not None and high is not None and low > high:
        read.add(f"{at}.minimum", f"{low} is above the maximum {high}")
    return low, high


def _enum(
    read: Reader, at: str, inner: Any, table: Mapping[str, Any], limits: Limits
) -> tuple[Any, ...] | None:
    values = table.get("enum")
    if values is None:
        return None
    if not isinstance(values, (list, tuple)) or not values:
        read.add(f"{at}.enum", f"{shown(values)} must be a list of values, not empty")
        return None
    if len(values) != len({repr(value) for value in values}):
        read.add(f"{at}.enum", "names a value twice")
    # Within the other limits, too: one of them is wrong.
    bounds = Limits(minimum=limits.minimum, maximum=limits.maximum, max_length=limits.max_length)
    for value in values:
        _value(read, f"{at}.enum", inner, value, bounds)
    return tuple(values)


def _most(
    read: Reader, at: str, key: str, table: Mapping[str, Any], most: int, bound: int | None
) -> int | None:
    value = read.whole(f"{at}.{key}", table.get(key), 0, most)
    if value is not None and bound is not None and value > bound:
        read.add(f"{at}.{key}", f"{value} is more than the type allows, {bound}")
    return value


def _value(read: Reader, at: str, slot: Any, value: object, limits: Limits = NO_LIMITS) -> Any:
    """Return a value of the configuration as it is to be sent."""
    result, problems = check_value(slot, value, limits)
    for problem in problems:
        read.add(at, problem)
    return result


def _check_exposed(
    read: Reader,
    place: str,
    types: Mapping[str, _Type],
    limits: Mapping[str, Limits],
    model: GoalModel,
) -> None:
    """Note messages that are listed without effect; and if no field at all is listed."""
    for path, own in limits.items():
        is_message = isinstance(types[path].inner, NamespacedType)
        says_more = own.expose is not None or own.const is not ABSENT or own.default is not ABSENT
        inside = [*limits, *model.exposed]
        if is_message and not says_more and not any(one.startswith(f"{path}.") for one in inside):
            first = next((one for one in types if one.startswith(f"{path}.")), path)
            text = f"list the fields in it, such as {first!r}, or set expose = true for all of them"
            read.add(_place(place, path), f"a model cannot set anything in it: {text}")
    fields = [path for path, of in types.items() if not isinstance(of.inner, NamespacedType)]
    if fields and not limits and not model.exposed:
        read.add(
            place.removesuffix(".fields"),
            f"no field of the goal is listed, so a model could set none. List those that it may"
            f' set, such as [{_place(place, fields[0])}], or set expose = "all" for all of them',
        )


def _check_ancestors(read: Reader, place: str, limits: Mapping[str, Limits]) -> None:
    """Note limits of parts of what is constant as a whole."""
    for path in limits:
        parts = path.split(".")
        for length in range(1, len(parts)):
            above = ".".join(parts[:length])
            if above in limits and limits[above].const is not ABSENT:
                read.add(f'{place}."{path}"', f"has no effect, because {above!r} has a const")
