"""Asks again, when a client closes, to cancel goals that may run though their calls are over."""

from __future__ import annotations

from collections.abc import Iterable

from actionkit._calls.sending.attempt import Attempt
from actionkit._goal.machine import Goal
from actionkit._goal.stages import CancelReason, Stage
from actionkit._threads.waiting import Flag


class LastRequest:
    """Asks for each of these goals, and waits for the answers of servers that refused before.

    It also waits for another server on the name that may run a goal which has ended by itself: that
    one was asked to cancel it just now, and a program that ends at once takes the request with it.
    Other answers are not waited for: closing does not wait again for a server that has not answered
    or that is still cancelling. Only `done` and `_wait_until_over` are for any thread.
    """

    def __init__(self) -> None:
        """Ask nothing yet."""
        self.began = False
        self._awaited: list[Attempt] = []
        self._over = Flag()

    def begin(self, attempts: Iterable[Attempt]) -> None:
        """Ask, and wait for the answers that may be different now."""
        attempts = list(attempts)
        self._awaited = [each for each in attempts if _is_awaited(each.goal)]
        for each in attempts:
            each.give_up(CancelReason.CLOSED)
        self.began = True
        self.look()

    def look(self) -> None:
        """Look whether all have stopped, or are refused again."""
        if self.began and not any(
            each.goal.may_run and not each.goal.facts.refused for each in self._awaited
        ):
            self.drop()

    def drop(self) -> None:
        """Wait no more."""
        self._awaited = []
        self._over.set()

    def done(self) -> bool:
        """Whether the wait is over."""
        return self._over.is_set()

    def _wait_until_over(self, seconds: float) -> bool:
        """Wait for at most so many seconds; return whether the wait is over."""
        return self._over.wait(seconds)


def _is_awaited(goal: Goal) -> bool:
    elsewhere = goal.stage is Stage.ANOTHER_MAY_RUN and goal.cancel_reason is None
    return goal.facts.refused or elsewhere
