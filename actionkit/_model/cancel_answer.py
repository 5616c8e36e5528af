"""A server's answer to a cancel request, in one word."""

from __future__ import annotations

from enum import Enum, auto


class CancelAnswer(Enum):
    """What a server answers about one goal: its return code and its list read together (R12)."""

    ACCEPTED = auto()
    REFUSED = auto()
    UNKNOWN_GOAL = auto()
    """Not accepted yet, expired, or accepted by the server's process before a restart."""
    TERMINATED = auto()
    """The goal had ended before the request came, or is being cancelled already."""
