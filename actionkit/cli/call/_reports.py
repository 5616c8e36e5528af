"""Writes the course of `actionkit call`, in the words of `ros2 action send_goal`."""

from __future__ import annotations

import time
import uuid
from dataclasses import dataclass
from typing import Any

from actionkit._internal_api import name_those_left
from actionkit._messages.convert import to_plain
from actionkit._model.values import CancelReport, GoalEvent, GoalState, Outcome
from actionkit._observers.json_schema import event_line, outcome_line
from actionkit._observers.protocol import CallInfo
from actionkit.cli._shared.exits import Exit, ended_without_result
from actionkit.cli._shared.say import say
from actionkit.cli.call._plain import as_yaml

_CAUSES = {
    Exit.INTERRUPTED: "Ctrl-C",
    Exit.TERMINATED: "SIGTERM",
    Exit.HANGUP: "SIGHUP",
    Exit.OUTPUT_CLOSED: "closed output",
}
_BECAME = {
    CancelReport.CONFIRMED: "Goal canceled: CONFIRMED. The server says that it runs no more.",
    CancelReport.REFUSED: "Goal not canceled: REFUSED by the server. IT IS STILL RUNNING.",
    CancelReport.UNKNOWN: "Goal perhaps not canceled: UNKNOWN, as no answer came. IT MAY STILL BE"
    " RUNNING.",
    CancelReport.NOT_NEEDED: "Nothing to cancel: NOT_NEEDED. No goal was running.",
}
_IS_CANCELED = (
    "Goal not canceled in time: UNKNOWN. The server is cancelling it, and did not end it. IT MAY"
    " STILL BE RUNNING. --cancel-timeout allows more time."
)
_WITH_RESULT = (GoalState.SUCCEEDED, GoalState.ABORTED, GoalState.CANCELED)


@dataclass(frozen=True)
class Now:
    """How far a call is."""

    state: GoalState  # of the goal
    elapsed: float  # seconds since the call
    feedbacks: int  # how many feedback messages came
    share: float | None  # how much is done, 0 to 1, if it is known


class Report:
    """Writes the course of a call, from one thread. This base class writes nothing."""

    def begin(self) -> None: ...
    def event(self, event: GoalEvent) -> None: ...
    def feedback(self, message: Any, number: int, at: float) -> None: ...
    def not_shown(self, count: int) -> None: ...
    def now(self, now: Now) -> None: ...
    def interrupted(self, code: Exit) -> None: ...
    def detaching(self, code: Exit) -> None: ...
    def finished(self, outcome: Outcome[Any], code: Exit) -> None: ...
    def close(self) -> None: ...


def became(outcome: Outcome[Any]) -> str:
    """Say what happened to a goal that was interrupted, and which other goals may run."""
    text = _became(outcome)
    told = " STILL " in text and outcome.goal_id  # the text says that about its own goal
    return text + name_those_left(goal for goal in outcome.goals if goal.goal_id != told)


def _became(outcome: Outcome[Any]) -> str:
    if outcome.status in (GoalState.SUCCEEDED, GoalState.ABORTED):
        return f"Too late to cancel: the goal had ended as {outcome.status}."
    if (ended_as := ended_without_result(outcome)) is not None:
        return f"Too late to cancel: the goal had ended as {ended_as}. Its result did not come."
    report = outcome.cancel or getattr(outcome.error, "cancel", None)
    if report is None:
        report = (
            CancelReport.CONFIRMED
            if outcome.status is GoalState.CANCELED
            else CancelReport.NOT_NEEDED
        )
    canceling = (outcome.goal_id, GoalState.CANCELING)
    if report is CancelReport.UNKNOWN and canceling in [
        (e.goal_id, e.state) for e in outcome.timeline
    ]:
        return _IS_CANCELED
    return _BECAME[report]


class TextReport(Report):
    """Lines for people: the text of `ros2` on standard output, the rest on standard error."""

    def __init__(self, goal: Any) -> None:
        """Take the goal message."""
        self._goal = goal
        self._told = 0.0
        self._share: float | None = None
        self._known: set[uuid.UUID] = set()
        self._detaching = False

    def out(self, text: str) -> None:
        """Write a line to standard output, at once."""
        say(text)

    def begin(self) -> None:
        self.out("Waiting for an action server to become available...")

    def event(self, event: GoalEvent) -> None:
        if event.cancel_refused:
            self.out(f"{event.detail[:1].upper()}{event.detail[1:]}.")
        elif event.state is GoalState.SENT:
            again = f" (attempt {event.attempt})" if event.attempt > 1 else ""
            self.out(f"Sending goal{again}:\n{as_yaml(self._goal)}")
        elif event.state in (GoalState.ACCEPTED, GoalState.EXECUTING):
            self._accepted(event)
        elif event.state is GoalState.REJECTED:
            self.out("Goal was rejected.")
        elif event.state is GoalState.RETRYING:
            self.out(f"Trying again: {event.detail}")

    def _accepted(self, event: GoalEvent) -> None:
        if event.goal_id not in self._known:
            self._known.add(event.goal_id)
            self.out(f"Goal accepted with ID: {event.goal_id}\n")

    def feedback(self, message: Any, number: int, at: float) -> None:
        self.out(f"Feedback:\n{as_yaml(message)}")

    def not_shown(self, count: int) -> None:
        say(not_shown(count), err=True)

    def now(self, now: Now) -> None:
        grown = now.share is not None and now.share - (self._share or 0.0) >= 0.1
        if (
            now.feedbacks == 0
            or now.state.is_terminal
            or (now.elapsed - self._told < 1.0 and not grown)
        ):
            return
        self._told, self._share = now.elapsed, now.share
        say(f"Progress: {described(now)}", err=True)

    def interrupted(self, code: Exit) -> None:
        self._detaching = False
        self.out(f"Canceling goal... ({_CAUSES[code]}; once more leaves at once)")

    def detaching(self, code: Exit) -> None:
        self._detaching = True
        again = "; once more cancels it" if code is Exit.INTERRUPTED else ""
        self.out(f"Detaching; the goal goes on ({_CAUSES[code]}{again})")

    def finished(self, outcome: Outcome[Any], code: Exit) -> None:
        if outcome.result is not None and outcome.status in _WITH_RESULT:
            self.out(f"Result:\n{as_yaml(outcome.result)}")
        if outcome.status.is_terminal and outcome.status is not GoalState.REJECTED:
            self.out(f"Goal finished with status: {outcome.status}")
        if code in _CAUSES and self._detaching:
            if not outcome.status.is_terminal:
                self.out(f"Detached from goal {outcome.goal_id}, which runs on.")
        elif code in _CAUSES:
            self.out(became(outcome))
        elif outcome.error is not None:
            say(f"Error: {outcome.error}", err=True)
        elif left := name_those_left(outcome.goals):
            say(f"Warning:{left}", err=True)


class JsonReport(Report):
    """One JSON object on each line of standard output, as the observer `JsonLines` writes them."""

    def __init__(self, goal: Any, action_name: str, action_type: str) -> None:
        """Take the goal message, the action's full name, and the name of its type.

        Of a goal that another program has sent, the message is not known: `None`.
        """
        self._goal = goal
        self._action = (action_name, action_type)
        self._call: CallInfo | None = None
        self._last: GoalEvent | None = None
        self._first: dict[uuid.UUID, int] = {}
        """The number of a goal's first feedback message in the call."""
        self._not_shown = 0

    def event(self, event: GoalEvent) -> None:
        if event.state is GoalState.FEEDBACK:
            return
        first = self._call is None
        call = self._info(event.goal_id, event.monotonic, event.wall)
        told = first and self._goal is not None
        say(event_line(event, call, goal=to_plain(self._goal) if told else None))
        self._last = event

    def feedback(self, message: Any, number: int, at: float) -> None:
        last = self._last
        assert last is not None  # feedback comes only after the acceptance
        wall = last.wall + at - last.monotonic
        detail = f"no. {number - self._first.setdefault(last.goal_id, number) + 1}"
        event = GoalEvent(last.goal_id, last.attempt, GoalState.FEEDBACK, at, wall, detail)
        say(event_line(event, self._info(last.goal_id, at, wall), feedback=to_plain(message)))

    def not_shown(self, count: int) -> None:
        self._not_shown = count

    def finished(self, outcome: Outcome[Any], code: Exit) -> None:
        call = self._info(outcome.goal_id, time.monotonic(), time.time())
        result = None if outcome.result is None else to_plain(outcome.result)
        more = {"feedback_not_shown": self._not_shown, "exit_code": int(code), "exit": code.name}
        say(outcome_line(outcome, call, result, **more))

    def _info(self, goal_id: uuid.UUID, monotonic: float, wall: float) -> CallInfo:
        """Return the call, which began with this goal unless it is known already."""
        if self._call is None:
            self._call = CallInfo(goal_id, *self._action, "", monotonic, wall)
        return self._call


def not_shown(count: int) -> str:
    """Return a sentence about feedback that was not shown."""
    return f"({count} feedback messages came too fast to be shown)"


def described(now: Now) -> str:
    """Return the progress of a call in a few words."""
    share = "" if now.share is None else f"{now.share:4.0%}, "
    some = "feedback message" if now.feedbacks == 1 else "feedback messages"
    return f"{share}{now.feedbacks} {some}, {now.elapsed:.1f} s, {now.state}"
