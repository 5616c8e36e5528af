"""The figures as an SVG plot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib

matplotlib.use("svg")

from matplotlib import pyplot

from benchmarks.measure import Report, Verdict


def write(reports: Sequence[Report], path: Path) -> None:
    """Draw the series of the reports that have some, and all ratios with a target."""
    drawn = [report for report in reports if report.series]
    matplotlib.rcParams["svg.hashsalt"] = "actionkit"  # the same ids for the same figures
    figure, axes = pyplot.subplots(
        1, len(drawn) + 1, figsize=(5 * (len(drawn) + 1), 4.5), squeeze=False, layout="constrained"
    )
    _verdicts(axes[0][0], reports)
    for axis, report in zip(axes[0][1:], drawn, strict=True):
        for name, points in report.series.items():
            axis.plot(*zip(*points, strict=True), marker="o", label=name)
        axis.set_xscale("symlog", linthresh=1)
        axis.set_ylim(bottom=0)
        axis.set_xlabel(report.axes[0])
        axis.set_ylabel(report.axes[1])
        axis.set_title(f"{report.number}. {report.title}", fontsize=10)
        axis.legend(fontsize=8)
    figure.savefig(path, metadata={"Date": None})
    pyplot.close(figure)


def _share(verdict: Verdict) -> float:
    if verdict.limit == 0:
        return 0.0 if verdict.met else 2.0  # nothing at all is allowed
    return max(0.0, verdict.measured or 0.0) / verdict.limit


def _verdicts(axis: pyplot.Axes, reports: Sequence[Report]) -> None:
    """Each target as a share of its limit: left of the line is met."""
    verdicts = [(report.number, verdict) for report in reports for verdict in report.verdicts]
    shares = [_share(verdict) for _, verdict in verdicts]
    colours = ["tab:green" if verdict.met else "tab:red" for _, verdict in verdicts]
    axis.barh(range(len(verdicts)), shares, color=colours)
    axis.axvline(1.0, color="black", linewidth=1)
    labels = [f"{number}: {verdict.target}" for number, verdict in verdicts]
    axis.set_yticks(range(len(verdicts)), labels, fontsize=5)
    axis.invert_yaxis()
    axis.set_xlabel("share of the limit")
    axis.set_title("targets", fontsize=10)
