"""Finds the class of an action or message type by its name, and the installed types."""

from __future__ import annotations

import importlib
import importlib.util
import re
import sys
from functools import cache
from pathlib import Path
from typing import Any, Literal

from actionkit._model.action_type import type_name_of
from actionkit._model.ros_packages import repository, wheel
from actionkit._model.similar_names import similar_names

Kind = Literal["action", "msg"]
_NAME = re.compile(r"([A-Za-z]\w*)/(action|msg)/([A-Za-z]\w*)")
_PART = re.compile(r"_(SendGoal|GetResult)(_Request|_Response|_Event)?$")
_MARKS = {"action": ("Goal", "Result", "Feedback", "Impl"), "msg": ("SLOT_TYPES",)}
"""Kind -> attributes that only its classes have."""
_NOUNS = {"action": "action", "msg": "message"}
_FORMS = {
    "action": "an action type: one is written as test_msgs/action/Fibonacci",
    "msg": "a message type: one is written as std_msgs/msg/String",
}


class BrokenPackageError(ValueError):
    """A package is there, but cannot be imported."""


@cache
def installed(kind: Kind = "action") -> tuple[str, ...]:
    """Return the names of all types of a kind that can be imported, sorted."""
    found: set[str] = set()
    for entry in sys.path:
        for init in Path(entry or ".").glob(f"*/{kind}/__init__.py"):
            package = init.parts[-3]
            # The form of rosidl's code, so that nothing must be imported.
            line = re.compile(rf"^from {re.escape(package)}\.{kind}\._\w+ import (\w+)", re.M)
            try:
                names = line.findall(init.read_text("utf-8"))
            except (OSError, UnicodeDecodeError):
                continue
            found.update(f"{package}/{kind}/{name}" for name in names if not _PART.search(name))
    return tuple(sorted(found))


def action_name(action_type: object) -> str:
    """Return the name of an action type, such as `test_msgs/action/Fibonacci`.

    `action_type` is its class or its name.

    Raises:
        TypeError: It is neither.
        ValueError: It is a str that is not such a name.
    """
    if isinstance(action_type, str):
        _split(action_type, "action")
        return action_type
    return type_name_of(action_type)


def interface_class(name: str, kind: Kind) -> Any:
    """Return the class of a type.

    Raises:
        BrokenPackageError: Its package cannot be imported; the text says why, and what to do.
        ValueError: There is no such type; the text names the most similar ones.
    """
    package, short = _split(name, kind)
    if importlib.util.find_spec(package) is None:
        problem = f"the package {package!r} is not installed here. {_how_to_get(package)}"
        raise _unknown(name, kind, problem)
    try:
        module = importlib.import_module(f"{package}.{kind}")
    except Exception as error:  # any error of a broken package
        if isinstance(error, ModuleNotFoundError) and error.name == f"{package}.{kind}":
            problem = f"the package {package!r} has no {_NOUNS[kind]}s."
            raise _unknown(name, kind, problem) from None
        raise BrokenPackageError(
            f"the package {package!r} is here, but cannot be imported"
            f" ({type(error).__name__}: {error}). Source the setup file of the workspace that it"
            " was built in, for this Python."
        ) from error
    found = getattr(module, short, None)
    if not all(hasattr(found, mark) for mark in _MARKS[kind]):
        raise _unknown(name, kind, f"the package {package!r} has no {_NOUNS[kind]} {short!r}.")
    return found


def _split(name: str, kind: Kind) -> tuple[str, str]:
    """Return the package and the type's own name."""
    match = _NAME.fullmatch(name)
    if match is None or match[2] != kind:
        raise _unknown(name, kind, f"{name!r} is not {_FORMS[kind]}.")
    return match[1], match[3]


def _how_to_get(package: str) -> str:
    if package == "actionkit_interfaces":
        return "`actionkit interfaces build --own --install` makes it."
    if (wanted := wheel(package)) is not None:
        how = f"Install it: `pip install {wanted}`, or `sudo apt install {wanted}`."
    else:
        address = repository(package)
        where = "" if address is None else f" ({address})"
        how = f"Or build it from its source{where} with `actionkit interfaces build`."
    return f"If it is in a workspace of yours, source that: `source install/setup.bash`. {how}"


def _unknown(name: str, kind: Kind, problem: str) -> ValueError:
    known = installed(kind)
    near = similar_names(name, known, alike=0.7)  # all names have "/action/" in common
    if near:
        hint = f"Did you mean {' or '.join(near)}?"
    elif known:
        hint = f"Installed are: {', '.join(known[:8])}{' and more' if len(known) > 8 else ''}."
    else:
        hint = "None at all are installed: source the setup file of your workspace."
    return ValueError(f"{problem} {hint}")
