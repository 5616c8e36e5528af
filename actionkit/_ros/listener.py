"""A goal as this package sees it: who is told of it, and the servers that may have it."""

from __future__ import annotations

import uuid
from dataclasses import dataclass
from typing import Any, Protocol

from actionkit._model.cancel_answer import CancelAnswer
from actionkit._model.values import GoalState


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
    def on_status(self, state: GoalState) -> None: ...
    def on_result(self, state: GoalState | None, result: Any, *, outdated: bool = False) -> None:
        """The server answered a request for the result.

        Args:
            state: The state in which the goal ended; `None` where the server does not know it.
            result: The result message; an empty one where the server does not know the goal.
            outdated: Whether the goal was not known when this was asked, and may be known now.
        """

    def on_cancel_sent(self) -> None: ...
    def on_cancel_answer(self, answer: CancelAnswer) -> None: ...
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
