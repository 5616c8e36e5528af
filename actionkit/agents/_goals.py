"""The goals of a toolbox: which are in flight, and what happened to the others."""

from __future__ import annotations

import logging
import threading
import time
import uuid
from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

from actionkit import CallInfo, GoalEvent, GoalFuture, GoalState
from actionkit.agents._changes import Changes
from actionkit.agents._results import ActionValue, ErrorValue, GoalValue, goal_value, may_still_run
from actionkit.agents._ros import GoalThere

_KEPT = 100
"""Goals that ended, for the tool `goals`."""
_log = logging.getLogger("actionkit")
Future = GoalFuture[Any, Any]


class GoalRecord:
    """One goal, from before it is sent until long after it ended.

    Attributes:
        tool: The tool's name.
        action: The full name of the action.
        call_id: The id of the first goal of its call.
        value: What the tool returns, once the call is over.
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
        """What is known of the goals that were sent; stays true to life when the call is over."""
        self._last_states: dict[uuid.UUID, GoalState] = {}
        """Of each attempt: how it ended, as soon as that was seen; that may be after the call."""

    def follow(self, future: Future) -> None:
        """Follow a goal that was sent; cancel it where that was asked for meanwhile."""
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
        if self._future is not None:
            self._future.cancel()

    @property
    def ids(self) -> tuple[str, ...]:
        """The ids of its goals that may have been told of: of the first, and of the latest."""
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

    def note(self, event: GoalEvent) -> None:
        """Note how one of its attempts ended."""
        if event.state.is_terminal or event.state is GoalState.LOST:
            self._last_states[event.goal_id] = event.state

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
    def _late_state(self) -> GoalState | None:
        """How the goal ended after its call was over, where that was seen."""
        return None if self._goal_id is None else self._last_states.get(self._goal_id)

    @property
    def counts(self) -> bool:
        """Whether it counts among the goals of its tool: in flight, or not known to have ended.

        A goal does not count if its server has left the graph: nothing may ever be heard of it. A
        server that is only silent may go on with its goal.
        """
        return self.value is None or self._goals is None or not self._goals.gone

    @property
    def _may_run(self) -> bool:
        """Whether a goal may run now; what was never sent cannot."""
        return self._goals is not None and bool(self._goals.may_run)

    def report(self) -> dict[str, Any]:
        """Return what is known of it, for the tool `goals`."""
        now, value, why = time.monotonic(), self.value, self.why_cancelled or None
        if value is None:
            sent = () if self._goals is None else self._goals.reports
            goal_id = str(sent[-1].goal_id) if sent else None
            status, state = "canceling" if why else "running", self.state
            elapsed = round(now - self._began, 3)
            told = GoalValue(goal_id, self.tool, status, state, self._may_run, elapsed, None, why)
            return asdict(told)
        late = self._late_state
        state = value.status.upper() if late is None else str(late)
        changed = late is not None and late.is_terminal and value.may_still_run
        told = GoalValue(
            goal_id=value.goal_id,
            tool=self.tool,
            status=state.lower() if changed else value.status,
            state=state,
            may_still_run=self._may_run,
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
        self._lock = threading.Lock()
        self._records: list[GoalRecord] = []

    def add(self, record: GoalRecord, limit: int) -> bool:
        """Count a goal in, unless there are as many of its action as there may be."""
        with self._lock:
            if sum(one.counts for one in self._records if one.action == record.action) >= limit:
                return False
            self._records.append(record)
            ended = [one for one in self._records if not one.counts]
            if len(ended) > _KEPT:
                self._records.remove(ended[0])
            return True

    def remove(self, record: GoalRecord) -> None:
        """Count a goal out that was not sent after all."""
        with self._lock:
            if record in self._records:
                self._records.remove(record)

    def counting(self, action: str | None = None) -> list[GoalRecord]:
        """Return the goals that are in flight, or may be, the latest first."""
        return [one for one in self.latest() if one.counts and action in (None, one.action)]

    def of_others(self, there: Iterable[GoalThere]) -> list[GoalThere]:
        """Return the goals that this toolbox has not sent."""
        sent = set[str]().union(*(one.sent for one in self.latest()))
        return [goal for goal in there if goal.goal_id not in sent]

    def latest(self) -> list[GoalRecord]:
        """Return all that are kept, the latest first."""
        with self._lock:
            return self._records[::-1]

    def on_event(self, event: GoalEvent, call: CallInfo) -> None:
        """Note how a goal ended; also one that was given up on."""
        if event.state.is_terminal or event.state is GoalState.LOST:
            for record in self.latest():
                if record.call_id == call.call_id:
                    record.note(event)
