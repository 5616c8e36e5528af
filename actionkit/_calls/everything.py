"""Cancels all goals of an action, also those that other clients have sent."""

from __future__ import annotations

import time
import uuid
from collections import Counter
from collections.abc import Callable
from contextlib import closing
from functools import partial
from typing import TYPE_CHECKING, Any

from actionkit._calls.future import GoalFuture
from actionkit._model.errors import ServerUnavailableError
from actionkit._model.values import CancelReport
from actionkit._threads.waiting import Flag

if TYPE_CHECKING:
    from actionkit._calls.attempt import Attempt
    from actionkit._calls.session import Session

_LOOK = 0.05
"""Seconds between two looks at goals that were given up on before."""
_ANSWER = 1.0
"""Seconds for a server to say which goals it is cancelling."""
UNKNOWN_GOALS = uuid.UUID(int=0)
"""Stands for the goals of servers that did not say which they have; ROS has it for all goals."""
AnyFuture = GoalFuture[Any, Any]


def cancel_everything(
    session: Session, attach: Callable[[uuid.UUID], AnyFuture], timeout: float
) -> dict[uuid.UUID, CancelReport]:
    """Cancel each goal that the servers have, and those of the session; see `Client`.

    `attach` returns a future for a goal that another client has sent; it raises `ValueError` if the
    session follows the goal already.
    """
    from actionkit._ros.tools.cancel import AllSaid, CancelSaid, GoalCanceller
    from actionkit._ros.tools.watch import goals_seen

    # Before they are cancelled: those that end at once are told of, too.
    calls = list(session.calls)
    futures: dict[uuid.UUID, AnyFuture] = {call.goal_id: call.future for call in calls}
    session.cancel_all()
    if not session.wait_for_server(timeout):
        raise ServerUnavailableError(
            f"No server for action {session.action_name!r} is ready after {timeout:g} s, so only"
            " this client's own calls were cancelled.",
            action_name=session.action_name,
        )
    until = time.monotonic() + timeout
    given_up: dict[uuid.UUID, Attempt] = {}
    made: set[uuid.UUID] = set()
    asked: set[uuid.UUID] = set()
    missed = number = 0
    stopping: list[uuid.UUID] = []
    answered = Flag()
    answers: Counter[int] = Counter()
    consents: Counter[int] = Counter()

    def hear(said: CancelSaid | AllSaid) -> None:
        if isinstance(said, AllSaid):
            stopping.extend(map(uuid.UUID, said.canceling))
            consents[said.request] += not said.code
            answers[said.request] += 1
            answered.set()

    def all_have(done: Counter[int]) -> bool:
        return max(list(done.values()), default=0) >= max(1, session.link.readiness.count)

    now = time.time()
    place, status = session.port.runtime.place, session.port.names.status
    with closing(GoalCanceller(session.action_name, hear, place)) as canceller:
        # Beside the look at the status, which a busy server may send too late. Not those that are
        # accepted later: such a server may also take this late.
        while True:
            if not all_have(consents):
                number += 1
                canceller.cancel_all(number, until=now)
            for call in list(session.calls):
                futures.setdefault(call.goal_id, call.future)
            seen = goals_seen(place, status, lambda: False)
            if not seen:
                answered.wait(min(_ANSWER, max(0.0, until - time.monotonic())))
            in_flight = {*stopping} | {uuid.UUID(goal.goal_id) for goal in seen if goal.in_flight}
            for goal_id in in_flight - {*futures, *given_up}:
                if (attempt := session.watched(goal_id)) is not None:
                    given_up[goal_id] = attempt  # a call of this client gave up on it, and ended
                    session.call_soon(attempt.cancel_again)
                else:
                    try:
                        futures[goal_id] = attach(goal_id)
                    except ValueError:
                        continue  # it is of a call that has just begun: seen the next time
                    made.add(goal_id)
            new = {*futures, *given_up} - asked
            asked |= new
            for goal_id in new:
                if goal_id in futures:
                    futures[goal_id].cancel()
            for goal_id in new:
                _wait(futures.get(goal_id), given_up.get(goal_id), until)
            if not seen and (made or given_up) and not missed and time.monotonic() < until:
                missed += 1  # there are goals, and their status did not come in time
            elif (not new and all_have(answers)) or time.monotonic() >= until:
                break
    for call in list(session.calls):
        if call.goal_id in made:  # its server has refused, or is silent
            session.call_soon(partial(call.close, abandon=True, because="its cancel was over"))
    reports = {goal_id: _of_future(future) for goal_id, future in futures.items()}
    for goal_id in stopping:
        if reports.get(goal_id) is CancelReport.NOT_NEEDED:  # it had stopped before we followed it
            reports[goal_id] = CancelReport.CONFIRMED
    refused = all_have(answers) and CancelReport.REFUSED in reports.values()  # for that an error
    if not all_have(consents) and not refused:
        reports[UNKNOWN_GOALS] = CancelReport.UNKNOWN
    return reports | {goal_id: _of_attempt(each) for goal_id, each in given_up.items()}


def _wait(future: AnyFuture | None, attempt: Attempt | None, until: float) -> None:
    if future is not None:
        future._wait_until_over(max(0.0, until - time.monotonic()))
    while attempt is not None and attempt.goal.facts.may_run and time.monotonic() < until:
        Flag().wait(_LOOK)


def _of_future(future: AnyFuture) -> CancelReport:
    left = future._call.goals.left().reports
    if any(goal.cancel_refused for goal in left):
        return CancelReport.REFUSED
    if left or not future.done():
        return CancelReport.UNKNOWN
    return future.outcome(0).cancel or CancelReport.NOT_NEEDED  # it ended by itself


def _of_attempt(attempt: Attempt) -> CancelReport:
    facts = attempt.goal.facts
    if not facts.may_run:
        return CancelReport.CONFIRMED
    return CancelReport.REFUSED if facts.refused else CancelReport.UNKNOWN
