"""Fills messages with a behaviour's contents. No rclpy here."""

from __future__ import annotations

from collections.abc import Mapping
from functools import reduce
from typing import Any

from actionkit.servers._run import Content


def message_of(message: Any, content: Content) -> Any:
    """Return a new message with its fields set; without a field `sequence`, ignore numbers.

    The content may also be a message of that class; then this is returned.
    """
    if isinstance(content, type(message)):
        return content
    if isinstance(content, Mapping):
        for path, value in content.items():
            *parents, field = path.split(".")
            setattr(reduce(getattr, parents, message), field, value)
    elif hasattr(message, "sequence"):
        message.sequence = list(content)
    return message
