"""Finds the name of an action type, and the type by its name. No rclpy here."""

from __future__ import annotations

import importlib
import re
from typing import Any

_NAME = re.compile(r"([A-Za-z]\w*)/action/([A-Za-z]\w*)")
_PARTS = ("Goal", "Result", "Feedback", "Impl")


def type_name(action_type: object) -> str:
    """Return the name of an action type, such as `test_msgs/action/Fibonacci`.

    `action_type` is its class or its name.

    Raises:
        TypeError: It is neither.
        ValueError: It is a str that is not such a name.
    """
    if isinstance(action_type, str):
        if _NAME.fullmatch(action_type):
            return action_type
        raise ValueError(
            f"action_type={action_type!r} is no action type: one is written as"
            " test_msgs/action/Fibonacci"
        )
    if isinstance(action_type, type) and all(hasattr(action_type, part) for part in _PARTS):
        package = action_type.__module__.split(".", 1)[0]
        return f"{package}/action/{action_type.__name__}"
    raise TypeError(
        f"action_type={action_type!r} must be an action class, such as test_msgs.action.Fibonacci"
        " (not a message, a service, or its Goal), or its name, 'test_msgs/action/Fibonacci'"
    )


def load_type(name: str) -> Any:
    """Return the class of an action type.

    Raises:
        ValueError: There is no such type, or its package cannot be imported; the text says which.
    """
    package, _, kind = name.split("/")
    try:
        found = getattr(importlib.import_module(f"{package}.action"), kind, None)
    except Exception as error:  # a broken package may raise any error
        raise ValueError(
            f"the action type {name} cannot be imported ({type(error).__name__}: {error})."
            f" {_remedy(package)}"
        ) from error
    if not all(hasattr(found, part) for part in _PARTS):
        raise ValueError(f"the package {package!r} has no action {kind!r}")
    return found


def _remedy(package: str) -> str:
    if package == "actionkit_interfaces":
        return "`actionkit interfaces build --own --install` makes it"
    return "Source the setup file of the workspace that it was built in, or install its package"
