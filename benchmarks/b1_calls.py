"""1: what one call costs, with calls one after the other."""

from __future__ import annotations

import statistics
from contextlib import ExitStack
from functools import partial
from itertools import product

from benchmarks.clients import FLOOR, KEYS, LEDGER, MANY_KEYS, OURS
from benchmarks.measure import Report, Scale, Verdict, alternate, best, figure, ratio
from benchmarks.pairs import FORGETFUL, Pair
from benchmarks.variants import COMPARED, RAW

_CALLS = 10
_LIMITS = {"rclcpp": {"cpu": 2.0, "latency": 1.5}, FLOOR: {"cpu": 1.4, "latency": 1.4}}
"""What a call may cost, to these."""
_LEDGER_ADDS = 0.1
"""Milliseconds."""
_KEY_ADDS = 0.4
"""The same; the future waits until its result is written."""
_ACTIONS = {
    OURS[0]: "without",
    LEDGER: "with_ledger",
    KEYS: "with_keys",
    MANY_KEYS: "with_many_keys",
}
"""The actions of the clients without a ledger, with one, and with keys in it."""
_NAMES = {"cpu": "client CPU", "latency": "latency"}


def run_all(scale: Scale) -> Report:
    """Measure latency and client CPU for two orders, with and without feedback."""
    report = Report(1, "One call at a time")
    with ExitStack() as stack:
        pairs = {
            name: stack.enter_context(Pair(name, result_timeout=FORGETFUL)) for name in COMPARED
        }
        for order in (5, 50):
            for feedback in (False, True):
                _cell(report, scale, pairs, order, feedback)
    _ledger(report, scale)
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
    for name, (other, limits) in product(OURS, _LIMITS.items()):
        for key, limit in limits.items() if other in pairs else ():
            to = f"{what}: {_NAMES[key]} of {name}, to {other}"
            report.verdicts.append(Verdict(to, ratio(samples, name, other, key), limit))


def _ledger(report: Report, scale: Scale) -> None:
    """Measure what a ledger adds, in one process: two processes differ by half as much."""
    with Pair(OURS[0], result_timeout=FORGETFUL) as pair:
        for name, action in _ACTIONS.items():
            pair.server.do("renew", name=action, result_timeout=FORGETFUL)
            pair.client.do("open", name=action, variant=name)
        turns = {name: partial(pair.turn, _CALLS, 5, name=one) for name, one in _ACTIONS.items()}
        samples = alternate(scale.pick(100, 300), turns, "1, ledger")
    pairs = (
        ("a ledger", LEDGER, OURS[0], _LEDGER_ADDS),
        ("a key", KEYS, LEDGER, _KEY_ADDS),
        ("100,000 keys in the file", MANY_KEYS, KEYS, _LEDGER_ADDS),
    )
    for what, more, less, limit in pairs:
        both = zip(samples[more], samples[less], strict=True)
        added = statistics.median(float(kept["cpu"]) - float(plain["cpu"]) for kept, plain in both)
        report.verdicts.append(Verdict(f"order 5: CPU that {what} adds", 1e3 * added, limit, "ms"))
