"""Cancels the goals that processes have left running."""

from __future__ import annotations

import time
import uuid
from collections import defaultdict
from collections.abc import Iterable
from contextlib import ExitStack
from functools import partial
from typing import Any

from actionkit._calls.future import GoalFuture
from actionkit._calls.ledger.store import Leftover
from actionkit._client import Client
from actionkit._leftovers.finding import SERVER, goals_of, is_last
from actionkit._messages.by_name import interface_class
from actionkit._model.domain import Domain
from actionkit._model.errors import ActionKitError, GoalUnknownError, ServerUnavailableError
from actionkit._model.settings import Timeouts
from actionkit._model.values import CancelReport, GoalState

_TIME_IS_OVER = "the time to cancel what was left over has ended"
_TICK = 0.5
"""Seconds between two looks for goals that no server knows."""
_WORST = (
    CancelReport.REFUSED,
    CancelReport.UNKNOWN,
    CancelReport.CONFIRMED,
    CancelReport.NOT_NEEDED,
)


def cancel_all(calls: Iterable[Leftover], until: float) -> dict[Leftover, CancelReport]:
    """Cancel the goals of calls until a monotonic time; return what happened to each call."""
    by_action: dict[tuple[int, str, str], list[Leftover]] = defaultdict(list)
    for call in calls:
        by_action[call.domain_id, call.action_name, call.type_name].append(call)
    told = {call: CancelReport.UNKNOWN for each in by_action.values() for call in each}
    with ExitStack() as stack:
        actions = []
        for (domain, name, kind), left in by_action.items():
            seconds = max(0.1, until - time.monotonic())
            limits = Timeouts(server=min(SERVER, seconds), cancel=seconds)
            try:
                action_type = interface_class(kind, "action")
                client = Client(action_type, name, node=Domain(domain), timeouts=limits)
            except (ActionKitError, ImportError, ValueError):
                continue  # such as a package that is not installed here
            stack.callback(client.close)
            actions.append(_Action(client, left))
        for action in actions:
            action.ask_first()
        while (open_ := [each for each in actions if each.waits]) and time.monotonic() < until:
            open_[0].wait(min(_TICK, max(0.0, until - time.monotonic())))
            for action in open_:
                action.ask_again(until)
        for action in actions:
            action.let_go()
    for action in actions:  # their clients are closed, so all futures are done
        told.update(action.reports())
    return told


class _Action:
    """The calls of one action, and the futures of their goals."""

    def __init__(self, client: Client[Any], calls: list[Leftover]) -> None:
        self._client = client
        self._futures: dict[Leftover, dict[uuid.UUID, GoalFuture[Any, Any]]]
        self._futures = {call: {} for call in calls}
        self._looked = False
        self._settled: set[Leftover] = set()
        """Those with a goal that has ended, and that no other goal follows."""

    def ask_first(self) -> None:
        """Cancel the first goal of each call."""
        for call in self._futures:
            self._ask(call, call.goal_id)

    def ask_again(self, until: float) -> None:
        """Cancel retries, and goals that no server knew at first: both may be accepted late."""
        if not self.waits:
            return
        known = goals_of(self._client, until)
        self._looked = bool(known)
        for call in [call for call in self._futures if self._waits(call)]:
            for goal_id in call.ids():
                if goal_id in known and known[goal_id].in_flight:
                    self._ask(call, goal_id)
                elif goal_id in known and is_last(call, known[goal_id].state):
                    self._settled.add(call)

    def _ask(self, call: Leftover, goal_id: uuid.UUID) -> None:
        before = self._futures[call].get(goal_id)
        if before is None or (before.done() and _is_unknown(before)):
            future = self._client.attach(goal_id, on_give_up="cancel")
            future.cancel()
            self._futures[call][goal_id] = future

    def _waits(self, call: Leftover) -> bool:
        futures = self._futures[call].values()
        if not all(future.done() for future in futures):
            return True
        # A retry follows only a goal that has ended; one that was canceled has none, except where
        # `classify=` said so before.
        stopped = any(_report(future) is CancelReport.CONFIRMED for future in futures)
        stopped = stopped and (self._looked or not call.judged)
        return not (
            stopped or call in self._settled or any(_is_last(call, future) for future in futures)
        )

    @property
    def waits(self) -> bool:
        """Whether there is something to wait for."""
        return any(self._waits(call) for call in self._futures)

    def wait(self, seconds: float) -> None:
        """Wait for the end of a goal."""
        until = time.monotonic() + seconds
        for futures in self._futures.values():
            for future in futures.values():
                future._wait_until_over(max(0.0, until - time.monotonic()))

    def let_go(self) -> None:
        """Wait no longer, also not when the client closes."""
        for call in list(self._client._session.calls):
            end = partial(call.close, abandon=True, because=_TIME_IS_OVER)
            self._client._session.call_soon(end)

    def reports(self) -> dict[Leftover, CancelReport]:
        """Return what happened to each call."""
        return {
            call: min(map(_report, futures.values()), key=_WORST.index)
            for call, futures in self._futures.items()
        }


def _is_last(call: Leftover, future: GoalFuture[Any, Any]) -> bool:
    """Whether nothing more is to be expected of a call when this future of it is done."""
    if isinstance(future.outcome(0).error, ServerUnavailableError):
        return True
    return not _is_unknown(future) and is_last(call, str(future.state))


def _is_unknown(future: GoalFuture[Any, Any]) -> bool:
    return isinstance(future.outcome(0).error, GoalUnknownError)


def _report(future: GoalFuture[Any, Any]) -> CancelReport:
    """Return what happened to the goal of a future that is done."""
    outcome = future.outcome(0)
    if future.known_to_run is False:
        canceled = outcome.status is GoalState.CANCELED
        return CancelReport.CONFIRMED if canceled else CancelReport.NOT_NEEDED
    refused = any(goal.cancel_refused for goal in outcome.goals)
    return CancelReport.REFUSED if refused else CancelReport.UNKNOWN
