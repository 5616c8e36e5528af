"""The shape of a goal: its fields, with the bounds of their types and the limits on top.

The schema that a model sees (`_schema`) and the check of what it sends (`_check`) both walk it.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Union

from actionkit._messages.comments import comments, constants
from actionkit._messages.convert import to_plain
from actionkit._messages.paths import message_class, slots_of, type_name
from actionkit.agents._limits import ABSENT, NO_LIMITS, Limits

FLOAT32_MAX = 3.4028234663852886e38
_DUMMY = "structure_needs_at_least_one_member"
"""rosidl's, in messages without fields."""


@dataclass(eq=False)
class Leaf:
    """What all shapes have.

    Attributes:
        path: From the goal: `pose.position.x`; elements of an array go by the array's path.
        ros_type: As ROS writes it.
        comment: Of the interface's file.
        limits: Of the configuration.
        ros_default: What ROS sends where the field is left out, as plain values.
        shown: Whether the model sees it.
        forced: Whether something in it is sent no matter what the model says.
        required: Whether the model must give it, because the default is outside of the limits.
    """

    path: str
    ros_type: str
    comment: str
    limits: Limits
    ros_default: Any
    shown: bool = True
    forced: bool = False
    required: bool = False


@dataclass(eq=False)
class Boolean(Leaf):
    """A bool."""


@dataclass(eq=False)
class Number(Leaf):
    """A number.

    Attributes:
        low: The smallest, by its type and the configuration.
        high: The largest.
        whole: Whether it is an integer.
        single: Whether it has 32 bits and is not an integer.
    """

    low: float | int = 0
    high: float | int = 0
    whole: bool = False
    single: bool = False


@dataclass(eq=False)
class Text(Leaf):
    """A string.

    Attributes:
        most: The most bytes of UTF-8, or 16-bit units of a wide one.
        wide: Whether it is a `wstring`.
    """

    most: int | None = None
    wide: bool = False


@dataclass(eq=False)
class Array(Leaf):
    """An array.

    Attributes:
        item: The shape of its elements.
        least: The fewest elements.
        most: The most elements.
    """

    item: Shape = field(default=None)  # type: ignore[assignment]  # always given
    least: int = 0
    most: int | None = None


@dataclass(eq=False)
class Group(Leaf):
    """A message within the goal, or the goal itself.

    Attributes:
        fields: By name.
    """

    fields: dict[str, Shape] = field(default_factory=dict)


@dataclass(eq=False)
class Opaque(Leaf):
    """A scalar of an IDL type that .msg files do not know; never shown."""


Shape = Union[Boolean, Number, Text, Array, Group, Opaque]  # noqa: UP007  3.10 has no | of strings


def shape_of(cls: type, limits: Mapping[str, Limits]) -> Group:
    """Return the shape of a goal.

    Args:
        cls: Its message class.
        limits: By path, such as `pose.position.x`. Paths that do not exist are left out.
    """
    plain = to_plain(cls())
    shape = _group(cls, "", limits, "", plain)
    _show(shape, shown=True)
    return shape


def _group(
    cls: type,
    path: str,
    limits: Mapping[str, Limits],
    comment: str,
    default: Any,
    own: Limits = NO_LIMITS,
) -> Group:
    ros_type = type_name(cls)
    texts = comments(ros_type)
    named = constants(cls)
    parts = (comment or texts.get("", ""), f"Constants: {named}" if named else "")
    group = Group(path, ros_type, " ".join(filter(None, parts)), own, default)
    for name, (slot, text) in slots_of(cls).items():
        if name == _DUMMY:
            continue
        below = f"{path}.{name}" if path else name
        value = default[name] if isinstance(default, Mapping) else None
        own = limits.get(below, NO_LIMITS)
        group.fields[name] = _field(slot, text, below, limits, texts.get(name, ""), value, own)
    return group


def _field(
    slot: Any,
    text: str,
    path: str,
    limits: Mapping[str, Limits],
    comment: str,
    default: Any,
    own: Limits,
) -> Shape:
    """Return the shape of one field, or of the elements of an array."""
    from rosidl_parser.definition import (
        AbstractGenericString,
        AbstractNestedType,
        AbstractWString,
        NamespacedType,
    )

    if isinstance(slot, AbstractNestedType):
        element = default[0] if default else None
        inner = slot.value_type
        if isinstance(inner, NamespacedType) and element is None:
            element = to_plain(message_class(inner)())
        each = replace(own, const=ABSENT, default=ABSENT, max_items=None, expose=None)
        kind = str(getattr(inner, "typename", ""))
        item = _field(inner, kind, path, limits, "", element, each)
        exact: int | None = getattr(slot, "size", None)
        most: int | None = getattr(slot, "maximum_size", exact)
        if own.max_items is not None:
            most = own.max_items if most is None else min(most, own.max_items)
        return Array(path, text, comment, own, default, item=item, least=exact or 0, most=most)
    if isinstance(slot, NamespacedType):
        return _group(message_class(slot), path, limits, comment, default, own)
    if isinstance(slot, AbstractGenericString):
        wide = isinstance(slot, AbstractWString)
        most = getattr(slot, "maximum_size", None)
        if own.max_length is not None:
            most = own.max_length if most is None else min(most, own.max_length)
        return Text(path, text or "string", comment, own, default, most=most, wide=wide)
    name: str = getattr(slot, "typename", "")
    if name == "boolean":
        return Boolean(path, name, comment, own, default)
    bounds = number_bounds(name)
    if bounds is None:
        return Opaque(path, name, comment, own, default)
    low, high = bounds
    return Number(
        path,
        name,
        comment,
        own,
        default,
        low=low if own.minimum is None else max(low, own.minimum),
        high=high if own.maximum is None else min(high, own.maximum),
        whole=isinstance(low, int),
        single=name == "float",
    )


def number_bounds(ros_type: str) -> tuple[float | int, float | int] | None:
    """Return the range of a type of numbers; `None` for any other type."""
    if ros_type in ("float", "double"):
        most = FLOAT32_MAX if ros_type == "float" else sys.float_info.max
        return -most, most
    if ros_type == "octet":
        return 0, 255
    unsigned = ros_type.startswith("uint")
    digits = ros_type[4:] if unsigned else ros_type[3:]
    if not ros_type.startswith(("int", "uint")) or digits not in ("8", "16", "32", "64"):
        return None
    bits = int(digits)
    return (0, 2**bits - 1) if unsigned else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)


def _show(shape: Shape, *, shown: bool) -> None:
    """Work out what the model sees, and what is sent anyway; parents after children."""
    limits = shape.limits
    shown = shown if limits.expose is None else limits.expose
    if limits.const is not ABSENT or isinstance(shape, Opaque):
        shown = False
    if isinstance(shape, Group):
        for below in shape.fields.values():
            _show(below, shown=shown and limits.const is ABSENT)
        # A part of something hidden may be shown; a whole is hidden if no part of it is shown.
        shown = any(below.shown for below in shape.fields.values())
        shape.forced = any(below.forced for below in shape.fields.values())
    elif isinstance(shape, Array):
        _show(shape.item, shown=shown)
        shown = shown and shape.item.shown
        shape.forced = shape.least > 0 and shape.item.forced
    shape.shown = shown or shape.path == ""
    shape.forced = shape.forced or limits.const is not ABSENT or limits.default is not ABSENT


def walk(shape: Shape) -> Iterator[Shape]:
    """Yield a shape and all that lie in it; of an array, the elements' parts."""
    yield shape
    inner = shape.item if isinstance(shape, Array) else shape
    if isinstance(inner, Group):
        for below in inner.fields.values():
            yield from walk(below)
