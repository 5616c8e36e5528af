"""A goal as this room sees it: who is told of it, and the servers that may have it."""

from __future__ import annotations

import uuid
from dataclasses import dataclass
from typing import Any, Protocol


class GoalListener(Protocol):
    """Who is told what the servers say of one goal."""

    goal_id: uuid.UUID

    @property
    def unwanted(self) -> bool: ...
    def on_server_ready(self) -> None: ...
    def on_type_mismatch(self, served: tuple[str, ...]) -> None: ...
    def on_sent(self) -> None: ...
    def on_send_failed(self, error: Exception) -> None: ...
    def on_accepted(self) -> None: ...
    def on_rejected(self) -> None: ...
    def on_feedback(self, messages: list[bytes]) -> None: ...
    def on_status(self, status: int) -> None: ...
    def on_result(self, status: int, result: Any, *, outdated: bool = ...) -> None: ...
    def on_cancel_sent(self) -> None: ...
    def on_cancel_answer(self, code: int, ours_is_canceling: bool) -> None: ...
    def on_server_lost(self, reason: str) -> None: ...


@dataclass
class SentGoal:
    """One goal that may be on a server.

    Attributes:
        listener: Who is told of it.
        sent_at: When it was sent.
        servers: The ids of the servers in sight that may have it.
        sent_to: Of all that may have it, or take it yet, in sight or not.
    """

    listener: GoalListener
    sent_at: float
    servers: frozenset[bytes]
    sent_to: frozenset[bytes]
