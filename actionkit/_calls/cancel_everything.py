"""Cancels all goals of an action, also those that other clients have sent."""

from __future__ import annotations

import time
import uuid
from typing import TYPE_CHECKING

from actionkit._goal.facts import GoalFacts
from actionkit._model.errors import ServerUnavailableError
from actionkit._model.values import CancelReport
from actionkit._ros.cancelling.cancelling import Cancelling
from actionkit._ros.others_goals.goal_board import DISCOVERY, FIRST
from actionkit._threads.waiting import Flag

if TYPE_CHECKING:
    from actionkit._calls.sending.call import Call
    from actionkit._calls.sending.session import Session

_LOOK = 0.05
"""Seconds between two looks at the goals of this client."""
UNKNOWN_GOALS = uuid.UUID(int=0)
"""Stands for the goals of servers that did not say which they have; ROS has it for all goals."""


def cancel_everything(session: Session, timeout: float) -> dict[uuid.UUID, CancelReport]:
    """Cancel each goal that the servers have, and those of the session; see `Client`."""
    from actionkit._ros.cancelling.cancel_goals import cancel_goals
    from actionkit._ros.others_goals.survey import Survey

    calls = list(session.calls)  # now: a call that ends at once is told of, too
    session.cancel_all()
    if not session.wait_for_server(timeout):
        raise ServerUnavailableError(
            f"No server for action {session.action_name!r} is ready after {timeout:g} s, so only"
            " this client's own calls were cancelled.",
            action_name=session.action_name,
        )
    now = time.monotonic()
    until = now + timeout
    goals = session.goals_in_flight()
    session.cancel_again(tuple(goal.goal_id for goal in goals))
    action = Cancelling(session.action_name)
    runtime = session.connection.runtime
    least = max(FIRST, runtime.in_graph_since + DISCOVERY - now)
    with Survey(runtime.place, only=session.connection.names) as survey:
        cancel_goals(
            survey,
            [action],
            over=lambda now: now >= until,
            look=least,
            least=least,
            accepted_until=time.time(),  # a busy server may take the request later
        )
    action.settle(time.monotonic(), over=True)
    while time.monotonic() < until and (any(map(_waits, calls)) or any(map(_may_stop, goals))):
        Flag().wait(_LOOK)
    # A client knows its own goals best: it asks for their results, too.
    return {
        **{uuid.UUID(fate.goal_id): fate.report for fate in action.fates},
        **({UNKNOWN_GOALS: CancelReport.UNKNOWN} if action.unheard else {}),
        **{goal.goal_id: _of_goal(goal) for goal in goals},
        **{call.goal_id: _of_call(call) for call in calls},
    }


def _waits(call: Call) -> bool:
    return not call.future.done() and not any(goal.cancel_refused for goal in call.goals.reports)


def _may_stop(goal: GoalFacts) -> bool:
    return goal.may_run and not goal.refused


def _of_goal(goal: GoalFacts) -> CancelReport:
    if not goal.may_run:
        return CancelReport.CONFIRMED
    return CancelReport.REFUSED if goal.refused else CancelReport.UNKNOWN


def _of_call(call: Call) -> CancelReport:
    left = call.goals.left().reports
    if any(goal.cancel_refused for goal in left):
        return CancelReport.REFUSED
    if left or not call.future.done():
        return CancelReport.UNKNOWN
    # A call that ended in time may say what is outdated: that its goal may run.
    told = call.future.outcome(0).cancel or CancelReport.NOT_NEEDED
    return told if told is CancelReport.NOT_NEEDED else CancelReport.CONFIRMED
