"""Cancels the goals that processes have left running."""

from __future__ import annotations

import threading
import time
import uuid
from collections import defaultdict
from collections.abc import Iterable
from functools import partial
from typing import Any

from actionkit._calls.ledger.store import Leftover, attempt_id, attempt_number
from actionkit._calls.transport import transport
from actionkit._leftovers.finding import call_with, number_of
from actionkit._model.values import CancelReport
from actionkit._ros.cancelling.cancel_goals import cancel_goals
from actionkit._ros.cancelling.cancelling import Cancelling
from actionkit._ros.others_goals.goal_board import DISCOVERY, FIRST, WatchedGoal
from actionkit._ros.others_goals.survey import Survey
from actionkit._ros.rclpy_private.native import GONE
from actionkit._threads.diagnostics import log_own_error
from actionkit._threads.waiting import Flag

_TICK = 0.1
"""Seconds at the end to tell all that is known."""
_LATE = 60.0
"""Seconds in which a server that needs long may still accept a goal, from when it was written down.
It may have been sent later, after a wait for the server. So this counts only where there are many.
"""
_MANY = 50
"""So many goals that no server knows yet cannot all be asked for until the end."""
_WORST = (
    CancelReport.REFUSED,
    CancelReport.UNKNOWN,
    CancelReport.CONFIRMED,
    CancelReport.NOT_NEEDED,
)
_Told = dict[Leftover, CancelReport]


class CancellingCalls(Cancelling):
    """Calls of one action. Their goals are to be cancelled: those that are seen, or may come."""

    def __init__(self, name: str, calls: Iterable[Leftover]) -> None:
        newest_first = sorted(calls, key=lambda call: call.sent, reverse=True)
        super().__init__(name, [str(call.goal_id) for call in newest_first])
        self._by_id = sorted(newest_first, key=number_of)
        self._newest: dict[Leftover, int] = {}
        """The number of the latest goal of a call that a server has shown."""

    def take_news(self, news: Any, wall: float) -> list[WatchedGoal]:
        """Record news from a `StatusReader`; cancel also the goals of the calls that it shows."""
        known = set(self.board.goals)
        changed = super().take_news(news, wall)
        for goal in changed:
            goal_id = uuid.UUID(goal.goal_id)
            if (call := call_with(self._by_id, goal_id)) is None:
                continue
            self.add(goal.goal_id, runs=not goal.ended)
            number = attempt_number(call.goal_id, goal_id)
            newest = self._newest[call] = max(number, self._newest.get(call, 0))
            # Its process is dead, and sent a retry only when the goal before it had ended. The
            # first status of a server may be several, which it has kept.
            had_ended = goal.ended and goal.goal_id not in known
            retries = had_ended and (goal.state != "SUCCEEDED" or call.judged)
            if number == newest < call.attempts and (retries or call.parallel):
                self.add(str(attempt_id(call.goal_id, number + 1)))
            for earlier in range(1, number) if call.parallel else ():
                self.add(str(attempt_id(call.goal_id, earlier)))
        return changed

    def may_come(self, goal_id: str, now: float) -> bool:
        """Whether a goal that no server knows may be accepted yet, or be on one not seen yet."""
        call = self._call_with(goal_id)
        if (newest := self._newest.get(call)) is None:
            few = len(self._by_id) - len(self._newest) < _MANY
            return few or time.time() - call.sent < _LATE or self.looks_for(now) < DISCOVERY
        if call.parallel:
            return True
        is_next = attempt_number(call.goal_id, uuid.UUID(goal_id)) > newest
        return is_next and not self.agreed(str(attempt_id(call.goal_id, newest)))

    @property
    def done(self) -> bool:
        """Whether the fate of every goal is known. One that is not stopped may end by itself."""
        refused = [fate.goal_id for fate in self.fates if fate.cancel == "REFUSED"]
        rows = [self.board.goals.get(goal_id) for goal_id in refused]
        return super().done and all(row and row.ended and row.state != "LOST" for row in rows)

    def _ended(
        self, row: WatchedGoal, target: Any, now: float, over: bool
    ) -> tuple[str, str] | None:
        if row.state == "LOST" and not over:
            return None  # its server may come into sight again
        return super()._ended(row, target, now, over)

    @property
    def reports(self) -> _Told:
        """What happened to each call: the worst that happened to one of its goals."""
        told: _Told = {}
        for fate in self.fates:
            call = self._call_with(fate.goal_id)
            told[call] = min(fate.report, told.get(call, fate.report), key=_WORST.index)
        return told

    @property
    def failed(self) -> list[Leftover]:
        """The calls for which their latest goal was seen to end without success."""
        return [call for call, number in self._newest.items() if self._has_failed(call, number)]

    def _has_failed(self, call: Leftover, number: int) -> bool:
        goal = self.board.goals.get(str(attempt_id(call.goal_id, number)))
        ends = ("CANCELED",) if call.judged else ("CANCELED", "ABORTED")
        return goal is not None and goal.state in ends

    def _call_with(self, goal_id: str) -> Leftover:
        call = call_with(self._by_id, uuid.UUID(goal_id))
        assert call is not None
        return call


def cancel_all(
    calls: Iterable[Leftover],
    seconds: float,
    server: float,
    unseen: set[Leftover],
    failed: set[Leftover],
) -> _Told:
    """Cancel the goals of calls; return what happened to each call.

    This takes so many `seconds` at most; a server is looked for `server` seconds at most. Calls
    are added to `unseen` if no server of their action is in sight after that, and to `failed` if
    their latest goal was seen to have ended without success.
    """
    transport()  # or the interpreter's exit would not wait for the communication threads
    by_domain: dict[int, list[Leftover]] = defaultdict(list)
    for call in calls:
        by_domain[call.domain_id].append(call)
    told = {call: CancelReport.UNKNOWN for each in by_domain.values() for call in each}
    done = {domain: Flag() for domain in by_domain}
    until = time.monotonic() + seconds
    for domain, left in by_domain.items():
        cancel = partial(_cancel, domain, left, seconds, server, told, unseen, failed, done[domain])
        threading.Thread(target=cancel, name="actionkit-leftovers", daemon=True).start()
    for flag in done.values():
        flag.wait(max(0.0, until - time.monotonic()))
    return dict(told)


def _cancel(
    domain: int,
    calls: list[Leftover],
    seconds: float,
    server: float,
    told: _Told,
    unseen: set[Leftover],
    failed: set[Leftover],
    done: Flag,
) -> None:
    """Cancel the goals of calls in one ROS domain."""
    until = time.monotonic() + seconds - _TICK
    by_name: dict[str, list[Leftover]] = defaultdict(list)
    for call in calls:
        by_name[call.action_name].append(call)
    actions = [CancellingCalls(name, left) for name, left in by_name.items()]
    least = min(FIRST, seconds / 3)
    for action in actions:
        action.waits_for_status = least

    def tell() -> None:
        for action in actions:
            action.settle(time.monotonic(), over=True)
            if action.has_server:
                told.update(action.reports)
                failed.update(action.failed)
            elif seconds >= server:
                unseen.update(by_name[action.name])
        done.set()  # closing may take longer

    def over(now: float) -> bool:
        if now >= until and not done.is_set():
            tell()
        return now >= until

    try:
        with Survey(domain) as survey:
            survey.on_look.append(lambda _: over(time.monotonic()))  # a server may have come late
            look = min(server, until - time.monotonic())
            cancel_goals(survey, [*actions], over=over, look=look, least=least)
            if not done.is_set():
                tell()
    except GONE:
        pass  # the program ends
    except Exception:  # noqa: BLE001  the goals in other domains count, too
        log_own_error()
    finally:
        done.set()
