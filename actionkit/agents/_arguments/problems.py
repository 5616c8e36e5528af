"""Error texts for arguments and configurations: the place, the value, what is allowed."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from pydantic_core import InitErrorDetails, PydanticCustomError, ValidationError

from actionkit._model.field_errors import shown
from actionkit._model.similar_names import similar_names

Place = Sequence["str | int"]
TABLE = "\0"
"""A placeholder in texts for the tool's table, such as `tools.navigate`."""
_LONGEST_NAME = 64
"""Characters; a search for names similar to a longer one takes too long."""
_KINDS = {
    "table": "a table",
    "object": "an object",
    "array": "an array",
    "string": "a string",
    "boolean": "true or false",
    "integer": "a whole number",
    "number": "a number",
}


def sentences(
    error: ValidationError,
    schema: Mapping[str, Any],
    noun: str = "field",
    source: str = "",
    most: int | None = None,
) -> list[str]:
    """Return what is wrong and where, as `problems` finds it.

    Args:
        error: As in `problems`.
        schema: As in `problems`.
        noun: As in `problems`.
        source: Named first.
        most: How many to return: each takes time, and a model can make 50,000 mistakes.
    """
    found = []
    for loc, text in problems(error, schema, noun, most):
        parts = [f"[{part}]" if isinstance(part, int) else f".{quoted(part)}" for part in loc]
        place = "".join(parts).removeprefix(".")
        told = text.replace(TABLE, "".join(parts[:2]).removeprefix("."))
        found.append(": ".join(filter(None, (source, place, told))))
    return found


def problems(
    error: ValidationError,
    schema: Mapping[str, Any],
    noun: str = "field",
    most: int | None = None,
) -> list[tuple[Place, str]]:
    """Return what is wrong and where; pydantic's own texts are for programmers.

    Args:
        error: Of pydantic.
        schema: JSON Schema of what was checked.
        noun: What the properties of an object are called: `field`, or `key`.
        most: How many to return; `None` for all.
    """
    return [_problem(line, schema, noun) for line in error.errors(include_url=False)[:most]]


def refuse(found: Iterable[tuple[Place, str]]) -> None:
    """Raise problems inside a validator of pydantic, if there are any.

    Raises:
        ValidationError: There are problems.
    """
    lines: list[InitErrorDetails] = []
    for loc, text in found:
        plain = text.encode(errors="backslashreplace").decode()  # halves of characters
        kind = PydanticCustomError("value_error", "{error}", {"error": plain})
        lines.append({"type": kind, "loc": tuple(loc), "input": None})
    if lines:
        raise ValidationError.from_exception_data("", lines)


def quoted(path: str) -> str:
    """Return a path as TOML needs it in the name of a table."""
    return f'"{path}"' if "." in path else path


def _problem(line: Any, schema: Mapping[str, Any], noun: str) -> tuple[Place, str]:
    kind, loc, value = line["type"], line["loc"], line["input"]
    if kind == "extra_forbidden":
        known = list(_at(schema, loc[:-1])["properties"])
        return loc[:-1], _unknown(noun, str(loc[-1]), known)
    if kind == "missing":
        return loc, "must be given"
    if kind == "invalid_key" or (kind == "string_type" and loc[-1:] == ("[key]",)):
        above = loc[:-1] if kind == "invalid_key" else loc[:-2]
        return above, f"the name {shown(value)} must be a string"
    if kind == "string_unicode":
        return loc, f"{shown(value)} holds half a character (a lone surrogate)"
    if kind == "value_error":  # of a function of ours
        return tuple(part for part in loc if part != "[key]"), str(line["ctx"]["error"])
    if kind == "greater_than":
        return loc, f"{said(value)} must be above {line['ctx']['gt']:g}"
    if kind == "literal_error":
        return loc, f"{said(value)} must be {line['ctx']['expected']}"
    if value is None:
        return loc, f"null is not allowed; leave the {noun} out to keep its default"
    return loc, _wrong(kind, value, _at(schema, loc), noun)


def _wrong(problem: str, value: Any, schema: Mapping[str, Any], noun: str) -> str:
    """Return what is wrong with a value, by the part of the schema that it breaks."""
    kind = schema["type"]
    must = f"{said(value)} must be {_KINDS['table' if (kind, noun) == ('object', 'key') else kind]}"
    if kind in ("integer", "number") and isinstance(value, (int, float)):
        if not -math.inf < value < math.inf:
            return f"{must}, and finite"
        if not problem.endswith("_type"):
            low, high = schema.get("minimum", 0), schema["maximum"]
            reach = f"{low} to {high}" if kind == "integer" else f"{low:g} to {high:g}"
            return f"{shown(value)} is outside of {reach}"
    if kind == "array" and isinstance(value, (list, tuple)):
        least, most = schema.get("minItems"), schema["maxItems"]
        allowed = f"exactly {most}" if least == most else f"at most {most}"
        return f"has {len(value)} elements, but must have {allowed}"
    return must


def _unknown(noun: str, name: str, known: Sequence[str]) -> str:
    near = similar_names(name, known) if len(name) <= _LONGEST_NAME else []
    hint = f"did you mean {near[0]!r}? " if near else ""
    those = f"the {noun}s are: {', '.join(known)}" if known else f"it has no {noun}s"
    return f"there is no {noun} {shown(name)}; {hint}{those}"


def said(value: object) -> str:
    """Return a short text of a value, as JSON writes it if that differs from Python."""
    if isinstance(value, Mapping):
        return "an object was given; this"
    if isinstance(value, (list, tuple)):
        return "an array was given; this"
    if value is None or isinstance(value, (bool, float)):
        return json.dumps(value)
    return shown(value)


def _at(schema: Mapping[str, Any], loc: Place) -> Mapping[str, Any]:
    found: Any = schema
    for part in loc:
        if isinstance(part, int) and "items" in found:
            found = found["items"]
        else:
            found = found.get("properties", {}).get(part) or found["additionalProperties"]
        found = found.get("anyOf", [found])[0]  # or null
        if "$ref" in found:
            found = schema["$defs"][found["$ref"].rpartition("/")[2]]
    return found  # type: ignore[no-any-return]
