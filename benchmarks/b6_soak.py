"""6: many, many calls; nothing may grow."""

from __future__ import annotations

import statistics
from contextlib import ExitStack
from typing import Any

from benchmarks.clients import BEST_RAW, OURS
from benchmarks.measure import Figure, Plot, Report, Scale, Verdict, console
from benchmarks.pairs import FORGETFUL, Pair

_ORDER = 5
_CALLS = 1000
_RAW_CALLS = 100
_MB = 1e6


def run_all(scale: Scale) -> Report:
    """Call a hundred thousand times, and look at what has grown since the first thousand."""
    report = Report(6, "A hundred thousand calls")
    rounds = scale.pick(10, 100)
    report.title = f"{rounds},000 calls in a row"
    states: list[dict[str, Any]] = []
    latency: list[float] = []
    raw: list[float] = []
    with ExitStack() as stack:
        ours = stack.enter_context(Pair(OURS[0], result_timeout=FORGETFUL))
        theirs = stack.enter_context(Pair(BEST_RAW, result_timeout=FORGETFUL))
        for number in range(rounds):
            console.print(f"  6: {number + 1},000 of {rounds},000 calls", style="dim", end="\r")
            latency.append(ours.turn(_CALLS, _ORDER)["latency"])
            raw.append(theirs.turn(_RAW_CALLS, _ORDER)["latency"])
            states.append(ours.client.do("state"))
        console.print()
    _report(report, states, latency, raw)
    return report


def _report(
    report: Report, states: list[dict[str, Any]], latency: list[float], raw: list[float]
) -> None:
    first, last = states[0], states[-1]
    plot = Plot("Memory, call after call", "thousand calls", "MB")
    for number, state in enumerate(states):
        plot.add(OURS[0], number + 1, state["memory"] / _MB)
    report.plots.append(plot)
    for key, unit, scale in (
        ("memory", "MB", _MB),
        ("objects", "", 1),
        ("threads", "", 1),
        ("timers", "", 1),
    ):
        report.figures.append(
            Figure(
                f"{key} at the end",
                OURS[0],
                last[key] / scale,
                unit,
                "after 1,000",
                last[key] / max(1, first[key]),
            )
        )
    fifth = max(1, len(latency) // 5)
    drifts = {
        who: statistics.median(took[-fifth:]) / statistics.median(took[:fifth])
        for who, took in ((OURS[0], latency), (BEST_RAW, raw))
    }
    for (who, drift), took in zip(drifts.items(), (latency, raw), strict=True):
        report.figures.append(
            Figure(
                "latency of the last fifth",
                who,
                1e3 * statistics.median(took[-fifth:]),
                "ms",
                "the first fifth",
                drift,
            )
        )
    report.verdicts += [
        Verdict("memory at the end, to after 1,000 calls", last["memory"] / first["memory"], 1.05),
        Verdict("Python objects, to after 1,000", last["objects"] / first["objects"], 1.01),
        Verdict("threads more than after 1,000", last["threads"] - first["threads"], 0, ""),
        Verdict("entries left in the tables", max(state["tables"] for state in states), 0, ""),
        Verdict(
            "latency drift, to that of the raw client beside it",
            drifts[OURS[0]] / drifts[BEST_RAW],
            1.15,
        ),
    ]
