"""A timeline as text, for a bug report: one line for each transition."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timezone
from typing import TYPE_CHECKING

from actionkit._model.printable import on_one_line

if TYPE_CHECKING:
    import uuid

    from actionkit._model.values import GoalEvent

_STATE_WIDTH = len("SUCCEEDED")


def timeline_text(events: Sequence[GoalEvent]) -> str:
    """Return a line for each event: elapsed milliseconds, attempt, state, detail.

    The first line also says when that was, and the first one of each goal the goal's id, which
    is the one that the server's log has.
    """
    if not events:
        return "(no events)"
    began = events[0].monotonic
    elapsed = [f"{(event.monotonic - began) * 1000:.1f}" for event in events]
    width = max(map(len, elapsed))
    lines: list[str] = []
    goal_id = None
    for event, milliseconds in zip(events, elapsed, strict=True):
        said = _said(event, goal_id, first=not lines)
        line = f"{milliseconds:>{width}} ms  #{event.attempt}  {event.state!s:<{_STATE_WIDTH}}"
        lines.append(f"{line}  {said}".rstrip())
        goal_id = event.goal_id
    return "\n".join(lines)


def _said(event: GoalEvent, goal_before: uuid.UUID | None, *, first: bool) -> str:
    parts = [on_one_line(event.detail)] if event.detail else []
    if event.goal_id != goal_before:
        parts.append(f"goal {event.goal_id}")
    if first:
        parts.append(f"at {date_text(event.wall)}")
    return ", ".join(parts)


def date_text(wall: float) -> str:
    """Return seconds since the epoch as a date, in UTC and to the millisecond."""
    try:
        date = datetime.fromtimestamp(wall, timezone.utc)
    except (OverflowError, OSError, ValueError):  # no date of this world
        return f"{wall} s since 1970"
    return date.strftime("%Y-%m-%d %H:%M:%S.") + f"{date.microsecond // 1000:03} UTC"
