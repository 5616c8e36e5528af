"""The pictures: one for each thing that a reader asks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import matplotlib

matplotlib.use("svg")

from matplotlib import pyplot
from matplotlib.axes import Axes

from benchmarks.measure import Plot, Report

_WIDTH = 7.5
"""Inches: a page's."""
_COLOURS = {
    "ActionKit blocking": "#0b6e4f",
    "ActionKit await": "#5fb49c",
    "ActionKit with ledger": "#5fb49c",
    "least in Python": "#bbbbbb",
    "ActionKit": "#0b6e4f",
    "command line": "#5fb49c",
    "rclcpp": "#bbbbbb",
}
_OTHER = "#d08c2e"
_TICKS = 6
_WORSE = 0.35
"""How faint the bars of second worst starts are."""
_OUT_OF_SCALE = 4.0
"""A bar that is so many times as long as the next is cut off, as it would hide the others."""
_CUT_AT = 1.4
"""Where, in lengths of the next."""
_MARKED = 20
"""Points of a curve that are marked; more would be one thick line."""
_LOGARITHMIC = 20.0
"""From this ratio of the largest to the smallest figure on."""


def write(reports: Mapping[int, Report], folder: Path) -> None:
    """Draw `cost-call.svg`, `cost-growth.svg` and `cost-start.svg`, as far as was measured."""
    # The same ids for the same figures, and text that can be searched.
    matplotlib.rcParams.update({"svg.hashsalt": "actionkit", "svg.fonttype": "none"})
    matplotlib.rcParams.update({"font.size": 9, "axes.titlesize": 10, "legend.frameon": False})
    if 1 in reports:
        _call(reports[1], folder / "cost-call.svg")
    plots = [plot for number in sorted(reports) for plot in reports[number].plots]
    if plots:
        _growth(plots, folder / "cost-growth.svg")
    if 8 in reports:
        _start(reports[8], folder / "cost-start.svg")


def _of(report: Report, what: str) -> dict[str, float]:
    return {figure.who: figure.value for figure in report.figures if figure.what == what}


def _bars(
    axis: Axes,
    values: Mapping[str, float],
    title: str,
    *,
    labels: Sequence[str] = (),
    alpha: float = 1.0,
) -> None:
    """Draw a bar for each, from top to bottom, with its label."""
    colours = [_COLOURS.get(who, _OTHER) for who in values]
    bars = axis.barh(list(values), list(values.values()), color=colours, alpha=alpha)
    if labels:
        axis.bar_label(bars, labels, padding=3, fontsize=8)
    axis.set_title(title, loc="left")
    axis.margins(x=0.15)
    axis.spines[["top", "right"]].set_visible(False)


def _call(report: Report, path: Path) -> None:
    figure, (left, right) = pyplot.subplots(
        1, 2, figsize=(_WIDTH, 3.2), sharey=True, layout="constrained"
    )
    for axis, what, title in (
        (left, "order 5: latency", "time of one call, ms"),
        (right, "order 5: client CPU", "CPU of the client, ms"),
    ):
        values = _of(report, what)
        longest = _longest_bar(values.values())
        shown = {who: min(value, longest) for who, value in values.items()}
        labels = [_label(value) + " (cut off)" * (value > longest) for value in values.values()]
        _bars(axis, shown, title, labels=labels)
    left.invert_yaxis()
    _save(figure, path)


def _longest_bar(values: Iterable[float]) -> float:
    """Return how long a bar may be."""
    *_, second, first = [0.0, *sorted(values)]
    return _CUT_AT * second if first > _OUT_OF_SCALE * second > 0 else first


def _label(value: float) -> str:
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"


def _start(report: Report, path: Path) -> None:
    figure, axis = pyplot.subplots(figsize=(_WIDTH, 2.6), layout="constrained")
    worst = _of(report, "second worst start")
    middle = _of(report, "start to first result")
    labels = [f"{middle[who]:,.0f}, {ms:,.0f}" for who, ms in worst.items()]
    _bars(axis, worst, "", labels=labels, alpha=_WORSE)
    _bars(axis, middle, "from starting Python to the first result, ms: median, second worst")
    axis.invert_yaxis()
    _save(figure, path)


def _growth(plots: list[Plot], path: Path) -> None:
    rows = (len(plots) + 1) // 2
    figure, axes = pyplot.subplots(
        rows, 2, figsize=(_WIDTH, 2.3 * rows), squeeze=False, layout="constrained"
    )
    lines = {}
    for axis, plot in zip(axes.flat, plots, strict=False):
        values = [y for points in plot.series.values() for _, y in points if y > 0]
        for who, points in plot.series.items():
            colour = _COLOURS.get(who, _OTHER)
            size = 4 if len(points) <= _MARKED else 0
            (lines[who],) = axis.plot(*zip(*points, strict=True), marker="o", ms=size, color=colour)
        sizes = [x for points in plot.series.values() for x, _ in points]
        axis.set_xscale("symlog", linthresh=min((x for x in sizes if x), default=1))
        ticks = sorted(set(sizes)) if len(set(sizes)) <= _TICKS else [min(sizes), max(sizes)]
        axis.set_xticks(ticks, [f"{tick:,.0f}" for tick in ticks])
        axis.minorticks_off()
        if values and max(values) > _LOGARITHMIC * min(values):
            axis.set_yscale("log")
        else:
            axis.set_ylim(bottom=0, top=1.15 * max(values, default=1))
        axis.set_title(plot.title, loc="left")
        axis.set_xlabel(plot.x)
        axis.set_ylabel(plot.y)
        axis.spines[["top", "right"]].set_visible(False)
    for axis in axes.flat[len(plots) :]:
        axis.set_axis_off()
    figure.legend(lines.values(), lines.keys(), loc="outside upper center", ncols=len(lines))
    _save(figure, path)


def _save(figure: pyplot.Figure, path: Path) -> None:
    figure.savefig(path, metadata={"Date": None})
    pyplot.close(figure)
