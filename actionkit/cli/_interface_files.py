"""Reads the comments of installed .action, .msg and .srv files; message classes have none."""

from __future__ import annotations

import importlib
import re
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

_FIELD = re.compile(r"[A-Za-z][\w/]*(?:<=\d+)?(?:\[[<=\d]*\])?\s+([A-Za-z]\w*)\s*(=?)(.*)")
"""A type, a name, and a default or, after `=`, the value of a constant."""
_TEXT = re.compile(r"\"(?:\\.|[^\"\\])*\"|'(?:\\.|[^'\\])*'")
_PARTS = {"action": ("Goal", "Result", "Feedback"), "srv": ("Request", "Response")}
_ABOVE = 6
"""Folders above a Python package that may have `share`: lib/python3.12/site-packages/NAME is four
below it."""


@dataclass
class Comments:
    """The comments of one message in a file, without the `#`.

    `head` has the constants, and the comments before the first field that belong to no field.
    `fields` has the comments above and behind each field.
    """

    head: list[str] = field(default_factory=list)
    fields: dict[str, list[str]] = field(default_factory=dict)


def comments_of(ros_type: str) -> Comments:
    """Return the comments on a type or part, such as `test_msgs/action/Fibonacci_Goal`."""
    package, kind, name = ros_type.split("/")
    part = 0
    if kind in _PARTS:
        name, _, word = name.partition("_")
        if word not in _PARTS[kind]:
            return Comments()  # a part that every action or service has
        part = _PARTS[kind].index(word)
    parts = _parsed(package, kind, name)
    return parts[part] if part < len(parts) else Comments()


@cache
def _parsed(package: str, kind: str, name: str) -> list[Comments]:
    path = Path("share", package, kind, f"{name}.{kind}")
    own = Path(str(importlib.import_module(package).__file__)).parent
    for above in list(own.parents)[:_ABOVE]:
        try:
            return parsed((above / path).read_text("utf-8"))
        except (OSError, UnicodeDecodeError):
            continue
    return []


def parsed(text: str) -> list[Comments]:
    """Return the comments of each part of a file; `---` separates the parts."""
    parts = [Comments()]
    above: list[str] = []
    for line in map(str.strip, text.splitlines()):
        part = parts[-1]
        if line == "---":
            parts.append(Comments())
            above = []
        elif line.startswith("#"):
            above.append(line.lstrip("#").strip())
        elif not line:
            if not part.fields:
                part.head += above
            above = []
        elif (match := _FIELD.match(line)) is not None:
            name, equals, rest = match.groups()
            # A '#' in a string does not begin a comment.
            start = _TEXT.sub(lambda found: "_" * len(found[0]), rest).find("#")
            value, comment = (rest, "") if start < 0 else (rest[:start], rest[start:])
            own = [*above, comment.lstrip("#").strip()]
            if equals:
                part.head += [*above, f"{name} = {value.strip()}  {own[-1]}".rstrip()]
            else:
                part.fields[name] = own
            above = []
    return parts
