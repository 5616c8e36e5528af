"""What the texts of errors need to know about a call."""

from __future__ import annotations

import uuid
from collections.abc import Callable
from dataclasses import dataclass

from actionkit._calls.errors.graph_snapshot import GraphSnapshot
from actionkit._model.settings import Timeouts
from actionkit._model.values import Timeline


@dataclass(frozen=True)
class ErrorContext:
    """What an error needs to know about its call."""

    action_name: str
    type_name: str
    goal_id: uuid.UUID
    attempts: int
    timeline: Timeline
    elapsed: float
    timeout: float | None
    timeouts: Timeouts
    surroundings: Callable[[], GraphSnapshot]
    attached: bool = False
    """Whether somebody else has sent the goal."""
    key: str | None = None
    """The key of the call in its client's ledger."""
