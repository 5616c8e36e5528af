"""Checks of one field's values: numbers, texts and lists, each with what the model sees of it."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy
from pydantic_core import core_schema
from rosidl_parser.definition import AbstractWString

from actionkit._model.field_errors import shown
from actionkit.agents._arguments.limits import ABSENT, Limits
from actionkit.agents._arguments.problems import said

_FLOAT32_MAX = 3.4028234663852886e38
_NO_NUL = "^[^\\u0000]*$"


@dataclass
class Part:
    """One field, the elements of an array, or the goal itself.

    Attributes:
        check: Pydantic's; `None` where the model does not see it.
        schema: What the model sees.
        sent: Sent if the model does not give it.
        filled: Taken for given if the model does not give it, because something in it is sent
            anyway, or must be given.
        needed: Whether the model must give it, or something in it.
    """

    check: Any
    schema: dict[str, Any]
    sent: Any = ABSENT
    filled: Any = ABSENT
    needed: bool = False


def number_bounds(slot: Any) -> tuple[float | int, float | int] | None:
    """Return the range of a type of numbers; `None` for any other type."""
    name = str(getattr(slot, "typename", ""))
    if name in ("float", "double"):
        most = _FLOAT32_MAX if name == "float" else sys.float_info.max
        return -most, most
    if name == "octet":
        return 0, 255
    digits = name.removeprefix("u").removeprefix("int")
    if digits not in ("8", "16", "32", "64"):
        return None
    bits = int(digits)
    return (0, 2**bits - 1) if name[0] == "u" else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)


def list_part(slot: Any, item: Any, schema: dict[str, Any], own: Limits) -> Part:
    """Return the part of an array or a sequence; `item` checks each element."""
    size: int | None = getattr(slot, "size", None)
    most = _least(own.max_items, size, getattr(slot, "maximum_size", None))
    check: Any = core_schema.list_schema(item, min_length=size or 0, max_length=most, strict=True)
    check = core_schema.no_info_before_validator_function(_as_list, check)
    array: dict[str, Any] = {"type": "array", "items": schema}
    if size:
        array["minItems"] = size
    if most is not None:
        array["maxItems"] = most
    return Part(check, array)


def number_part(slot: Any, low: float, high: float, enum: Sequence[Any] | None) -> Part:
    """Return the part of a number within limits."""
    whole = isinstance(number_bounds(slot)[0], int)  # type: ignore[index]
    check: Any
    if whole:
        check = core_schema.int_schema(strict=True, ge=int(low), le=int(high))
        check = core_schema.no_info_before_validator_function(_as_whole, check)
    else:
        check = core_schema.float_schema(strict=True, ge=low, le=high, allow_inf_nan=False)
        check = core_schema.no_info_before_validator_function(_exactly(low, high), check)
    check = one_of(enum, check)
    if slot.typename == "float":
        check = core_schema.no_info_after_validator_function(float32(low, high), check)
    kind = "integer" if whole else "number"
    return Part(check, {"type": kind, "minimum": low, "maximum": high})


def string_part(slot: Any, own: Limits) -> Part:
    """Return the part of a text."""
    wide = isinstance(slot, AbstractWString)
    most = _least(own.max_length, getattr(slot, "maximum_size", None))

    def fits(text: str) -> str:
        try:
            size = len(text.encode("utf-16-le")) // 2 if wide else len(text.encode())
        except UnicodeEncodeError as error:
            half = f"half a character (a lone surrogate) at index {error.start}"
            raise ValueError(f"{shown(text)} holds {half}") from None
        if most is not None and size > most:
            unit = "16-bit units" if wide else "bytes of UTF-8"
            raise ValueError(f"{shown(text)} has {size} {unit}, but at most {most} are allowed")
        if "\0" in text and not wide:
            raise ValueError(f"{shown(text)} holds a NUL character, which ROS cannot send")
        return text

    schema: dict[str, Any] = {"type": "string"}
    if most is not None:
        schema["maxLength"] = most
    if not wide:
        schema["pattern"] = _NO_NUL
    text = core_schema.str_schema(strict=True)
    return Part(one_of(own.enum, core_schema.no_info_after_validator_function(fits, text)), schema)


def unit_of(slot: Any, schema: Mapping[str, Any]) -> str:
    """Return what `maxLength` counts: JSON Schema counts characters."""
    if "maxLength" not in schema:
        return ""
    unit = "16-bit units" if isinstance(slot, AbstractWString) else "bytes of UTF-8"
    return f"At most {schema['maxLength']} {unit}."


def one_of(enum: Sequence[Any] | None, check: Any) -> Any:
    """Return a check that takes values of a list only; without a list, the check as it is."""
    if enum is None:
        return check

    def listed(value: Any) -> Any:
        if value not in enum:
            known = ", ".join(map(said, enum))
            raise ValueError(f"{said(value)} must be one of {known}")
        return value

    return core_schema.no_info_after_validator_function(listed, check)


def _as_list(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _as_whole(value: Any) -> Any:
    """JSON has one kind of numbers, so 1.0 is 1."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _exactly(low: float, high: float) -> Callable[[Any], Any]:
    """Compare whole numbers before they are rounded to floats: that could bring them in."""

    def compared(value: Any) -> Any:
        if isinstance(value, int) and not isinstance(value, bool) and not low <= value <= high:
            raise ValueError(f"{shown(value)} is outside of {low:g} to {high:g}")
        return value

    return compared


def float32(low: float, high: float) -> Callable[[float], float]:
    """Return a function to the nearest 32-bit number within limits: rounding may lead out."""

    def rounded(value: float) -> float:
        near = numpy.float32(value)
        if float(near) > high:
            near = numpy.nextafter(near, numpy.float32(-math.inf))
        elif float(near) < low:
            near = numpy.nextafter(near, numpy.float32(math.inf))
        return float(near)

    return rounded


def _least(*values: int | None) -> int | None:
    return min((value for value in values if value is not None), default=None)
