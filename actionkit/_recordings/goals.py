"""Reads the goals in a log or a recording: `read_goals`, and what it returns."""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from actionkit._model.values import GoalState, Timeline
from actionkit._observers.json_reader import read_json_lines, timeline_of
from actionkit._observers.json_schema import LoggedLine

_INSTALL = "Recordings of ros2 bag need two packages more: pip install mcap rosbags"


@dataclass(frozen=True)
class RecordedGoal:
    """One goal in a log or a recording. Times are in seconds since the epoch.

    Attributes:
        goal_id: The goal's id.
        action_name: The full name of the action.
        action_type: The action's type, such as `test_msgs/action/Fibonacci`; `""` if that is not
            known.
        state: Its last known state.
        began: When it was sent or, if that is not known, when it was accepted or first seen.
        accepted: When a server accepted it; `None` if no acceptance is known.
        ended: When it ended; `None` if its end is not known.
        sent_by: Who sent it: in a log the client's node; in a recording `program` and the DDS id of
            the process or, with CycloneDDS, `client` and an id; `""` if that is not known.
        server: The number of its server if the recording has goals of several servers on this
            action, else 1. A server that was restarted while a goal ran counts as another one.
        goal: The goal's fields, if they are known.
        result: The result's fields, if they are known.
        timeline: Its events; print it to read them.
    """

    goal_id: uuid.UUID
    action_name: str
    action_type: str
    state: GoalState
    began: float
    accepted: float | None
    ended: float | None
    sent_by: str
    server: int
    goal: Mapping[str, Any] | None
    result: Mapping[str, Any] | None
    timeline: Timeline


class RecordedGoals(tuple[RecordedGoal, ...]):
    """The goals in a log or a recording, in the order in which they began.

    A notebook shows them as a picture.

    Attributes:
        problems: What could not be read, or was not recorded, one text for each.
    """

    problems: tuple[str, ...] = ()
    _calls: Sequence[Sequence[LoggedLine]] = ()
    _name = ""

    def _repr_html_(self) -> str:
        from actionkit._recordings.pictures.notebook import as_image

        return as_image(self._calls, self._name)


@dataclass(frozen=True)
class Recording:
    """The lines of all calls in a file, and what could not be read."""

    calls: list[list[LoggedLine]]
    problems: list[str]


def read(path: Path) -> Recording:
    """Read a log of `JsonLines`, or a recording of `ros2 bag`.

    Raises:
        OSError: There is no such file, or it cannot be read.
        ValueError: It is neither.
        ImportError: The extra `bags` is not installed.
    """
    from actionkit._recordings.bag_files import Bag, bag_files

    # A log that was just renamed may leave only the files that it was renamed to.
    # A pipe can be read only once.
    files, missing = bag_files(path) if path.is_file() or path.is_dir() else ([], [])
    if not files:
        log = read_json_lines(path)
        if log.problems and not log.lines:
            raise ValueError(
                f"{path} is no log of goals, and no recording of ros2 bag: of its"
                f" {len(log.problems)} lines none could be read. The first is {log.problems[0]}."
            )
        return Recording(list(log.calls().values()), [f"not read: {p}" for p in log.problems])
    try:
        import mcap  # noqa: F401
        import rosbags  # noqa: F401
    except ImportError as error:
        raise ImportError(f"{_INSTALL} ({error})") from error
    from actionkit._recordings.bag_goals import goals_in, is_of_action

    bag = Bag(files, is_of_action, problems=missing)
    return Recording(goals_in(bag), bag.problems)


def read_goals(path: str | os.PathLike[str]) -> RecordedGoals:
    """Read every goal in a log of `JsonLines`, or in a recording of `ros2 bag`.

        for goal in read_goals("rosbag2_2026_11_30-02_00_00"):
            print(goal.action_name, goal.state, goal.accepted)

    Recordings need `pip install mcap rosbags`, and no ROS. A call that tried again has a goal for
    each attempt.

    Args:
        path: A log, or what `actionkit watch --json` has written; or a recording: its folder, or an
            `.mcap` or `.db3` file.

    Returns:
        The goals. Of a damaged file, those that could be read; `problems` says what is missing.

    Raises:
        OSError: There is no such file, or it cannot be read.
        ValueError: It is neither a log nor a recording.
        ImportError: The packages for recordings are not installed.
    """
    found = read(Path(path))
    goals = RecordedGoals(goal for lines in found.calls for goal in _goals_of(lines))
    goals.problems = tuple(found.problems)
    goals._calls, goals._name = found.calls, Path(path).name
    return goals


def _goals_of(lines: Sequence[LoggedLine]) -> Iterator[RecordedGoal]:
    """Yield the goals of a call, one for each attempt."""
    pairs = [(line.event, line.data) for line in lines if line.event is not None]
    said = [line.data for line in lines]
    sent = next((data["goal"] for data in said if "goal" in data), None)
    attempts = sorted({event.attempt for event, _ in pairs})
    for attempt in attempts:
        events = [event for event, _ in pairs if event.attempt == attempt]
        own = [data for event, data in pairs if event.attempt == attempt]
        if attempt == attempts[-1]:  # the call's end has its result
            own += [line.data for line in lines if line.kind == "outcome"]
        states = [event for event in events if event.state is not GoalState.FEEDBACK]
        yield RecordedGoal(
            goal_id=events[0].goal_id,
            action_name=lines[0].action_name,
            action_type=lines[0].action_type,
            # A goal with feedback runs.
            state=states[-1].state if states else GoalState.EXECUTING,
            began=events[0].wall,
            accepted=next((e.wall for e in events if e.state is GoalState.ACCEPTED), None),
            # An end that is the first thing known was before.
            ended=next((e.wall for e in events[1:] if e.state.is_terminal), None),
            sent_by=next((d["sent_by"] for d in own if "sent_by" in d), lines[0].node_name),
            server=next((d["server"] for d in own if isinstance(d.get("server"), int)), 1) or 1,
            goal=sent,
            result=next((d["result"] for d in own if "result" in d), None),
            timeline=timeline_of(events),
        )
