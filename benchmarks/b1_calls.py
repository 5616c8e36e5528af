"""1: what one call costs, with calls one after the other."""

from __future__ import annotations

import statistics
from contextlib import ExitStack
from functools import partial

from benchmarks.clients import FLOOR, LEDGER, OURS
from benchmarks.measure import Report, Samples, Scale, Verdict, alternate, best, figure, ratio
from benchmarks.pairs import FORGETFUL, Pair
from benchmarks.variants import RAW, VARIANTS

_CALLS = 10
_LIMITS = {"rclcpp": {"cpu": 2.0, "latency": 1.5}, FLOOR: {"cpu": 1.4, "latency": 1.4}}
"""What a blocking call may cost, to these."""
_LEDGER_ADDS = 0.1
"""Milliseconds."""
_NAMES = {"cpu": "client CPU", "latency": "latency"}


def run_all(scale: Scale) -> Report:
    """Measure latency and client CPU for two orders, with and without feedback."""
    report = Report(1, "One call at a time")
    with ExitStack() as stack:
        pairs = {
            name: stack.enter_context(Pair(name, result_timeout=FORGETFUL)) for name in VARIANTS
        }
        for order in (5, 50):
            for feedback in (False, True):
                _cell(report, scale, pairs, order, feedback)
    return report


def _cell(report: Report, scale: Scale, pairs: dict[str, Pair], order: int, feedback: bool) -> None:
    what = f"order {order}" + (", on_feedback" if feedback else "")
    for pair in pairs.values():
        pair.renew()  # the tutorial's client gets slower with every call that it makes
    turns = {
        name: partial(pair.turn, _CALLS, order, feedback=feedback) for name, pair in pairs.items()
    }
    samples = alternate(scale.pick(20, 100), turns, f"1, {what}")
    fastest, leanest = best(samples, RAW, "latency"), best(samples, RAW, "cpu")
    for name in pairs:
        latency = figure(f"{what}: latency", samples, name, "latency", baseline=fastest)
        cpu = figure(f"{what}: client CPU", samples, name, "cpu", baseline=leanest)
        report.figures += [latency, cpu]
        if feedback:
            report.figures.append(
                figure(f"{what}: feedback messages", samples, name, "feedback", unit="")
            )
        if name == OURS[0]:
            for part in ("communication", "callbacks", "caller", "middleware"):
                report.figures.append(figure(f"{what}: CPU, thread: {part}", samples, name, part))
        if name in OURS:
            report.verdicts += [
                Verdict(f"{what}: latency of {name}, to the best raw", latency.ratio, 1.0),
                Verdict(f"{what}: client CPU of {name}, to the best raw", cpu.ratio, 0.6),
            ]
    report.verdicts.append(
        Verdict(f"{what}: CPU that a ledger adds", 1e3 * added(samples), _LEDGER_ADDS, "ms")
    )
    for other, limits in _LIMITS.items():
        for key, limit in limits.items() if other in pairs else ():
            to = f"{what}: {_NAMES[key]} of {OURS[0]}, to {other}"
            report.verdicts.append(Verdict(to, ratio(samples, OURS[0], other, key), limit))


def added(samples: Samples) -> float:
    """Return the median of the CPU seconds that the ledger's client used more in a round."""
    both = zip(samples[LEDGER], samples[OURS[0]], strict=True)
    return statistics.median(float(kept["cpu"]) - float(plain["cpu"]) for kept, plain in both)
