"""Cancels all goals of an action, also those that other clients have sent."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from actionkit._calls.future import GoalFuture
from actionkit._model.errors import ServerUnavailableError
from actionkit._model.values import CancelReport

if TYPE_CHECKING:
    from actionkit._calls.session import Session


def cancel_everything(
    session: Session, attach: Callable[[uuid.UUID], GoalFuture[Any, Any]], timeout: float
) -> dict[uuid.UUID, CancelReport]:
    """Cancel each goal that the servers have, and those of the session; see `Client`.

    `attach` returns a future for a goal that another client has sent.
    """
    from actionkit._ros.tools.watch import goals_in_flight

    until = time.monotonic() + timeout
    if not session.wait_for_server(timeout):
        raise ServerUnavailableError(
            f"No server for action {session.action_name!r} is ready after {timeout:g} s, so no goal"
            " was cancelled.",
            action_name=session.action_name,
        )
    futures: dict[uuid.UUID, GoalFuture[Any, Any]] = {}
    while True:
        own = {call.goal_id: call.future for call in list(session.calls)}
        seen = goals_in_flight(
            session.identity.domain_id,
            session.port.names.status,
            lambda: time.monotonic() >= until,
        )
        new = {*own, *(uuid.UUID(goal.goal_id) for goal in seen)} - set(futures)
        if not new:
            break
        for goal_id in new:
            futures[goal_id] = own[goal_id] if goal_id in own else attach(goal_id)
            futures[goal_id].cancel()
        # Goals that came meanwhile are seen the next time.
        for goal_id in new:
            futures[goal_id]._wait_until_over(max(0.0, until - time.monotonic()))
        if time.monotonic() >= until:
            break
    reports = {goal_id: _report(future) for goal_id, future in futures.items()}
    for call in list(session.calls):
        if call.left_alone and call.goal_id in futures:  # its server has refused, or is silent
            session.call_soon(partial(call.close, abandon=True, because="its cancel was over"))
    return reports


def _report(future: GoalFuture[Any, Any]) -> CancelReport:
    if future.done():
        return future.outcome(0).cancel or CancelReport.NOT_NEEDED  # it ended by itself
    refused = any(goal.cancel_refused for goal in future._call.goals.reports)
    return CancelReport.REFUSED if refused else CancelReport.UNKNOWN
