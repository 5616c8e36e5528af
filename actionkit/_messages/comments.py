"""Reads the comments of installed .action, .msg and .srv files; message classes have none."""

from __future__ import annotations

import importlib
import os
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from actionkit._model.printable import visible

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

    `about` has the comments at the top, which describe the whole; if the first field follows them
    without an empty line, they are that field's, too. `head` has the constants, and the comments
    before the first field that belong to no field. `fields` has those above and behind each field.
    """

    about: list[str] = field(default_factory=list)
    head: list[str] = field(default_factory=list)
    fields: dict[str, list[str]] = field(default_factory=dict)


def comments_of(ros_type: str) -> Comments:
    """Return the comments on a type or part, such as `test_msgs/action/Fibonacci_Goal`.

    They are empty if its file is not installed or cannot be read.
    """
    package, kind, name = ros_type.split("/")
    part = 0
    if kind in _PARTS:
        name, _, word = name.partition("_")
        if word not in _PARTS[kind]:
            return Comments()  # a part that every action or service has
        part = _PARTS[kind].index(word)
    parts = _parsed(package, kind, name)
    return parts[part] if part < len(parts) else Comments()


def comments(ros_type: str) -> Mapping[str, str]:
    """Return the comments on a type or part as one text for each field, and `""` for the whole.

    Language models read them. So what cannot be seen is escaped: it may be a hidden instruction.
    """
    found = comments_of(ros_type)
    lines = {"": found.about, **found.fields}
    return {name: visible(" ".join(filter(None, each))) for name, each in lines.items()}


def constants(cls: type) -> str:
    """Return the constants of a message class as a text such as `STOP=0, GO=1`, or `""`."""
    # The class's own `__dict__` does not have them: they are properties of its metaclass.
    named: Mapping[str, Any] = getattr(type(cls), f"_Metaclass_{cls.__name__}__constants", {})
    return visible(", ".join(f"{name}={getattr(cls, name)!r}" for name in named))


@cache
def _parsed(package: str, kind: str, name: str) -> list[Comments]:
    for share in _shares(package):
        try:
            return parsed((share / package / kind / f"{name}.{kind}").read_text("utf-8-sig"))
        except (OSError, UnicodeDecodeError):
            continue
    return []


def _shares(package: str) -> Iterator[Path]:
    """Yield the folders that may have the files of a package, the nearest first."""
    own = Path(str(importlib.import_module(package).__file__)).parent
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    yield from (above / "share" for above in list(own.parents)[:_ABOVE])
    yield from (Path(prefix, "share") for prefix in [*filter(None, prefixes), sys.prefix])


def parsed(text: str) -> list[Comments]:
    """Return the comments of each part of a file; `---` separates the parts."""
    parts = re.split(r"^\s*---\s*$", text, flags=re.MULTILINE)
    return [_part([*part.splitlines(), ""]) for part in parts]


def _part(lines: Iterable[str]) -> Comments:
    found = Comments()
    above: list[str] = []
    latest: list[str] | None = None  # the comments that an indented one goes on with
    for indented in lines:
        line = indented.strip()
        if line.startswith("#"):
            into = above if latest is None or above or indented[0] == "#" else latest
            into.append(line.lstrip("#").strip())
        elif not line and not found.fields:
            if latest is None:
                found.about += above
            found.head += above
            above = []
        elif (match := _FIELD.match(line)) is not None:
            name, equals, rest = match.groups()
            # A '#' in a string does not begin a comment.
            start = _TEXT.sub(lambda text: "_" * len(text[0]), rest).find("#")
            value, comment = (rest, "") if start < 0 else (rest[:start], rest[start:])
            own = [*above, comment.lstrip("#").strip()]
            if latest is None and not found.about:
                found.about += above
            if equals:
                found.head += [*above, f"{name} = {value.strip()}  {own[-1]}".rstrip()]
                latest = found.head
            else:
                latest = found.fields[name] = own
            above = []
    return found
