"""JSON Schema (2020-12) of a goal's shape, as the model sees it."""

from __future__ import annotations

import math
from typing import Any

from actionkit.agents._limits import ABSENT
from actionkit.agents._shapes import Array, Boolean, Group, Leaf, Number, Shape, Text

DIALECT = "https://json-schema.org/draft/2020-12/schema"
_NO_NUL = "^[^\\u0000]*$"


def input_schema(shape: Group) -> dict[str, Any]:
    """Return the schema of a goal's arguments."""
    return {"$schema": DIALECT, **_of(shape)}


def _of(shape: Shape) -> dict[str, Any]:
    schema = _bare(shape)
    if text := _description(shape):
        schema["description"] = text
    default = shape.limits.default if shape.limits.default is not ABSENT else shape.ros_default
    if not isinstance(shape, Group) and not shape.required and _is_json(default):
        schema["default"] = default
    return schema


def _bare(shape: Shape) -> dict[str, Any]:
    if isinstance(shape, Group):
        fields = {name: field for name, field in shape.fields.items() if field.shown}
        schema: dict[str, Any] = {
            "type": "object",
            "properties": {name: _of(field) for name, field in fields.items()},
            "additionalProperties": False,
        }
        if required := [name for name, field in fields.items() if field.required]:
            schema["required"] = required
        return schema
    if isinstance(shape, Array):
        schema = {"type": "array", "items": _bare(shape.item)}
        if shape.least:
            schema["minItems"] = shape.least
        if shape.most is not None:
            schema["maxItems"] = shape.most
        return schema
    if isinstance(shape, Text):
        schema = {"type": "string"}
        if shape.most is not None:
            schema["maxLength"] = shape.most
        if not shape.wide:
            schema["pattern"] = _NO_NUL
    elif isinstance(shape, Number):
        kind = "integer" if shape.whole else "number"
        schema = {"type": kind, "minimum": shape.low, "maximum": shape.high}
    else:
        assert isinstance(shape, Boolean)
        schema = {"type": "boolean"}
    if shape.limits.enum is not None:
        schema["enum"] = list(shape.limits.enum)
    return schema


def _description(shape: Leaf) -> str:
    parts = [shape.limits.description or shape.comment]
    if isinstance(shape, Text) and shape.most is not None:
        parts.append(f"At most {shape.most} {'16-bit units' if shape.wide else 'bytes of UTF-8'}.")
    return " ".join(filter(None, parts))


def _is_json(value: Any) -> bool:
    """Tell whether it is there and has no number that JSON cannot write."""
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, (list, tuple)):
        return all(map(_is_json, value))
    return value is not None
