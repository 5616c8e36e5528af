"""Checks of what users pass, with errors that name the remedy."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import Any


class Unset:
    """The type of an argument that was left out, where `None` means "no limit"."""

    def __repr__(self) -> str:
        return "<as the client's timeouts.total>"


UNSET = Unset()


def check_type(name: str, value: object, cls: type) -> None:
    """Raise where `value` is no `cls`.

    Raises:
        TypeError: It is not.
    """
    if not isinstance(value, cls):
        raise TypeError(f"{name}={value!r} must be a {cls.__name__}")


def check_function(name: str, value: object, wanted: str) -> None:
    """Raise where `value` is nothing that can be called and gives its answer at once.

    Args:
        name: The parameter's name, for the error.
        value: What the user gave.
        wanted: What it must be, such as "a function (Outcome) -> Verdict".

    Raises:
        TypeError: It cannot be called, or is a class or a coroutine function.
    """
    if not callable(value):
        raise TypeError(f"{name}={value!r} must be {wanted}")
    if inspect.isclass(value):
        raise TypeError(
            f"{name}={value!r} must be {wanted}; this is a class: make an instance of it"
        )
    called = getattr(type(value), "__call__", None)  # noqa: B004  the method, for its kind
    if inspect.iscoroutinefunction(value) or inspect.iscoroutinefunction(called):
        raise TypeError(
            f"{name}={value!r} must be {wanted}; this is a coroutine function, and no event loop is"
            " there to run it: make it a plain one"
        )


_RCLPY_NAMES = {
    "timeout_sec": "is called timeout here",
    "feedback_callback": "is called on_feedback here",
    "goal_uuid": "is not needed: the client makes the goal's id, see GoalFuture.goal_id",
}


def refuse_unknown(unknown: Mapping[str, Any]) -> None:
    """Raise where keywords were given that do not exist; those of rclpy are explained.

    Raises:
        TypeError: Some were.
    """
    for name, value in unknown.items():
        if name in _RCLPY_NAMES:
            raise TypeError(
                f"unknown argument {name}={value!r}: rclpy's {name} {_RCLPY_NAMES[name]}"
            )
        raise TypeError(
            f"unknown argument {name}={value!r}: there are goal, timeout, on_feedback, retry and"
            " classify"
        )
