"""The table, the JSON file and the page of the documentation."""

from __future__ import annotations

import json
import os
import platform
import sys
from collections.abc import Sequence
from dataclasses import asdict
from datetime import datetime, timezone
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from benchmarks.measure import Figure, Report, Verdict

_BEGIN, _END = "<!-- begin: benchmarks -->", "<!-- end: benchmarks -->"
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


def _cells(figure: Figure) -> tuple[str, ...]:
    unit = f" {figure.unit}" if figure.unit else ""
    ratio = "" if figure.ratio is None else f"{figure.ratio:.2f}"
    spread = "" if figure.low is None else f"{figure.low:.2f} to {figure.high:.2f}"
    return figure.what, figure.who, f"{figure.value:.3g}{unit}", ratio, spread, figure.baseline


def _verdict(verdict: Verdict) -> tuple[str, str, str, str]:
    return (
        verdict.target,
        "none" if verdict.measured is None else f"{verdict.measured:.3g} {verdict.unit}",
        f"<= {verdict.limit:g} {verdict.unit}",
        "met" if verdict.met else "missed",
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


def write_json(reports: Sequence[Report], path: Path, command: str) -> None:
    """Write all figures, and the verdicts."""
    content = {
        "command": command,
        "machine": machine(),
        "benchmarks": [
            {
                **asdict(report),
                "verdicts": [
                    {**asdict(verdict), "met": verdict.met} for verdict in report.verdicts
                ],
            }
            for report in reports
        ],
    }
    path.write_text(json.dumps(content, indent=1) + "\n")


def read_json(path: Path) -> dict[int, Report]:
    """Return what `write_json` wrote, by number; nothing where there is no such file."""
    if not path.exists():
        return {}
    found = {}
    for one in json.loads(path.read_text())["benchmarks"]:
        one["axes"] = tuple(one["axes"])
        one["figures"] = [Figure(**line) for line in one["figures"]]
        for verdict in one["verdicts"]:
            del verdict["met"]
        one["verdicts"] = [Verdict(**verdict) for verdict in one["verdicts"]]
        found[one["number"]] = Report(**one)
    return found


def write_docs(reports: Sequence[Report], path: Path, command: str) -> None:
    """Replace the generated part of the page."""
    text = path.read_text("utf-8")
    head, _, rest = text.partition(_BEGIN)
    _, _, tail = rest.partition(_END)
    path.write_text(f"{head}{_BEGIN}\n{_markdown(reports, command)}\n{_END}{tail}", "utf-8")


def _markdown(reports: Sequence[Report], command: str) -> str:
    about = machine()
    lines = [
        f"Made by `{command}` on {about['when']}: {about['cores']} cores, load {about['load']},"
        f" Linux {about['kernel']}, Python {about['python']}, rclpy {about['rclpy']}.",
        "",
        "| | target | measured | limit | |",
        "|---|---|---|---|---|",
    ]
    for report in reports:
        for verdict in report.verdicts:
            target, measured, limit, met = _verdict(verdict)
            lines.append(f"| {report.number} | {target} | {measured} | {limit} | {met} |")
    for report in reports:
        lines += ["", f"### {report.number}. {report.title}", ""]
        lines += ["| " + " | ".join(_COLUMNS) + " |", "|---|---|---|---|---|---|"]
        lines += ["| " + " | ".join(_cells(figure)) + " |" for figure in report.figures]
    return "\n".join(lines)
