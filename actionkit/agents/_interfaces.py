"""The user's interface packages: classes by name, and the comments of their files."""

from __future__ import annotations

import importlib
import logging
import os
import re
import sys
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

_FORM = re.compile(r"[a-z][a-z0-9_]*/(action|msg)/[A-Z][A-Za-z0-9]*")
_SUFFIXES = ("_Goal", "_Result", "_Feedback")
_NONE: Mapping[str, str] = {}
_log = logging.getLogger("actionkit")


def interface_class(name: str, kind: Literal["action", "msg"]) -> Any:
    """Return the Python class of a ROS type.

    Args:
        name: Such as `test_msgs/action/Fibonacci`.
        kind: What it has to be.

    Raises:
        ValueError: It is not written like one, or not installed; says which.
    """
    match = _FORM.fullmatch(name)
    if match is None or match[1] != kind:
        raise ValueError(f"{name!r} must be written package/{kind}/Name")
    package, _, short = name.split("/")
    try:
        module = importlib.import_module(f"{package}.{kind}")
    except ImportError as error:
        raise ValueError(
            f"{name!r} cannot be loaded ({error}); install the package {package}, or source the"
            " workspace that it was built in"
        ) from error
    try:
        return getattr(module, short)
    except AttributeError:
        whole = "Goal" if kind == "action" else "SLOT_TYPES"
        known = sorted(n for n, found in vars(module).items() if hasattr(found, whole))
        raise ValueError(
            f"{name!r} does not exist; {package} has {', '.join(known) or 'none'}"
        ) from None


def constants(cls: type) -> str:
    """Return the constants of a message class as a text such as `STOP=0, GO=1`, or `""`."""
    # The class's own `__dict__` does not have them: they are properties of its metaclass.
    named: Mapping[str, Any] = getattr(type(cls), f"_Metaclass_{cls.__name__}__constants", _NONE)
    return ", ".join(f"{name}={getattr(cls, name)!r}" for name in named)


@lru_cache(maxsize=256)
def comments(ros_type: str) -> Mapping[str, str]:
    """Return the comments of a type's file: by field, and `""` for that of the whole.

    Empty where the file is not installed or cannot be read: they are only an aid for the model.

    Args:
        ros_type: Such as `geometry_msgs/msg/Pose` or `test_msgs/action/Fibonacci_Goal`.
    """
    package, kind, name = ros_type.split("/")
    if kind == "action":
        for suffix in _SUFFIXES:
            name = name.removesuffix(suffix)
    relative = Path(kind, f"{name}.idl")
    for share in _shares():
        if (share / package / relative).is_file():
            try:
                return _parsed(share / package, relative).get(ros_type, _NONE)
            except Exception:  # noqa: BLE001  the parser raises many kinds for what it cannot read
                _log.debug("no comments of %s", ros_type, exc_info=True)
                return _NONE
    return _NONE


def _shares() -> list[Path]:
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    return [Path(prefix, "share") for prefix in [*filter(None, prefixes), sys.prefix]]


@lru_cache(maxsize=256)
def _parsed(base: Path, relative: Path) -> dict[str, dict[str, str]]:
    parser: Any = importlib.import_module("rosidl_parser.parser")
    definition: Any = importlib.import_module("rosidl_parser.definition")
    content = parser.parse_idl_file(definition.IdlLocator(base, relative)).content
    found = {}
    messages = list(content.get_elements_of_type(definition.Message))
    for action in content.get_elements_of_type(definition.Action):
        messages += [action.goal, action.result, action.feedback]
    for message in messages:
        structure = message.structure
        name = "/".join(structure.namespaced_type.namespaced_name())
        found[name] = {"": _comment(structure)}
        found[name].update((member.name, _comment(member)) for member in structure.members)
    return found


def _comment(element: Any) -> str:
    for annotation in element.annotations:
        if annotation.name == "verbatim" and annotation.value.get("language") == "comment":
            return " ".join(str(annotation.value.get("text", "")).split())
    return ""
