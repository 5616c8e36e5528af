"""The goals of a toolbox: which are in flight, and what happened to the others."""

from __future__ import annotations

import logging
import threading
import time
import uuid
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from actionkit import CallInfo, GoalEvent, GoalFuture, GoalState
from actionkit._model.field_errors import shown
from actionkit.agents._answers.results import (
    ActionValue,
    ErrorValue,
    GoalsValue,
    GoalValue,
    ListedGoal,
    goal_value,
    may_still_run,
    tool_result,
)
from actionkit.agents._configuration.config import ActionConfig
from actionkit.agents._tool_calls.changes import Changes
from actionkit.agents._values import ToolResult

if TYPE_CHECKING:
    from actionkit._ros.others_goals.goal_board import WatchedGoal

_KEPT = 100
"""Goals that ended, for the tool `goals`."""
_log = logging.getLogger("actionkit")
Future = GoalFuture[Any, Any]


class ToolGoal:
    """One goal, from before it is sent until long after it ended.

    Attributes:
        tool: The tool's name.
        action: The full name of the action.
        call_id: The id of the first goal of its call.
        value: What the tool returns, once the call is over.
        last_states: How each attempt ended, as soon as it was seen; that may be after the call.
        why_cancelled: Why this toolbox cancelled it; `""` where it did not.
    """

    def __init__(self, tool: str, action: str = "") -> None:
        self.tool = tool
        self.action = action
        self.call_id: uuid.UUID | None = None
        self.value: ActionValue | None = None
        self.why_cancelled = ""
        self._changes = Changes()
        self._future: Future | None = None
        self._began = time.monotonic()
        self._ended = 0.0
        self._goal_id: uuid.UUID | None = None
        self._goals: Any = None
        """What is known of the goals that were sent; still kept up to date after the call."""
        self.last_states: dict[uuid.UUID, GoalState] = {}

    def follow(self, future: Future) -> None:
        """Follow a goal that was sent; cancel it if `cancel` was called meanwhile."""
        self._future, self._goals = future, future._call.goals
        self.call_id = future.goal_id
        future.add_done_callback(self._done)
        if self.why_cancelled:
            future.cancel()

    def cancel(self, why: str) -> None:
        """Cancel the goal, unless its call is over; from any thread, never blocks."""
        if self.value is not None:
            return
        self.why_cancelled = self.why_cancelled or why
        if (future := self._future) is not None:
            future.cancel()

    @property
    def ids(self) -> tuple[str, ...]:
        """The ids that a model may know: of the first goal, and of the latest."""
        future = self._future
        latest = self._goal_id if future is None else future.goal_id
        return tuple(str(one) for one in dict.fromkeys((latest, self.call_id)) if one is not None)

    @property
    def sent(self) -> set[str]:
        """The ids of all goals that it has sent."""
        return set() if self._goals is None else {str(o.goal_id) for o in self._goals.reports}

    @property
    def state(self) -> str:
        """Where it is now, for people."""
        future = self._future
        return str(future.state) if future is not None else "SENDING"

    def _done(self, future: Future) -> None:
        """Work out what is told of it. On a thread of ActionKit's."""
        outcome = future.outcome(0)
        try:
            value = goal_value(self.tool, outcome, future.latest_feedback, self.why_cancelled)
        except Exception:  # noqa: BLE001  after any error the caller must hear something
            _log.exception("a result could not be told")
            text = f"the goal ended as {outcome.status}, and its result cannot be told"
            advice = "Look at the state of the robot before going on."
            error = ErrorValue("failed", text, False, advice)
            may_run = may_still_run(outcome)
            value = ActionValue(self.tool, "failed", error=error, may_still_run=may_run)
        self._goal_id, self._goals = outcome.goal_id, future._call.goals
        self._ended = time.monotonic()
        self.value = value
        self._future = None  # and with it the messages
        self._changes.tell()

    async def over(self, seconds: float | None = None) -> bool:
        """Wait until the call is over, for so long at most; return whether it is."""
        return await self._changes.until(lambda: self.value is not None, seconds)

    @property
    def counts(self) -> bool:
        """Whether it counts among the goals of its tool: in flight, or not known to have ended.

        A goal does not count if its server has left the graph: nothing may ever be heard of it. A
        server that is only silent may go on with its goal.
        """
        return self.value is None or self._goals.block_another(unless_gone=True, unless_unseen=True)

    def report(self) -> dict[str, Any]:
        """Return what is known of it, for the tool `goals`."""
        now, value, why = time.monotonic(), self.value, self.why_cancelled or None
        may_run = self._goals is not None and bool(self._goals.may_run)
        if value is None:
            sent = () if self._goals is None else self._goals.reports
            goal_id = str(sent[-1].goal_id) if sent else None
            status, state = "canceling" if why else "running", self.state
            elapsed = round(now - self._began, 3)
            told = GoalValue(goal_id, self.tool, status, state, may_run, elapsed, None, why)
            return asdict(told)
        # How it ended after its call was over, where that was seen.
        late = None if self._goal_id is None else self.last_states.get(self._goal_id)
        state = value.status.upper() if late is None else str(late)
        changed = late is not None and late.is_terminal and value.may_still_run
        told = GoalValue(
            goal_id=value.goal_id,
            tool=self.tool,
            status=state.lower() if changed else value.status,
            state=state,
            may_still_run=may_run,
            elapsed=value.elapsed,
            ended_ago=round(now - self._ended, 3),
            why_cancelled=why,
            result=value.result,
            error=None if changed else value.error,
        )
        return asdict(told)


class Goals:
    """All goals of a toolbox; an observer of its clients."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._records: list[ToolGoal] = []

    def add(self, record: ToolGoal, limit: int) -> bool:
        """Add a goal; return False, and do not add it, if its action has no room."""
        with self._lock:
            if len(self.counting(record.action)) >= limit:
                return False
            self._records.append(record)
            ended = [one for one in self._records if not one.counts]
            if len(ended) > _KEPT:
                self._records.remove(ended[0])
            return True

    def remove(self, record: ToolGoal) -> None:
        """Remove a goal that was not sent after all."""
        with self._lock:
            self._records.remove(record)

    def counting(self, action: str | None = None) -> list[ToolGoal]:
        """Return the goals that are in flight, or may be, the latest first."""
        return [one for one in self.latest() if one.counts and action in (None, one.action)]

    def of_others(self, there: Iterable[WatchedGoal]) -> list[WatchedGoal]:
        """Return the goals that this toolbox has not sent."""
        sent = set[str]().union(*(one.sent for one in self.latest()))
        return [goal for goal in there if goal.goal_id not in sent]

    def latest(self) -> list[ToolGoal]:
        """Return all that are kept, the latest first."""
        with self._lock:
            return self._records[::-1]

    def reports(self, goal_id: str | None = None) -> tuple[dict[str, Any], ...]:
        """Return what is known of all goals, or of one, the latest first."""
        return tuple(one.report() for one in self.latest() if goal_id is None or goal_id in one.ids)

    def on_event(self, event: GoalEvent, call: CallInfo) -> None:
        """Note how a goal ended; also one that was given up on."""
        if event.state.is_terminal or event.state is GoalState.LOST:
            for record in self.latest():
                if record.call_id == call.call_id:
                    record.last_states[event.goal_id] = event.state


def goals_result(
    goals: Goals, others: list[tuple[ActionConfig, WatchedGoal]], arguments: Mapping[str, Any]
) -> ToolResult:
    """Return what happened to the goals, or to the one asked for; goals of others come last."""
    goal_id = arguments.get("goal_id")
    unknown = [name for name in arguments if name != "goal_id"]
    problem = ""
    found: list[ListedGoal] = []
    if unknown:
        problem = f"there is no argument {shown(unknown[0])}; the only one is goal_id"
    elif goal_id is not None and not isinstance(goal_id, str):
        problem = f"goal_id {shown(goal_id)} must be a string"
    else:
        found += [ListedGoal(**one) for one in goals.reports(goal_id)]
        found += [_of_other(*one) for one in others if goal_id in (None, one[1].goal_id)]
        if goal_id is not None and not found:
            problem = f"no goal {shown(goal_id)} is known here; leave out goal_id to see all"
    if problem:
        error = ErrorValue("invalid_arguments", problem, False, "Change the arguments.")
        return tool_result(GoalsValue(status="refused", error=error))
    return tool_result(GoalsValue(goals=found))


def _of_other(tool: ActionConfig, goal: WatchedGoal) -> ListedGoal:
    """Return what is known of a goal that another program has sent."""
    status = "canceling" if goal.state == "CANCELING" else "running"
    told = (goal.goal_id, tool.name, status, goal.state)
    age = round(max(0.0, time.time() - goal.accepted), 3)
    return ListedGoal(*told, may_still_run=True, elapsed=age, sent_here=False)
