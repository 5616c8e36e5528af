"""The possible answers of a server to a cancel request."""

from __future__ import annotations

from enum import Enum, auto


class CancelAnswer(Enum):
    """A server's answer about one goal, from its return code and its list of goals (R12)."""

    ACCEPTED = auto()
    REFUSED = auto()
    UNKNOWN_GOAL = auto()
    """Not accepted yet, expired, or accepted by the server's process before a restart."""
    TERMINATED = auto()
    """The goal had ended before the request came, or is being cancelled already."""
