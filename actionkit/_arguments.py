"""Checks of what users pass, with errors that name the remedy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


class Unset:
    """Stands for "as the client was made", where `None` means "no limit"."""

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
