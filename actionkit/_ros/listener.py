"""Who is told what the servers say of a goal."""

from __future__ import annotations

import uuid
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
    def on_result(
        self, state: GoalState | None, result: Any, asked_at: float, *, outdated: bool = False
    ) -> None:
        """The server answered a request for the result.

        Args:
            state: The state in which the goal ended; `None` where the server does not know it.
            result: The result message; an empty one where the server does not know the goal.
            asked_at: When the request was sent, in monotonic seconds.
            outdated: Whether the goal was not known when this was asked, and may be known now.
        """

    def on_cancel_sent(self) -> None: ...
    def on_cancel_answer(self, answer: CancelAnswer, asked_at: float) -> None: ...
    def on_server_lost(self, reason: str) -> None: ...
