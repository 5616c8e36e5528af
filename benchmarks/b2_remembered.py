"""2: the same, to servers that remember more and more goals."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from functools import partial

from benchmarks.clients import BEST_RAW, OURS
from benchmarks.measure import (
    Plot,
    Report,
    Sample,
    Scale,
    Verdict,
    alternate,
    figure,
    middle,
    ratio,
)
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
    report = Report(2, "Goals that the server remembers")
    plot = Plot("Goals that the server remembers", "goals", "client CPU, ms a call")
    report.plots.append(plot)
    clients = (*OURS, BEST_RAW)
    turns: dict[str, Callable[[], Sample]] = {}
    with ExitStack() as stack:
        for client in clients:
            # One process calls them all: two alike can differ in their cost by a tenth.
            pair = stack.enter_context(Pair(client))
            for level in _LEVELS:
                _fill(pair, level)
                turns[_name(client, level)] = partial(_turn, pair, level)
        samples = alternate(scale.pick(12, 40), turns, "2")
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
            plot.add(client, level, 1e3 * middle(samples[name], "cpu"))
    for client in OURS:
        most, zero = _name(client, _LEVELS[-1]), _name(client, 0)
        for key, what in (
            ("cpu", "client CPU"),
            ("latency", "latency"),
            ("rest", "latency less server CPU"),
        ):
            target = f"{what} of {client} with 5,000 remembered, to none"
            report.verdicts.append(Verdict(target, ratio(samples, most, zero, key), 1.2))
    return report


def _name(client: str, level: int) -> str:
    return f"{client}, {level} remembered"


def _action(level: int) -> str:
    return f"remembers_{level}"


def _fill(pair: Pair, level: int) -> None:
    options = {} if level else {"result_timeout": FORGETFUL}
    pair.renew_one(_action(level), **options)
    if level >= _FEW:
        pair.fill(level, _action(level))
    elif level:
        pair.client.do("at_once", goals=level, order=1, name=_action(level))


def _turn(pair: Pair, level: int) -> Sample:
    if 0 < level < _FEW:
        _fill(pair, level)
    return pair.turn(_CALLS, _ORDER, pace=_PACE, name=_action(level))
