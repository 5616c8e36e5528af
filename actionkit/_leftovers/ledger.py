"""The ledger that users make: what other processes have left in it, and what is done about that."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

from actionkit._calls.ledger import keys
from actionkit._calls.ledger.file import LedgerFile
from actionkit._calls.ledger.keys import KeyFate
from actionkit._calls.ledger.store import Leftover, attempt_number
from actionkit._model.arguments import UNSET, Unset
from actionkit._model.errors import LedgerError
from actionkit._model.settings import check_seconds
from actionkit._model.values import CancelReport
from actionkit._threads.diagnostics import log_here
from actionkit._threads.waiting import Flag

if TYPE_CHECKING:
    from actionkit._calls.futures.future import GoalFuture
    from actionkit._client import Client
    from actionkit._model.action_type import ActionType, FeedbackT, GoalT, ResultT

_LOOK = 10.0
"""Seconds to look at most which goals the servers have."""
_SERVER = 5.0
"""Seconds until a server that runs is in sight."""
_AGAIN = 0.1
"""Seconds between two looks whether other processes have finished."""
_STOPPED = (CancelReport.CONFIRMED, CancelReport.NOT_NEEDED)


class Ledger(LedgerFile):
    """A file in which clients write down their goals before they send them.

        with Client(Fibonacci, "fibonacci", ledger=Ledger("mission.db")) as client:
            client.call(goal, timeout=60.0)

    A goal is removed when it is known to have stopped. So the goals in `leftovers()` may still run:
    their process was killed, or its computer lost power. Any number of clients and processes may
    share a file. The file must be on a disk of this computer.
    """

    def leftovers(self) -> list[Leftover]:
        """Return the calls of processes that have ended, with goals that may run, oldest first.

        Raises:
            LedgerError: The file cannot be used.
        """
        return self._store.leftovers()

    def keys(self) -> dict[str, KeyFate]:
        """Return the keys of calls, the oldest first, and what is known of the goal of each.

        `"succeeded"`: its result is kept. `"running"`: it may run. `"stopped"`: it has failed, was
        stopped, or was not sent yet; the next call sends it. `"unknown"`: no server knows it, so
        it does not run, but it may have finished.

        Raises:
            LedgerError: The file cannot be used.
        """
        return keys.fates(self._store)

    def forget(self, key: str) -> bool:
        """Remove a key, and the result that is kept with it. The next call with it sends its goal.

        Returns:
            Whether the key was there.

        Raises:
            LedgerError: Its goal may run: cancel it first, or call with the key to follow it. Or
                the file cannot be used.
        """
        return keys.forget(self._store, key)

    def cancel(self, timeout: float = 10.0) -> dict[Leftover, CancelReport]:
        """Cancel the goals that processes have left, and wait until they have stopped.

        Blocks. If several processes do it at once, only one of them cancels each goal, and the
        others wait for it.

        Args:
            timeout: Seconds for everything. A process may send a goal just before it ends. A server
                that does not know the goal yet may still accept it. So this looks for it until the
                time is over.

        Returns:
            What happened to the goals of each call. `CONFIRMED`: the server has stopped them.
            `NOT_NEEDED`: they had ended, or no server knows them. These are removed from the file.
            `REFUSED`: the server does not stop them. `UNKNOWN`: no server was seen, none
            answered in time, or another process has not finished. The action's package is not
            needed.

        Raises:
            LedgerError: The file cannot be used.
            TypeError, ValueError: A bad `timeout`.
        """
        seconds = check_seconds("timeout", timeout, optional=False)
        assert seconds is not None
        return self._cancel(seconds)

    def _cancel(
        self, seconds: float, *, server: float = _SERVER, forgotten: set[Leftover] | None = None
    ) -> dict[Leftover, CancelReport]:
        """Cancel; look for a server `server` seconds at most.

        With a set `forgotten`, the calls of actions without a server in sight are removed, too, and
        are added to it.
        """
        unseen: set[Leftover] = set()
        until = time.monotonic() + seconds
        told: dict[Leftover, CancelReport] = {}
        while True:
            with self._claimed(lambda goal: goal not in told, follows=False) as (claimed, stopped):
                if claimed:  # else it needs no rclpy
                    from actionkit._leftovers.cancelling import cancel_all

                    left = max(0.0, until - time.monotonic())
                    failed: set[Leftover] = set()
                    told.update(cancel_all(claimed, left, server, unseen, failed))
                    stopped += [goal for goal in claimed if told[goal] in _STOPPED]
                    # The others may have finished.
                    keys.confirm_stopped(self._store, failed.intersection(stopped))
                    if forgotten is not None:
                        forgotten |= unseen
                        stopped.extend(unseen)
            others = [goal for goal, follows in self._store.in_other_hands().items() if not follows]
            others = [goal for goal in others if goal not in told]
            if not others or time.monotonic() >= until:
                return told | dict.fromkeys(others, CancelReport.UNKNOWN)
            Flag().wait(_AGAIN)

    def attach(
        self,
        client: Client[ActionType[GoalT, ResultT, FeedbackT]],
        *,
        timeout: float | Unset | None = UNSET,
        on_feedback: Callable[[FeedbackT], object] | None = None,
        on_give_up: Literal["leave", "cancel"] = "leave",
    ) -> list[GoalFuture[ResultT, FeedbackT]]:
        """Follow the goals of the action of `client` that processes have left running.

        Only one process gets each goal. The goal belongs to this process until it has stopped, or
        until you stop following it. Blocks for at most 15 seconds, because a server may still
        accept a goal that it does not know yet. In asyncio, use `asyncio.to_thread`.

        Args:
            client: The client that follows them.
            timeout: As for `Client.attach`.
            on_feedback: As for `Client.attach`.
            on_give_up: As for `Client.attach`.

        Returns:
            Their futures, in the order of the calls, the oldest first. A future fails with
            `GoalUnknownError` if no server knows its goal. Then the goal does not run, but may have
            finished.

        Raises:
            ClientClosedError: The client was closed.
            LedgerError: The file cannot be used. Or another process still cancels or follows such a
                goal after 10 seconds: then you must not send anything.
            TypeError, ValueError: An argument is wrong.
        """
        from actionkit._leftovers.finding import domain_of, find

        until = time.monotonic() + _LOOK
        action = client.action_name, domain_of(client)

        def is_meant(goal: Leftover) -> bool:
            return (goal.action_name, goal.domain_id) == action

        waits = False
        while others := [goal for goal in self._store.in_other_hands() if is_meant(goal)]:
            if time.monotonic() >= until:
                goal = others[0]
                raise LedgerError(
                    f"another process cancels or follows goal {goal.goal_id} of"
                    f" {goal.action_name}, which a process that has ended has left running. Send"
                    " nothing until it has stopped; `actionkit leftovers` shows the others."
                )
            if not waits:
                waits = True
                text = "waiting for at most %g s for another process that cancels or follows %s"
                log_here(logging.WARNING, text, _LOOK, _named(others))
            Flag().wait(_AGAIN)
        followed: dict[Leftover, list[GoalFuture[ResultT, FeedbackT]]] = {}
        with self._claimed(is_meant, follows=True) as (claimed, _):
            if claimed:
                text = "looking for at most %g s for %s, left by a process that has ended"
                log_here(logging.WARNING, text, _LOOK, _named(claimed))
            if claimed and not client.wait_for_server(_SERVER):
                until = time.monotonic()  # the futures say so
            for goal, goal_id in find(client, claimed, until):
                future = client.attach(
                    goal_id or goal.goal_id,
                    timeout=timeout,
                    on_feedback=on_feedback,
                    on_give_up=on_give_up,
                )
                client._session.taken_over.append(future)
                followed.setdefault(goal, []).append(future)
                if goal_id is not None and not goal.parallel:  # its process is dead: it is the last
                    self._limit_soon(goal.goal_id, attempt_number(goal.goal_id, goal_id))
            for goal in followed:
                claimed.remove(goal)
        for goal, futures in followed.items():
            over = partial(self._over, goal, futures)
            for future in futures:
                # No done callback: a process that is told to end does not wait for these.
                future._over.add_waiter(over)
                if future.done():
                    over()
        by_age = sorted(followed, key=lambda goal: goal.sent)
        return [future for goal in by_age for future in followed[goal]]

    @contextmanager
    def _claimed(
        self, wanted: Callable[[Leftover], bool], *, follows: bool
    ) -> Iterator[tuple[list[Leftover], list[Leftover]]]:
        """Take what is wanted in hand; at the end, give back what is left in the list.

        The second list is for those that have stopped, to be removed.
        """
        claimed: list[Leftover] = []
        stopped: list[Leftover] = []
        try:
            self._store.claim(wanted, claimed, follows=follows)
            yield claimed, stopped
        finally:
            self._store.end_claims(claimed, stopped)

    def _over(self, goal: Leftover, futures: list[GoalFuture[Any, Any]]) -> None:
        """End the claim if all is over. Never blocks; from any thread."""
        if all(future.done() for future in futures):
            has_stopped = all(future.known_to_run is False for future in futures)
            stopped = [goal] if has_stopped else []
            self._do_at_once(partial(self._store.end_claims, [goal], stopped))


def _named(goals: list[Leftover]) -> str:
    """Return the first of some goals of one action, and how many more there are."""
    more = f" and {len(goals) - 1} more" if len(goals) > 1 else ""
    return f"goal {goals[0].goal_id} of {goals[0].action_name}{more}"


def unfinished(ledger: Ledger) -> bool:
    """Whether there are goals of dead processes that nobody follows: left over, or being cancelled.

    Raises:
        LedgerError: The file cannot be used.
    """
    others = ledger._store.in_other_hands().values()
    return bool(ledger.leftovers()) or not all(others)


def writers(ledger: Ledger) -> set[int]:
    """Return the ids of the living processes that write in a ledger.

    Raises:
        LedgerError: The file cannot be used.
    """
    return ledger._store.writers()
