"""The JSON Schema (2020-12) of what a tool returns, made by pydantic from its dataclass.

Importing this is slow (pydantic); it is loaded with the first toolbox.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import TypeAdapter

from actionkit._messages.comments import comments
from actionkit._messages.paths import slots_of, type_name
from actionkit.agents._arguments.goal_model import DUMMY
from actionkit.agents._values import DIALECT

_ADDED = ("data_from_robot", "sent_here")
"""Fields that were added later: programs may have stored results without them."""


def output_schema(value: type, **messages: type) -> dict[str, Any]:
    """Return the schema of a dataclass; `messages` are the message classes of its fields.

    Of a message it says which fields it has, not what is in them: arrays may be cut, and numbers
    that JSON does not have are strings.
    """
    made = TypeAdapter(value).json_schema(mode="serialization")
    defs = made.pop("$defs")
    for one in (made, *defs.values()):
        one.pop("description", None)  # of the class; not every pydantic gives it
    schema = _inlined(made, defs)
    for name, message in messages.items():
        schema["properties"][name]["properties"] = _fields(message)
    return {"$schema": DIALECT, **schema}


def _fields(message: type) -> dict[str, Any]:
    texts = comments(type_name(message))
    return {
        name: {"description": " ".join(filter(None, (f"{text}.", texts.get(name, ""))))}
        for name, (_, text) in slots_of(message).items()
        if name != DUMMY
    }


def _inlined(part: Any, defs: Mapping[str, Any]) -> Any:
    """Return a part of a schema without titles, `$ref` and `anyOf`: not all hosts read these."""
    if not isinstance(part, dict):
        return part
    part = {
        key: _inlined(one, defs) for key, one in part.items() if key not in ("title", "default")
    }
    if ref := part.pop("$ref", ""):
        part = {**_inlined(defs[ref.rpartition("/")[2]], defs), **part}
    if some := part.pop("anyOf", []):  # something or null
        inner = _inlined(some[0], defs)
        part = {**inner, **part, "type": [inner["type"], "null"]}
    if "properties" in part:
        part["required"] = [name for name in part["properties"] if name not in _ADDED]
        part["additionalProperties"] = False
    return part
