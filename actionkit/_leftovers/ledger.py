"""The ledger that users make: what other processes have left in it, and what is done about that."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

from actionkit._calls.ledger.file import LedgerFile
from actionkit._calls.ledger.store import Leftover
from actionkit._model.arguments import UNSET, Unset
from actionkit._model.settings import check_seconds
from actionkit._model.values import CancelReport

if TYPE_CHECKING:
    from actionkit._calls.future import GoalFuture
    from actionkit._client import Client
    from actionkit._model.action_type import ActionType, FeedbackT, GoalT, ResultT

_LOOK = 10.0
"""Seconds to look at most which goals the servers have."""
_STOPPED = (CancelReport.CONFIRMED, CancelReport.NOT_NEEDED)


class Ledger(LedgerFile):
    """A file in which clients write down their goals before they send them.

        with Client(Fibonacci, "fibonacci", ledger=Ledger("mission.db")) as client:
            client.call(goal, timeout=60.0)

    A goal is removed when it is known to have stopped. So what is in `leftovers()` was left by a
    process that was killed, or has lost its power, and may still run. Any number of clients and
    processes may share a file; it must be on a disk of this computer.
    """

    def leftovers(self) -> list[Leftover]:
        """Return the calls of processes that have ended, with goals that may run, oldest first.

        Raises:
            LedgerError: The file cannot be used.
        """
        return self._store.leftovers()

    def cancel(self, timeout: float = 10.0) -> dict[Leftover, CancelReport]:
        """Cancel the goals that processes have left, and wait until they have stopped.

        Blocks. If several processes do it at once, each goal is in the hands of one of them.

        Args:
            timeout: Seconds for everything. A goal that no server knows may have been sent just
                before the end, and may be accepted yet. So it is looked for until then.

        Returns:
            What happened to the goals of each call. `CONFIRMED`: the server has stopped them.
            `NOT_NEEDED`: they had ended, or no server knows them. These are removed from the file.
            `REFUSED`: the server does not stop them. `UNKNOWN`: no server was in sight or has
            answered, or the action's package is not installed here.

        Raises:
            LedgerError: The file cannot be used.
            TypeError, ValueError: A bad `timeout`.
        """
        seconds = check_seconds("timeout", timeout, optional=False)
        assert seconds is not None
        until = time.monotonic() + seconds
        claimed = self._claim(lambda _: True)
        told: dict[Leftover, CancelReport] = {}
        try:
            if claimed:  # else it needs no rclpy
                from actionkit._leftovers.cancelling import cancel_all

                told = cancel_all(claimed, until)
        finally:
            self._store.remove(goal.goal_id for goal in claimed if told.get(goal) in _STOPPED)
            for goal in claimed:
                self._store.release(goal)  # those that are still there
        return told

    def attach(
        self,
        client: Client[ActionType[GoalT, ResultT, FeedbackT]],
        *,
        timeout: float | Unset | None = UNSET,
        on_feedback: Callable[[FeedbackT], object] | None = None,
        on_give_up: Literal["leave", "cancel"] = "leave",
    ) -> list[GoalFuture[ResultT, FeedbackT]]:
        """Follow the goals that processes have left running in the action of `client`.

        Each goal is given to one process only. It counts as this process's own until it has
        stopped, or until you stop following it. Blocks for at most 10 seconds: a goal that no
        server knows may be accepted yet. In asyncio, use `asyncio.to_thread`.

        Args:
            client: Follows them.
            timeout: As for `Client.attach`.
            on_feedback: As for `Client.attach`.
            on_give_up: As for `Client.attach`.

        Returns:
            Their futures, oldest first. One fails with `GoalUnknownError` if no server knows the
            goal: then it may be sent again.

        Raises:
            ClientClosedError: The client was closed.
            LedgerError: The file cannot be used.
            TypeError, ValueError: An argument is wrong.
        """
        from actionkit._leftovers.finding import domain_of, find

        futures: list[GoalFuture[ResultT, FeedbackT]] = []
        action = client.action_name, domain_of(client)
        claimed = self._claim(lambda goal: (goal.action_name, goal.domain_id) == action)
        followed = set()
        try:
            for goal, goal_id in find(client, claimed, time.monotonic() + _LOOK):
                future = client.attach(
                    goal_id, timeout=timeout, on_feedback=on_feedback, on_give_up=on_give_up
                )
                followed.add(goal)
                future.add_done_callback(partial(self._over, goal))
                futures.append(future)
        finally:
            for goal in set(claimed) - followed:
                self._store.release(goal)
        return futures

    def _claim(self, wanted: Callable[[Leftover], bool]) -> list[Leftover]:
        return [goal for goal in self.leftovers() if wanted(goal) and self._store.claim(goal)]

    def _over(self, goal: Leftover, future: GoalFuture[Any, Any]) -> None:
        if future.known_to_run is False:
            self._remove_soon(goal.goal_id)
        else:
            self._store.release(goal)
