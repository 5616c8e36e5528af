"""Draws goals as a picture in one SVG file, without scripts or other files.

The colours are those of Okabe and Ito: colour-blind people can distinguish them. Marks also have
different shapes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from xml.sax.saxutils import escape

from actionkit._model.values import date_text
from actionkit._observers.json_schema import LoggedLine
from actionkit._recordings.pictures.layout import Activity, Bar, Lane, Picture, Row, Sign, lay_out
from actionkit._recordings.pictures.names import shortened
from actionkit._recordings.pictures.scale import axis_for

WIDTH = 1200
"""Pixels, like all sizes below: the width fits on the screen of a laptop."""
_TOP = 118
"""Above the lanes: the title, the summary, the legend in two lines, and the labels of the axis."""
_LEFT, _RIGHT = 190, 230
"""Beside the lanes: the names of call and attempt; the outcome."""
_FITS, _MOST = 12, 40
"""Letters of a name: `_LEFT` has room for the first number, and grows up to the second."""
_LETTER = 7.5
"""The width of a letter; few letters in names are wider."""
_LEFT_SMALL, _RIGHT_SMALL = 90, 30
"""The same if lanes are too low for texts."""
_TALLEST, _LOWEST = 26.0, 3.0
_HEIGHT = 1400
"""The height of all lanes together; a lane is as high as fits, between two limits."""
_LABELLED = 12.0
"""Lanes that are at least as high as the letters have a text each."""

_FILL = {
    Activity.SERVER: "#c8c8c8",
    Activity.ACCEPT: "#f0e442",
    Activity.ACCEPTED: "#56b4e9",
    Activity.EXECUTING: "#0072b2",
    Activity.CANCELING: "#e69f00",
    Activity.PAUSE: "#777777",
}
_SIGN_FILL = {
    Sign.SUCCEEDED: "#009e73",
    Sign.ABORTED: "#d55e00",
    Sign.CANCELED: "#e69f00",
    Sign.REJECTED: "#cc79a7",
    Sign.LOST: "#000000",
    Sign.TIMED_OUT: "#f0e442",
    Sign.REPLACED: "#56b4e9",
    Sign.FAILED: "#ffffff",
    Sign.UNENDED: "#ffffff",
}
_SHAPES = {
    Sign.SUCCEEDED: None,  # a circle
    Sign.FAILED: None,
    Sign.ABORTED: [(-1, -0.45), (-0.45, -1), (0, -0.5), (0.45, -1), (1, -0.45), (0.5, 0),
                   (1, 0.45), (0.45, 1), (0, 0.5), (-0.45, 1), (-1, 0.45), (-0.5, 0)],
    Sign.CANCELED: [(-0.85, -0.85), (0.85, -0.85), (0.85, 0.85), (-0.85, 0.85)],
    Sign.REJECTED: [(0, -1.2), (1.2, 0), (0, 1.2), (-1.2, 0)],
    Sign.LOST: [(-1.1, -0.85), (1.1, -0.85), (0, 1.1)],
    Sign.TIMED_OUT: [(-0.9, -1.1), (0.9, -1.1), (-0.9, 1.1), (0.9, 1.1)],
    Sign.REPLACED: [(-1.1, 0.85), (1.1, 0.85), (0, -1.1)],
    Sign.UNENDED: [(-0.7, -1.1), (0.9, 0), (-0.7, 1.1)],
}  # fmt: skip
"""The corners of a mark, in units of its radius."""

_STYLE = """
text { font: 12px "DejaVu Sans", Verdana, Helvetica, Arial, sans-serif; fill: #222222 }
.title { font-size: 16px; font-weight: bold }
.dim { fill: #666666 }
.end { text-anchor: end }
.middle { text-anchor: middle }
.grid { stroke: #dddddd; stroke-width: 1 }
.stripe { fill: #f4f4f4 }
.together { fill: #fbeec2 }
.border { stroke: #999999; stroke-width: 1 }
.mark { stroke: #222222 }
.feedback { stroke: #ffffff; stroke-width: 0.8; fill: none }
.pause { stroke: #777777; stroke-width: 1.2; stroke-dasharray: 3 2; fill: none }
"""


def draw(calls: Sequence[Sequence[LoggedLine]], *, name: str = "") -> str:
    """Return an SVG document that shows calls, given as in `LogFile.calls`; `name` is its title."""
    return _Drawing(lay_out(calls)).document(name)


class _Drawing:
    def __init__(self, picture: Picture) -> None:
        self._picture = picture
        lanes = max(1, sum(max(1, len(row.lanes)) for row in picture.rows))
        self._lane = min(_TALLEST, max(_LOWEST, _HEIGHT / lanes))
        self._labelled = self._lane >= _LABELLED
        names = shortened((row.action_name for row in picture.rows), _MOST)
        self._names = names if len(names) > 1 else {}
        more = max([0, *(len(name) - _FITS for name in self._names.values())])
        self._left = _LEFT + round(more * _LETTER) if self._labelled else _LEFT_SMALL
        self._right = _RIGHT if self._labelled else _RIGHT_SMALL
        self._plot = WIDTH - self._left - self._right
        self._span = picture.end * 1.01 or 0.001
        self._bottom = _TOP + lanes * self._lane
        self._radius = max(2.0, min(5.5, self._lane * 0.3))
        self._parts: list[str] = []

    def document(self, name: str) -> str:
        height = round(self._bottom + 52)
        self._put(
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{height}"'
            f' viewBox="0 0 {WIDTH} {height}" role="img">',
            f"<title>{_text(name or 'goals')}</title>",
            f"<style>{_STYLE}</style>",
            f'<rect width="{WIDTH}" height="{height}" fill="#ffffff"/>',
        )
        self._head(name)
        self._legend()
        self._stripes()
        self._groups()
        self._axis()
        top = _TOP + 0.0
        for number, row in enumerate(self._picture.rows, 1):
            top = self._row(row, number, top)
        self._put("</svg>")
        return "\n".join(self._parts) + "\n"

    def _put(self, *parts: str) -> None:
        self._parts.extend(parts)

    def _x(self, seconds: float) -> float:
        return self._left + seconds / self._span * self._plot

    # --- around the plot -------------------------------------------------------------------

    def _head(self, name: str) -> None:
        rows = self._picture.rows
        names = sorted({row.action_name for row in rows})
        title = f"{', '.join(names[:3])}{' and others' if len(names) > 3 else ''}"
        attempts = sum(len(row.lanes) for row in rows)
        ends = Counter(row.outcome or "no end" for row in rows).most_common()
        told = ", ".join(f"{count} {word}" for word, count in ends)
        summary = f"{_count(len(rows), 'call')}, {_count(attempts, 'attempt')}: {told}"
        self._put(
            f'<text class="title" x="16" y="26">{_text(_short(title, 90))}</text>',
            f'<text x="16" y="46">{_text(_short(summary, 150))}</text>',
            f'<text class="dim end" x="{WIDTH - 16}" y="26">{_text(_short(name, 50))}</text>',
        )

    def _legend(self) -> None:
        lanes = [lane for row in self._picture.rows for lane in row.lanes]
        phases = {bar.phase for lane in lanes for bar in lane.bars}
        signs = {sign for lane in lanes for sign, _ in lane.marks}
        self._put('<g class="legend">')
        x = 16.0
        for phase in (phase for phase in Activity if phase in phases):
            if phase is Activity.PAUSE:
                self._put(f'<path class="pause" d="M{x:.1f} 66h22"/>')
            else:
                fill = _FILL[phase]
                self._put(f'<rect x="{x:.1f}" y="60" width="22" height="12" fill="{fill}"/>')
            x = self._legend_text(x + 28, 70, phase.value)
        if any(lane.feedback for lane in lanes):
            self._put(
                f'<rect x="{x:.1f}" y="60" width="22" height="12" '
                f'fill="{_FILL[Activity.EXECUTING]}"/>'
                f'<path class="feedback" d="M{x + 5:.1f} 60v12m6 -12v12m6 -12v12"/>'
            )
            self._legend_text(x + 28, 70, "feedback")
        x = 16.0
        for sign in (sign for sign in Sign if sign in signs):
            self._put(_mark(sign, x + 6, 86, 5.5))
            x = self._legend_text(x + 18, 90, sign.value)
        if any(group.together for group in self._picture.groups):
            self._put(f'<rect class="together" x="{x:.1f}" y="80" width="22" height="12"/>')
            self._legend_text(x + 28, 90, "goals of one action together")
        self._put("</g>")

    def _legend_text(self, x: float, y: float, words: str) -> float:
        self._put(f'<text x="{x:.1f}" y="{y}">{_text(words)}</text>')
        return x + 6.4 * len(words) + 26

    def _axis(self) -> None:
        unit, ticks = axis_for(self._span)
        for seconds, label in ticks:
            x = f"{self._x(seconds):.1f}"
            self._put(
                f'<path class="grid" d="M{x} {_TOP}V{self._bottom:.1f}"/>',
                f'<text class="dim middle" x="{x}" y="{_TOP - 6}">{label}</text>',
                f'<text class="dim middle" x="{x}" y="{self._bottom + 16:.1f}">{label}</text>',
            )
        since = f"{unit} since {date_text(self._picture.wall)}"
        self._put(
            f'<text class="dim end" x="{self._left - 14}" y="{_TOP - 6}">{unit}</text>',
            f'<text class="axis middle" x="{self._left + self._plot / 2:.1f}"'
            f' y="{self._bottom + 38:.1f}">{_text(since)}</text>',
        )

    def _stripes(self) -> None:
        """Shade every other call, or every other group of calls if groups have one number."""
        top = _TOP + 0.0
        for number, row in enumerate(self._picture.rows):
            height = self._lane * max(1, len(row.lanes))
            if number // self._numbered % 2 == 0:
                self._put(
                    f'<rect class="stripe" x="0" y="{top:.1f}" width="{WIDTH}"'
                    f' height="{height:.1f}"/>'
                )
            top += height

    def _groups(self) -> None:
        """Shade the times at which goals of one action ran together; part actions by lines."""
        top = _TOP + 0.0
        for group in self._picture.groups:
            height = self._lane * group.lanes
            for start, end in group.together:
                x = self._x(start)
                self._put(
                    f'<rect class="together" x="{x:.2f}" y="{top:.1f}"'
                    f' width="{max(self._x(end) - x, 0.4):.2f}" height="{height:.1f}"/>'
                )
            if top > _TOP:
                self._put(f'<path class="border" d="M0 {top:.1f}H{WIDTH}"/>')
            top += height

    @property
    def _numbered(self) -> int:
        """Return n if every n-th call has a number beside it."""
        if self._labelled:
            return 1
        steps = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
        return next((step for step in steps if step * self._lane >= 15), steps[-1])

    # --- in the plot -----------------------------------------------------------------------

    def _row(self, row: Row, number: int, top: float) -> float:
        self._put(f'<g class="call {_text(row.outcome or "unended")}">')
        for place, lane in enumerate(row.lanes):
            following = row.lanes[place + 1] if place + 1 < len(row.lanes) else None
            self._lane_of(lane, top + place * self._lane, following)
        if self._labelled:
            self._labels(row, number, top)
        elif number % self._numbered == 0:
            y = top + min(self._lane, 10) / 2 + 4
            self._put(
                f'<text class="dim end" x="{self._left - 14}" y="{y:.1f}">call {number}</text>'
            )
        self._put("</g>")
        return top + self._lane * max(1, len(row.lanes))

    def _labels(self, row: Row, number: int, top: float) -> None:
        name = self._names.get(row.action_name, f"call {number}")
        middle = self._lane / 2 + 4
        self._put(f'<text x="16" y="{top + middle:.1f}">{_text(name)}</text>')
        for place, lane in enumerate(row.lanes):
            label = f"attempt {lane.attempt}" if len(row.lanes) > 1 else lane.goal_id[:8]
            y = top + place * self._lane + middle
            self._put(f'<text class="dim end" x="{self._left - 14}" y="{y:.1f}">{label}</text>')
        y = top + max(0, len(row.lanes) - 1) * self._lane + middle
        self._put(f'<text x="{WIDTH - self._right + 14}" y="{y:.1f}">{_text(_ending(row))}</text>')

    def _lane_of(self, lane: Lane, top: float, following: Lane | None) -> None:
        inset = min(4.0, self._lane * 0.14)
        height = self._lane - 2 * inset
        self._put(
            f'<g class="attempt"><title>{_text(lane.text)}</title>',
            *(self._bar(bar, top + inset, height) for bar in lane.bars),
        )
        if following is not None and following.bars:
            x, y = self._x(following.bars[0].start), top + self._lane / 2
            self._put(f'<path class="pause" d="M{x:.1f} {y:.1f}v{self._lane:.1f}"/>')
        if ticks := self._ticks(lane):
            d = "".join(f"M{x:.1f} {top + inset:.1f}v{height:.1f}" for x in ticks)
            self._put(f'<path class="feedback" d="{d}"/>')
        middle, outline = top + self._lane / 2, 0.8 if self._labelled else 0.3
        for (sign, _), x in zip(lane.marks, self._places(lane), strict=True):
            self._put(_mark(sign, x, middle, self._radius, outline))
        self._put("</g>")

    def _places(self, lane: Lane) -> list[float]:
        """Return the places of marks in pixels; a mark that another would cover moves left."""
        places: list[float] = []
        for _, at in reversed(lane.marks):
            x = self._x(at)
            places.append(min(x, places[-1] - 2.3 * self._radius) if places else x)
        return places[::-1]

    def _bar(self, bar: Bar, top: float, height: float) -> str:
        x, end = self._x(bar.start), self._x(bar.end)
        if bar.phase is Activity.PAUSE:
            return f'<path class="pause" d="M{x:.1f} {top + height / 2:.1f}H{end:.1f}"/>'
        return (
            f'<rect class="{bar.phase.name.lower()}" x="{x:.2f}" y="{top:.2f}"'
            f' width="{max(end - x, 0.4):.2f}" height="{height:.2f}" fill="{_FILL[bar.phase]}"/>'
        )

    def _ticks(self, lane: Lane) -> list[float]:
        """Return the places of feedback in pixels, with visible gaps."""
        gap = 3 if self._labelled else 8
        kept: list[float] = []
        for at in lane.feedback:
            x = self._x(at)
            if not kept or x - kept[-1] >= gap:
                kept.append(x)
        return kept


def _mark(sign: Sign, x: float, y: float, radius: float, outline: float = 0.8) -> str:
    style = f'class="mark {sign.name.lower()}" fill="{_SIGN_FILL[sign]}" stroke-width="{outline}"'
    shape = _SHAPES[sign]
    if shape is None:
        return f'<circle {style} cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}"/>'
    points = " ".join(f"{x + dx * radius:.1f},{y + dy * radius:.1f}" for dx, dy in shape)
    return f'<polygon {style} points="{points}"/>'


def _ending(row: Row) -> str:
    if row.end is None:
        return "no end in this log"
    seconds = row.end - row.start
    took = f"{seconds * 1000:.0f} ms" if seconds < 1 else f"{seconds:.4g} s"
    return f"{_short(row.outcome, 21)}, {took}"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _short(text: str, most: int) -> str:
    return text if len(text) <= most else text[: most - 1] + "…"


def _text(text: str) -> str:
    """Return the text for XML, without control characters."""
    shown = "".join(c if c.isprintable() or c == "\n" else "\ufffd" for c in text)
    return escape(shown, {'"': "&quot;"})  # also for attributes
