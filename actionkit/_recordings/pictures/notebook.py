"""Shows the timeline of a call in a notebook: its text, and its picture."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from html import escape
from typing import Any

from actionkit._model.values import Outcome, Timeline
from actionkit._observers.json_schema import LoggedLine, event_line, outcome_line, parse_line
from actionkit._observers.protocol import CallInfo
from actionkit._recordings.pictures.svg import draw


def to_html(timeline: Timeline, outcome: Outcome[Any] | None = None) -> str:
    """Return a timeline as HTML; with the call's outcome, it says that and marks the end."""
    text = str(timeline)
    if outcome is not None:
        error = "" if outcome.error is None else f"{type(outcome.error).__name__}: {outcome.error}"
        text = "\n".join(filter(None, [repr(outcome), error, text]))
    return f"<pre>{escape(text)}</pre>{_picture(timeline, outcome)}"


def _picture(timeline: Timeline, outcome: Outcome[Any] | None) -> str:
    if not timeline:
        return ""
    first = timeline[0]
    info = CallInfo(first.goal_id, "", "", "", first.monotonic, first.wall)
    lines = [event_line(event, info) for event in timeline]
    if outcome is not None:
        lines.append(outcome_line(outcome, info, None))
    return as_image([[parse_line(line) for line in lines]], "one call")


def as_image(calls: Sequence[Sequence[LoggedLine]], name: str) -> str:
    """Return the picture of calls as HTML; `name` is its title."""
    svg = draw(calls, name=name)
    # As an image, so that its styles do not change the page.
    data = b64encode(svg.encode()).decode()
    return f'<img src="data:image/svg+xml;base64,{data}" alt="picture" style="max-width: 100%">'
