"""The table, the JSON file and the page of the documentation."""

from __future__ import annotations

import json
import os
import platform
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import datetime, timezone
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from benchmarks.measure import Figure, Plot, Report, Verdict

_LARGE = 1000.0
_AIMS = {
    1: "A call costs less than a hand-written client's",
    2: "Calls do not get slower with the history of the server",
    3: "1,000 goals at a time cost no more each than ten",
    4: "Others' feedback makes no call slower",
    5: "Who waits uses no CPU, and is there at once",
    6: "Call after call, nothing is left behind",
    7: "A behaviour tree ticks on",
    8: "A fresh process has its first result soon",
    9: "It goes as far as a raw client",
    10: "A watch of a whole robot costs next to nothing, and misses nothing",
}
_COLUMNS = ("what", "who", "median", "ratio", "spread", "to")


def show(report: Report) -> None:
    """Print a benchmark's table."""
    console = Console(width=None if sys.stdout.isatty() else 160)
    table = Table(title=f"{report.number}. {report.title}", title_justify="left")
    for name in _COLUMNS:
        table.add_column(name, justify="right" if name in ("median", "ratio", "spread") else "left")
    for figure in report.figures:
        table.add_row(*_cells(figure))
    console.print(table)
    for verdict in report.verdicts:
        style = "green" if verdict.met else "red"
        console.print("  " + " · ".join(_verdict(verdict)), style=style)
    for note in report.notes:
        console.print("  " + note, style="yellow")


def _cells(figure: Figure) -> tuple[str, ...]:
    unit = f" {figure.unit}" if figure.unit else ""
    ratio = "" if figure.ratio is None else f"{figure.ratio:.2f}"
    spread = "" if figure.low is None else f"{figure.low:.2f} to {figure.high:.2f}"
    value = f"{figure.value:,.0f}" if figure.value >= _LARGE else f"{figure.value:.3g}"
    return figure.what, figure.who, f"{value}{unit}", ratio, spread, figure.baseline


def _verdict(verdict: Verdict) -> tuple[str, str, str, str]:
    unit = f" {verdict.unit}" if verdict.unit else ""
    return (
        verdict.target,
        "nothing" if verdict.measured is None else f"{verdict.measured:.3g}{unit}",
        f"<= {verdict.limit:g}{unit}",
        "met" if verdict.met else "missed",
    )


def about(command: str) -> str:
    """Return a sentence on when, how and on what something was measured."""
    on = machine()
    return (
        f"`{command}` on {on['when']}: {on['cores']} cores, load {on['load']} at the end,"
        f" Linux {on['kernel']}, Python {on['python']}, rclpy {on['rclpy']}."
    )


def machine() -> dict[str, Any]:
    """Return what the figures were measured on."""
    return {
        "when": datetime.now(timezone.utc).strftime("%Y-%m-%d"),
        "cores": os.cpu_count(),
        "load": round(os.getloadavg()[1], 1),
        "kernel": platform.release(),
        "python": platform.python_version(),
        "rclpy": version("ros-jazzy-rclpy"),
        "actionkit": version("actionkit"),
    }


def write_json(reports: Mapping[int, Report], path: Path) -> None:
    """Write all figures, and the verdicts."""
    content = {
        "benchmarks": [
            {
                **asdict(report),
                "verdicts": [
                    {**asdict(verdict), "met": verdict.met} for verdict in report.verdicts
                ],
            }
            for _, report in sorted(reports.items())
        ],
    }
    path.write_text(json.dumps(content, indent=1) + "\n")


def read_json(path: Path) -> dict[int, Report]:
    """Return what `write_json` wrote, by number; nothing where there is no such file."""
    if not path.exists():
        return {}
    found = {}
    for one in json.loads(path.read_text())["benchmarks"]:
        for plot in one["plots"]:
            plot["series"] = {
                who: [(x, y) for x, y in points] for who, points in plot["series"].items()
            }
        one["plots"] = [Plot(**plot) for plot in one["plots"]]
        one["figures"] = [Figure(**line) for line in one["figures"]]
        for verdict in one["verdicts"]:
            del verdict["met"]
        one["verdicts"] = [Verdict(**verdict) for verdict in one["verdicts"]]
        found[one["number"]] = Report(**one)
    return found


def write_docs(reports: Mapping[int, Report], path: Path) -> None:
    """Replace the generated parts of a page: the targets, or all tables."""
    text = path.read_text("utf-8")
    ordered = [reports[number] for number in sorted(reports)]
    for name, lines in (
        ("targets", _targets(ordered)),
        ("benchmarks", [line for report in ordered for line in _tables(report)]),
    ):
        begin, end = f"<!-- begin: {name} -->", f"<!-- end: {name} -->"
        if begin in text:
            head, _, rest = text.partition(begin)
            _, _, tail = rest.partition(end)
            text = "\n".join([head + begin, "", *lines, end + tail])
    path.write_text(text, "utf-8")


def _targets(reports: Sequence[Report]) -> list[str]:
    """A line for each aim; `benchmarks/figures.md` has each target."""
    lines = ["| | the aim | targets met | the tightest |", "|---|---|---|---|"]
    for report in reports:
        if not report.verdicts:
            continue
        met = sum(verdict.met for verdict in report.verdicts)
        target, measured, limit, _ = _verdict(max(report.verdicts, key=lambda one: one.share))
        aim = _AIMS.get(report.number, report.title)
        lines.append(
            f"| {report.number} | {aim} | {met} of {len(report.verdicts)}"
            f" | {target}: {measured} ({limit}) |"
        )
    return [*lines, ""]


def _tables(report: Report) -> list[str]:
    """One benchmark's targets and figures."""
    lines = [f"### {report.number}. {report.title}", "", report.about, ""]
    if report.verdicts:
        lines += ["| target | measured | limit | |", "|---|---|---|---|"]
        for verdict in report.verdicts:
            *cells, met = _verdict(verdict)
            lines.append(f"| {' | '.join(cells)} | {met if verdict.met else f'**{met}**'} |")
        lines.append("")
    for note in report.notes:
        lines += [f"- {note}"]
    if report.notes:
        lines.append("")
    lines += ["| " + " | ".join(_COLUMNS) + " |", "|---|---|---|---|---|---|"]
    lines += ["| " + " | ".join(_cells(figure)) + " |" for figure in report.figures]
    return [*lines, ""]
