"""Makes calls of every kind in one process of the soak; each gets a record."""

from __future__ import annotations

import asyncio
import random
import threading
import time
from collections.abc import Callable
from typing import Any

from test_msgs.action import Fibonacci

from actionkit import (
    ActionKitError,
    Client,
    GoalFuture,
    GoalState,
    Outcome,
    RetryPolicy,
    Timeouts,
    Verdict,
)
from tests.faults.lab import budget
from tests.soak.records import GRACE, KINDS, PATIENCE, Record

_POLICIES = {
    "no retries": RetryPolicy.none(),
    "never_accepted": RetryPolicy(resend="never_accepted"),
    "confirmed_stopped": RetryPolicy(),
    "server_gone": RetryPolicy(resend="server_gone"),
    "always": RetryPolicy(resend="always"),
}
_LONGEST = 2 * PATIENCE
"""Seconds after which a call that has not ended counts as hung."""


def failure(_: object) -> Verdict:
    """Call everything a failure."""
    return Verdict.PERMANENT


def retry_aborted(outcome: Outcome[Any]) -> Verdict:
    """Have a goal that was aborted sent again; else as by default."""
    if outcome.error is None:
        return Verdict.SUCCESS
    aborted = outcome.status is GoalState.ABORTED
    transient = isinstance(outcome.error, ActionKitError) and outcome.error.transient
    return Verdict.TRANSIENT if aborted or transient else Verdict.PERMANENT


_JUDGES: dict[str, Any] = {"": None, "failure": failure, "aborted": retry_aborted}


class Caller:
    """Makes calls with the clients of a process, from any thread."""

    def __init__(self) -> None:
        self.clients = {kind: self.make_client(kind) for kind in KINDS}
        self._lock = threading.Lock()
        self._records: list[Record] = []

    @staticmethod
    def make_client(kind: str) -> Any:
        timeouts = Timeouts(server=10.0, accept=KINDS[kind].accept, cancel=GRACE)
        return Client(Fibonacci, kind, timeouts=timeouts, retry_budget=budget())

    def take_records(self) -> list[Record]:
        """The records until now; each is taken once."""
        with self._lock:
            taken, self._records = self._records, []
        return taken

    def close(self) -> None:
        for client in self.clients.values():
            client.close()

    # -- the sorts of calls ------------------------------------------------------------------

    def one_of_many(self, chance: random.Random) -> None:
        """Make a call, or some, of a sort that chance picks; returns when they have ended."""
        sorts: list[tuple[Callable[[random.Random], None], int]] = [
            (self.wait, 8),
            (self.cancel, 4),
            (self.short_deadline, 4),
            (self.crowd, 1),
            (self.close_early, 1),
        ]
        picked = chance.choices([sort for sort, _ in sorts], [weight for _, weight in sorts])[0]
        picked(chance)

    def wait(self, chance: random.Random) -> None:
        """Wait for the end of a call."""
        record, future = self._begin(chance, _pick(chance, ends=True), PATIENCE)
        _finish(record, future)

    def cancel(self, chance: random.Random) -> None:
        """Cancel a call, once or several times."""
        record, future = self._begin(chance, _pick(chance), PATIENCE)
        _pause(chance, 0.4)
        for _ in range(chance.choice([1, 1, 3])):
            if not future.done():
                record.given_up = record.given_up or time.monotonic()
            future.cancel()
            _pause(chance, 0.02)
        _finish(record, future)

    def short_deadline(self, chance: random.Random) -> None:
        """Let a deadline pass before, at, or after the goal's end."""
        record, future = self._begin(chance, _pick(chance), chance.uniform(0.0, 0.5))
        _finish(record, future)

    def crowd(self, chance: random.Random) -> None:
        """Cancel many goals at once."""
        self._give_up_together(chance, lambda client: client.cancel_all())

    def close_early(self, chance: random.Random) -> None:
        """Close a client with goals in flight."""
        self._give_up_together(chance, lambda client: client.close())

    def _give_up_together(self, chance: random.Random, act: Callable[[Any], object]) -> None:
        kind = chance.choice(["endless", "endless", "endless", "steady", "deaf"])
        with self.make_client(kind) as client:
            begun = [
                self._begin(chance, kind, PATIENCE, client) for _ in range(chance.randint(1, 60))
            ]
            _pause(chance, 1.5)
            for record, future in begun:
                record.together, record.closed = len(begun), True
                record.given_up = None if future.done() else time.monotonic()
            act(client)
            for record, future in begun:
                _finish(record, future)

    # -- under asyncio -----------------------------------------------------------------------

    async def awaited(self, chance: random.Random) -> None:
        """Await some calls at a time; some tasks are cancelled, some twice."""
        await asyncio.gather(*(self._awaited(chance) for _ in range(chance.randint(1, 5))))

    async def _awaited(self, chance: random.Random) -> None:
        record, future = self._begin(chance, _pick(chance), PATIENCE)
        task = asyncio.ensure_future(_await(future))
        patience = chance.uniform(0.0, 0.6)
        if KINDS[record.kind].ends and chance.random() < 0.5:
            patience = _LONGEST
        await asyncio.wait([task], timeout=patience)
        if not task.done():
            if not future.done():
                record.given_up = time.monotonic()
            task.cancel()
            await asyncio.sleep(chance.choice([0.0, 0.01]))
            if chance.random() < 0.3:
                task.cancel()
        await asyncio.wait([task], timeout=_LONGEST)
        await asyncio.to_thread(_finish, record, future)

    # -- one call ----------------------------------------------------------------------------

    def _begin(
        self, chance: random.Random, kind: str, timeout: float, client: Any = None
    ) -> tuple[Record, GoalFuture[Any, Any]]:
        low, high = KINDS[kind].orders
        record = Record(
            kind,
            chance.randint(low, high),
            time.monotonic(),
            timeout,
            chance.choice([*_POLICIES, "confirmed_stopped"]),
            chance.choices([*_JUDGES], [6, 1, 2])[0],
        )
        future = (client or self.clients[kind]).call_async(
            {"order": record.order},
            chance.choice([None, lambda feedback: None]),
            timeout,
            retry=_POLICIES[record.policy],
            classify=_JUDGES[record.judge],
        )
        with self._lock:
            self._records.append(record)
        return record, future


async def _await(future: GoalFuture[Any, Any]) -> None:
    try:
        await future
    except Exception:  # noqa: BLE001  whatever it is, the outcome has it
        return


def _pick(chance: random.Random, *, ends: bool = False) -> str:
    found = {name: kind for name, kind in KINDS.items() if kind.ends or not ends}
    return chance.choices([*found], [4 if kind.answers else 1 for kind in found.values()])[0]


def _pause(chance: random.Random, most: float) -> None:
    threading.Event().wait(chance.uniform(0.0, most))


def _finish(record: Record, future: GoalFuture[Any, Any]) -> None:
    """Wait for the end of a call, with a bound, and note it."""
    try:
        outcome = future.outcome(_LONGEST)
    except TimeoutError:
        record.goals = [str(future.goal_id)]
        record.text = str(future.timeline)
        return
    error = outcome.error
    record.error = "" if error is None else type(error).__name__
    record.cancel = str(outcome.cancel or "")
    record.goals = list(dict.fromkeys(str(event.goal_id) for event in outcome.timeline))
    record.text = str(error or "")
    late = getattr(error, "late_result", None)
    record.late = None if late is None else list(late.sequence)
    if error is None and outcome.result is not None:
        record.result = list(outcome.result.sequence)
    # Last: a record without it is one of a call that did not end.
    record.ended = record.began + outcome.elapsed
