"""From what a behaviour wants to say to a message. No rclpy here."""

from __future__ import annotations

from collections.abc import Mapping
from functools import reduce
from typing import Any

from actionkit.servers._run import Content


def message_of(message: Any, content: Content) -> Any:
    """Return the message with its fields set; one without a `sequence` takes none for it.

    Args:
        message: A new one.
        content: What it says; or a message of its class, which is returned as it is.
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
