"""What is wrong with arguments, in words for a language model: field, value, what is allowed."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from actionkit._model.field_errors import shown
from actionkit._model.similar_names import similar_names

if TYPE_CHECKING:
    from pydantic_core import ValidationError

_MOST_PROBLEMS = 10
_LONGEST_NAME = 64
"""Characters; looking for what somebody meant by a longer one takes too long."""
_KINDS = {
    "object": "an object",
    "array": "an array",
    "string": "a string",
    "boolean": "true or false",
    "integer": "a whole number",
    "number": "a number",
}


def sentences(error: ValidationError, schema: Mapping[str, Any]) -> list[str]:
    """Return what is wrong, the first few problems, a sentence for each.

    Args:
        error: Of pydantic.
        schema: JSON Schema of what was checked: pydantic's own texts are for programmers.
    """
    problems = error.errors(include_url=False)
    return [_sentence(problem, schema) for problem in problems[:_MOST_PROBLEMS]]


def _sentence(problem: Any, schema: Mapping[str, Any]) -> str:
    kind, loc, value = problem["type"], problem["loc"], problem["input"]
    if kind == "extra_forbidden":
        above = _at(schema, loc[:-1])
        return _placed(loc[:-1], _no_field(str(loc[-1]), list(above["properties"])))
    if kind == "missing":
        return _placed(loc, "must be given")
    if value is None:
        return _placed(loc, "null is not allowed; leave the field out to keep its default")
    if kind == "value_error":  # of a function above
        return _placed(loc, str(problem["ctx"]["error"]))
    return _placed(loc, _wrong(value, _at(schema, loc)))


def _wrong(value: Any, schema: Mapping[str, Any]) -> str:
    """Return what is wrong with a value, by the part of the schema that it breaks."""
    kind = schema["type"]
    must = f"{said(value)} must be {_KINDS[kind]}"
    if kind in ("integer", "number") and isinstance(value, (int, float)):
        if isinstance(value, bool):
            return must
        if not -math.inf < value < math.inf:
            return f"{must}, and finite"
        if kind == "integer" and isinstance(value, float) and not value.is_integer():
            return must
        low, high = schema["minimum"], schema["maximum"]
        reach = f"{low} to {high}" if kind == "integer" else f"{low:g} to {high:g}"
        return f"{shown(value)} is outside of {reach}"
    if kind == "array" and isinstance(value, (list, tuple)):
        least, most = schema.get("minItems"), schema["maxItems"]
        allowed = f"exactly {most}" if least == most else f"at most {most}"
        return f"has {len(value)} elements, but must have {allowed}"
    return must


def _no_field(name: str, known: Sequence[str]) -> str:
    near = similar_names(name, known) if len(name) <= _LONGEST_NAME else []
    hint = f"did you mean {near[0]!r}? " if near else ""
    fields = f"the fields are: {', '.join(known)}" if known else "it has no fields"
    return f"there is no field {shown(name)}; {hint}{fields}"


def said(value: object) -> str:
    """Return a value in short as JSON writes it, where that differs from Python."""
    if isinstance(value, Mapping):
        return "an object was given; this"
    if isinstance(value, (list, tuple)):
        return "an array was given; this"
    if value is None or isinstance(value, (bool, float)):
        return json.dumps(value)
    return shown(value)


def _at(schema: Mapping[str, Any], loc: Sequence[str | int]) -> Mapping[str, Any]:
    for part in loc:
        schema = schema["items"] if isinstance(part, int) else schema["properties"][part]
    return schema


def _placed(loc: Sequence[str | int], text: str) -> str:
    parts = (f"[{part}]" if isinstance(part, int) else f".{part}" for part in loc)
    place = "".join(parts).removeprefix(".")
    return f"{place}: {text}" if place else text
