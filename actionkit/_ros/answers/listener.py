"""The interfaces of objects that get news about servers, and their answers about one goal."""

from __future__ import annotations

import uuid
from typing import Any, Protocol

from actionkit._model.cancel_answer import CancelAnswer
from actionkit._model.values import GoalState


class Waiter(Protocol):
    """Waits for a server, and then for its goal's turn."""

    def on_server_ready(self) -> None: ...
    def on_type_mismatch(self, served: tuple[str, ...]) -> None: ...
    def on_server_lost(self, reason: str) -> None: ...
    def on_turn(self) -> None:
        """Its goal may be sent now; if it is not sent, it leaves the queue."""


class GoalListener(Protocol):
    """Gets the servers' news about one goal that was sent."""

    goal_id: uuid.UUID

    @property
    def unwanted(self) -> bool: ...
    def on_server_ready(self) -> None: ...
    def on_servers_changed(self, servers: int, away: int) -> None:
        """So many servers may have the goal now, and so many of these have left the graph."""

    def on_accepted(self) -> None: ...
    def on_rejected(self) -> None: ...
    def on_feedback(self, messages: list[bytes]) -> None: ...
    def on_status(self, state: GoalState) -> None: ...
    def on_result(
        self,
        state: GoalState | None,
        result: Any,
        asked_at: float,
        *,
        outdated: bool = False,
        everybody: bool = True,
        ends: int = 1,
        answers: int = 1,
    ) -> None:
        """The server answered a request for the result.

        Args:
            state: The state in which the goal ended; `None` if the server does not know the goal.
            result: The result message; an empty one if the server does not know the goal.
            asked_at: When the request was sent, in monotonic seconds.
            outdated: Whether the goal was unknown at that time but may be known now.
            everybody: Whether each server in sight has answered this request.
            ends: How many answered it with a state in which the goal ended.
            answers: How many servers have answered it.
        """

    def on_cancel_sent(self) -> None: ...
    def on_cancel_answer(self, answer: CancelAnswer, asked_at: float) -> None: ...
    def on_server_lost(self, reason: str) -> None: ...
