"""Tells the servers on one action name apart by what they publish. Pure."""

from __future__ import annotations

from collections.abc import Mapping

GoalKey = tuple[bytes, int, int]
"""A goal on one server: its id, and the two numbers of the stamp of its acceptance."""
_RUNNING = (1, 2, 3)
"""The status codes of goals that have not ended."""


class ServerNumbers:
    """Numbers the servers of an action, from 1.

    A status message does not say who sent it. But it has all running goals of its server, and each
    server stamps its acceptance of a goal itself. So a message with a goal that is known comes from
    that goal's server; and one without the running goals of a server comes from another server. A
    server that is restarted while its goals run counts as another one, because it is one.
    """

    def __init__(self) -> None:
        self._latest: dict[int, Mapping[GoalKey, int]] = {}
        """The goals in the latest message of each server, with their codes."""

    def __len__(self) -> int:
        return len(self._latest)

    def of(self, message: Mapping[GoalKey, int], in_sight: int = 1) -> int:
        """Return the number of the server that has sent this message, which must have goals.

        `in_sight` is how many servers there are, if that is known.
        """
        number = self._known(message, in_sight)
        self._latest[number] = message
        return number

    def _known(self, message: Mapping[GoalKey, int], in_sight: int) -> int:
        for number, latest in self._latest.items():
            if not latest.keys().isdisjoint(message):
                return number
        if len(self._latest) < in_sight:
            return len(self._latest) + 1
        for number, latest in self._latest.items():
            if not any(code in _RUNNING for code in latest.values()):
                return number  # it has forgotten the goals that had ended
        return len(self._latest) + 1
