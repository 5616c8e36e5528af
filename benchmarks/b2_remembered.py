"""2: the same, to servers that remember more and more goals."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack

from benchmarks.clients import BEST_RAW, OURS
from benchmarks.measure import Report, Sample, Scale, Verdict, alternate, figure, middle, ratio
from benchmarks.pairs import FORGETFUL, Pair

_ORDER = 5
_CALLS = 10
_LEVELS = (0, 100, 1000, 5000)
_PACE = 0.02
"""Seconds for one call. Back to back, a call to a slower server would find colder caches, which
alone doubles the CPU of a call."""
_FEW = 500
"""Below it, the calls that are measured would count."""


def run_all(scale: Scale) -> Report:
    """Measure against servers with so many goals in their memory."""
    report = Report(2, "Goals that the server remembers", axes=("remembered goals", "CPU ms/call"))
    clients = (OURS[0], BEST_RAW)
    turns: dict[str, Callable[[], Sample]] = {}
    with ExitStack() as stack:
        for client in clients:
            for level in _LEVELS:
                options = {} if level else {"result_timeout": FORGETFUL}
                pair = stack.enter_context(Pair(client, **options))
                pair.fill(level)
                turns[_name(client, level)] = (
                    lambda pair=pair, level=level: _turn(pair, level)  # type: ignore[misc]
                )
        samples = alternate(scale.pick(9, 20), turns, "2")
    for client in clients:
        for level in _LEVELS:
            name, zero = _name(client, level), _name(client, 0)
            for key, what in (
                ("cpu", "client CPU"),
                ("latency", "latency"),
                ("server", "server CPU"),
                ("rest", "latency less server CPU"),
            ):
                report.figures.append(figure(what, samples, name, key, baseline=zero))
            report.series.setdefault(client, []).append((level, 1e3 * middle(samples[name], "cpu")))
    for key, what in (
        ("cpu", "client CPU"),
        ("latency", "latency"),
        ("rest", "latency less server CPU"),
    ):
        most, zero = _name(OURS[0], _LEVELS[-1]), _name(OURS[0], 0)
        report.verdicts.append(
            Verdict(f"{what} with 5,000 remembered, to none", ratio(samples, most, zero, key), 1.2)
        )
    return report


def _name(client: str, level: int) -> str:
    return f"{client}, {level} remembered"


def _turn(pair: Pair, level: int) -> Sample:
    if 0 < level < _FEW:
        pair.renew()
        pair.fill(level)
    return pair.turn(_CALLS, _ORDER, pace=_PACE)
