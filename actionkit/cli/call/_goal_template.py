"""Writes a message with its defaults as YAML to fill in, with types and comments."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import yaml

from actionkit._messages.comments import comments_of
from actionkit._messages.convert import to_plain
from actionkit._messages.paths import message_class, slots_of, type_name

_NOW = ("builtin_interfaces/Time", "std_msgs/Header")
"""Types for which `actionkit call` accepts the word `now`."""


def template(action: Any, ros_type: str) -> str:
    """Return a goal of the action with all defaults, and its result and feedback as comments.

    `ros_type` is the action's name, such as `test_msgs/action/Fibonacci`.
    """
    lines = [
        f"# A goal of {ros_type} with its defaults. Change it, and send it with:",
        f"#   actionkit call NAME {ros_type} --stdin < FILE",
        *_part(action.Goal),
    ]
    if not slots_of(action.Goal):
        lines.append("{}")
    for title, cls in (("Result", action.Result), ("Feedback", action.Feedback)):
        lines += ["", f"# {title}:", *(f"#   {line}" for line in _part(cls))]
    return "\n".join(lines)


def _part(cls: type) -> Iterator[str]:
    yield from (f"# {line}".rstrip() for line in comments_of(type_name(cls)).head)
    yield from _fields(cls())


def _fields(message: Any) -> Iterator[str]:
    """Yield a line for each field of a message, also for messages inside it."""
    from rosidl_parser.definition import AbstractNestedType, NamespacedType

    cls: type = type(message)
    named = type_name(cls)
    # Everybody knows the fields of a time.
    comments = {} if named.startswith("builtin_interfaces/") else comments_of(named).fields
    for name, (slot, text) in slots_of(cls).items():
        yield from (f"# {line}" for line in comments.get(name, ()) if line)
        kind = text.replace("/msg/", "/")
        value = getattr(message, name)
        if isinstance(slot, NamespacedType):
            hint = ", or: now" if kind in _NOW else ""
            inner = list(_fields(value))
            yield f"{name}:{'' if inner else ' {}'}  # {kind}{hint}"
            yield from (f"  {line}" for line in inner)
        else:
            yield f"{name}: {_yaml(to_plain(message)[name])}  # {kind}"
            if isinstance(slot, AbstractNestedType) and isinstance(slot.value_type, NamespacedType):
                yield "# each:"
                yield from (f"#   {line}" for line in _fields(message_class(slot.value_type)()))


def _yaml(value: Any) -> str:
    text: str = yaml.safe_dump(value, default_flow_style=True, allow_unicode=True, width=math.inf)
    return text.removesuffix("\n").removesuffix("\n...")
