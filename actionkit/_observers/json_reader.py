"""Reads the files of `JsonLines` back, also rotated and damaged files."""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from actionkit._model.timeline import Recorder
from actionkit._model.values import GoalEvent, GoalState, Timeline
from actionkit._observers.json_schema import LoggedLine, NoteLine, parse_line


@dataclass(frozen=True)
class LogFile:
    """What `read_json_lines` found.

    Attributes:
        lines: Every line that could be read, the oldest first.
        problems: Every line that could not be read, as `file:line: why`. A killed process leaves
            one at most.
    """

    lines: tuple[LoggedLine, ...]
    problems: tuple[str, ...]

    def calls(self) -> dict[uuid.UUID, list[LoggedLine]]:
        """Return the lines of each call by its id, in the order in which the calls began."""
        calls: dict[uuid.UUID, list[LoggedLine]] = {}
        for line in self.lines:
            calls.setdefault(line.call_id, []).append(line)
        return calls

    def timelines(self) -> dict[uuid.UUID, Timeline]:
        """Return the timeline of each call by its id, the same as in the call's own future."""
        return {
            call_id: timeline_of(line.event for line in lines)
            for call_id, lines in self.calls().items()
        }


def ending(lines: Sequence[LoggedLine]) -> tuple[str, float] | None:
    """Return how a call ended, in a word, and when, on the clock of its events.

    Who watches a goal does not see the call: then it is the state in which the goal ended. `None`
    means that the lines have no end.
    """
    events = [line.event for line in lines if line.event is not None]
    for line in lines:
        if line.kind == "outcome":
            return str(line.data["outcome"]), float(line.data["monotonic"])
    states = [event for event in events if event.state is not GoalState.FEEDBACK]
    if not states or states[0].state is GoalState.SENDING or not states[-1].state.is_terminal:
        return None
    end = next(event for event in states if event.state is states[-1].state)
    return str(end.state), end.monotonic


def timeline_of(events: Iterable[GoalEvent | None]) -> Timeline:
    """Return the timeline of these events; `None` is left out."""
    recorder = Recorder()
    for event in events:
        if event is not None:
            recorder.add(event)
    return recorder.events()


def read_json_lines(path: str | os.PathLike[str]) -> LogFile:
    """Read a file that `JsonLines` wrote, and the files that it renamed before.

    Args:
        path: The `path` that you gave to `JsonLines`.

    Returns:
        All lines, and the problems. A last line that was cut off is a problem, too.

    Raises:
        OSError: There is no such file, or it cannot be read.
    """
    lines: list[LoggedLine] = []
    problems: list[str] = []
    for each in _files(Path(path)):
        for number, text in enumerate(each.read_bytes().split(b"\n"), 1):
            if not text.strip():
                continue
            try:
                lines.append(parse_line(text))
            except NoteLine:
                continue
            except ValueError as error:
                problems.append(f"{each.name}:{number}: {len(text)} bytes, {error}")
    return LogFile(tuple(lines), tuple(problems))


def _files(path: Path) -> list[Path]:
    """Return the files of a log, the oldest first."""
    numbered = {}
    for each in path.parent.glob("*"):
        stem, _, number = each.name.rpartition(".")
        if stem == path.name and number.isdecimal() and number.isascii():
            numbered[int(number)] = each
    # A process that is killed between two renamings leaves the backups without the file itself.
    current = [path] if path.exists() or not numbered else []
    return [numbered[number] for number in sorted(numbered, reverse=True)] + current
