"""Computes a picture of goals as plain data: rows for calls, lanes for attempts, bars and marks.

Pure: the input is lines of a log, and the output has times in seconds. `svg` draws it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from itertools import zip_longest

from actionkit._model.values import GoalEvent, GoalState, Timeline
from actionkit._observers.json_reader import ending
from actionkit._observers.json_schema import LoggedLine


class Activity(Enum):
    """What a goal is doing between two events; the value is for the legend."""

    SERVER = "waiting for a server or its turn"
    ACCEPT = "waiting for acceptance"
    ACCEPTED = "accepted"
    EXECUTING = "executing"
    CANCELING = "given up or canceling"
    PAUSE = "pause before a retry"


class Sign(Enum):
    """A moment that is marked; the value is for the legend."""

    SUCCEEDED = "succeeded"
    ABORTED = "aborted"
    CANCELED = "canceled"
    REJECTED = "rejected"
    LOST = "server or result lost"
    TIMED_OUT = "time ran out"
    REPLACED = "replaced"
    FAILED = "ended otherwise"
    UNENDED = "no end in this log"


_PHASES = {
    GoalState.SENDING: Activity.SERVER,
    GoalState.SENT: Activity.ACCEPT,
    GoalState.ACCEPTED: Activity.ACCEPTED,
    GoalState.EXECUTING: Activity.EXECUTING,
    GoalState.CANCELING: Activity.CANCELING,
    GoalState.TIMED_OUT: Activity.CANCELING,
    GoalState.RETRYING: Activity.PAUSE,
}
_SIGNS = {
    GoalState.SUCCEEDED: Sign.SUCCEEDED,
    GoalState.ABORTED: Sign.ABORTED,
    GoalState.CANCELED: Sign.CANCELED,
    GoalState.REJECTED: Sign.REJECTED,
    GoalState.LOST: Sign.LOST,
    GoalState.TIMED_OUT: Sign.TIMED_OUT,
    GoalState.REPLACED: Sign.REPLACED,
}
_RUNNING = (Activity.ACCEPTED, Activity.EXECUTING, Activity.CANCELING)
_NEVER_SENT = {Activity.SERVER, Activity.PAUSE, None}


@dataclass(frozen=True)
class Bar:
    """A phase from one moment to another."""

    phase: Activity
    start: float
    end: float


@dataclass
class Lane:
    """One attempt."""

    attempt: int
    goal_id: str
    bars: list[Bar] = field(default_factory=list)  # its phases, in order
    marks: list[tuple[Sign, float]] = field(default_factory=list)  # its marked moments
    feedback: list[float] = field(default_factory=list)  # when feedback came
    text: str = ""  # its timeline
    open: bool = False  # whether it is in a phase at its end, and not over


@dataclass
class Row:
    """One call."""

    action_name: str
    start: float  # when it was made
    end: float | None  # `None` if the log does not say
    outcome: str  # the word of `ending`; `""` if the log has none
    lanes: list[Lane]  # its attempts, in order


@dataclass
class Group:
    """All calls of one action."""

    rows: list[Row]  # in the order in which the calls began
    together: list[tuple[float, float]]  # when several of its goals ran, from when to when

    @property
    def lanes(self) -> int:
        """Return how many lanes it takes."""
        return sum(max(1, len(row.lanes)) for row in self.rows)


@dataclass
class Picture:
    """All calls of a log."""

    wall: float  # seconds since the epoch at time 0 of all other times
    end: float  # the last moment
    groups: list[Group]  # in the order in which the first call of each action began

    @property
    def rows(self) -> list[Row]:
        """Return all calls in the order in which they are drawn."""
        return [row for group in self.groups for row in group.rows]


def lay_out(calls: Sequence[Sequence[LoggedLine]]) -> Picture:
    """Return the picture of calls, each with its lines, which must not be empty."""
    began = [_beginning(lines) for lines in calls]
    base = min((wall for wall, _ in began), default=0.0)
    shifts = [wall - base - monotonic for wall, monotonic in began]
    moments = (
        line.data["monotonic"] + shift
        for lines, shift in zip(calls, shifts, strict=True)
        for line in lines
    )
    end = max(0.0, max(moments, default=0.0))  # a clock that was set back may end before 0
    rows = [_row(lines, shift, end) for lines, shift in zip(calls, shifts, strict=True)]
    by_action: dict[str, list[Row]] = {}
    for row in sorted(rows, key=lambda row: row.start):
        by_action.setdefault(row.action_name, []).append(row)
    return Picture(base, end, [Group(own, _together(own)) for own in by_action.values()])


def _together(rows: Sequence[Row]) -> list[tuple[float, float]]:
    """Return when two or more goals of these calls ran at the same time."""
    changes = []
    for lane in (lane for row in rows for lane in row.lanes):
        ran = [bar for bar in lane.bars if bar.phase in _RUNNING]
        if ran:
            changes += [(ran[0].start, 1), (ran[-1].end, -1)]
    found, running, since = [], 0, 0.0
    for at, change in sorted(changes):  # at one moment, an end comes first
        if change > 0 and running == 1:
            since = at
        elif change < 0 and running == 2:
            found.append((since, at))
        running += change
    return found


def _beginning(lines: Sequence[LoggedLine]) -> tuple[float, float]:
    """Return the wall and monotonic times at which a call began, or its first known moment."""
    data = lines[0].data
    before = data["elapsed_ms"] / 1000 if lines[0].kind == "outcome" else 0.0
    return float(data["wall"]) - before, float(data["monotonic"]) - before


def _row(lines: Sequence[LoggedLine], shift: float, end_of_all: float) -> Row:
    events = [line.event for line in lines if line.event is not None]
    word, at = ending(lines) or ("", None)
    ended = None if at is None else at + shift
    numbers = sorted({event.attempt for event in events})
    starts = {n: next(e.monotonic for e in events if e.attempt == n) + shift for n in numbers}
    lanes = []
    for number, following in zip_longest(numbers, numbers[1:]):
        own = [event for event in events if event.attempt == number]
        last = following is None
        until = ended if last else starts[following or number]
        lane = _lane(own, shift, until if until is not None else end_of_all)
        if last and ended is None and lane.open:
            lane.marks.append((Sign.UNENDED, end_of_all))
        lanes.append(lane)
    if ended is not None and word != "ok" and not (lanes and lanes[-1].marks):
        lanes = lanes or [Lane(1, str(lines[0].data["goal_id"]))]
        lanes[-1].marks.append((Sign.FAILED, ended))
    return Row(lines[0].action_name, _beginning(lines)[1] + shift, ended, word, lanes)


def _lane(events: list[GoalEvent], shift: float, until: float) -> Lane:
    """Return the lane of one attempt; its last phase ends at `until`."""
    kept = _without_middle_feedback(events)
    lane = Lane(events[0].attempt, str(events[0].goal_id), text=str(Timeline(kept)))
    phase, since = None, 0.0
    state: GoalState | None = None
    for event in events:
        at = event.monotonic + shift
        if event.state is GoalState.FEEDBACK:
            lane.feedback.append(at)
            continue
        if phase is not None and at > since:
            lane.bars.append(Bar(phase, since, at))
        if event.state in _SIGNS and event.state is not state:  # another event may tell it again
            lane.marks.append((_SIGNS[event.state], at))
        never_sent = event.state is GoalState.TIMED_OUT and phase in _NEVER_SENT
        phase, since, state = None if never_sent else _PHASES.get(event.state), at, event.state
    lane.open = phase is not None
    if phase is not None and until > since:
        lane.bars.append(Bar(phase, since, until))
    return lane


def _without_middle_feedback(events: list[GoalEvent]) -> list[GoalEvent]:
    places = [n for n, event in enumerate(events) if event.state is GoalState.FEEDBACK]
    dropped = set(places[1:-1])
    return [event for n, event in enumerate(events) if n not in dropped]
