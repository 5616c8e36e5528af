"""3: many goals in flight at a time."""

from __future__ import annotations

import statistics
from contextlib import ExitStack
from functools import partial

from benchmarks.clients import BEST_RAW, FLOOR, OURS
from benchmarks.measure import (
    Report,
    Sample,
    Scale,
    Verdict,
    alternate,
    figure,
    ratio,
)
from benchmarks.pairs import Pair, tried_again
from benchmarks.rclcpp_client import prefix

_ORDER = 5
_LEVELS = (1, 10, 100, 1000)
_CLIENTS = {
    "threads": OURS[0],
    "asyncio": OURS[1],
    "rclpy, threads": BEST_RAW,
    "least in Python": FLOOR,
}
if prefix() is not None:
    _CLIENTS["rclcpp"] = "rclcpp"
_LIMITS = {"rclcpp": {"cpu": 2.0, "wall": 1.5}, "least in Python": {"cpu": 1.4, "wall": 1.4}}
"""What a goal may cost with a hundred in flight, to these."""
_NAMES = {"wall": "wall time", "cpu": "client CPU"}
_WAVES = {1: 30, 10: 10, 100: 2, 1000: 1}


def run_all(scale: Scale) -> Report:
    """Submit so many goals together; the server runs them when it has accepted them all."""
    report = Report(3, "Many goals in flight")
    with ExitStack() as stack:
        pairs = {name: stack.enter_context(Pair(client)) for name, client in _CLIENTS.items()}
        turns = {
            _name(name, level): partial(tried_again, partial(_turn, pair, level))
            for level in _LEVELS
            for name, pair in pairs.items()
        }
        samples = alternate(scale.pick(4, 12), turns, "3")
    for who in _CLIENTS:
        for level in _LEVELS:
            name, ten = _name(who, level), _name(who, 10)
            report.figures += [
                figure("wall time per goal", samples, name, "wall", baseline=ten),
                figure("client CPU per goal", samples, name, "cpu", baseline=ten),
                figure("slowest 5 % to median goal", samples, name, "unfair", unit="x"),
            ]
        if who in ("threads", "asyncio"):
            thousand, ten = _name(who, 1000), _name(who, 10)
            for key, what in _NAMES.items():
                report.verdicts.append(
                    Verdict(
                        f"{what} per goal, 1,000 in flight ({who}), to 10",
                        ratio(samples, thousand, ten, key),
                        2.0,
                    )
                )
            for other, limits in _LIMITS.items():
                for key, limit in limits.items() if other in _CLIENTS else ():
                    to = f"{_NAMES[key]} per goal, 100 in flight ({who}), to {other}"
                    measured = ratio(samples, _name(who, 100), _name(other, 100), key)
                    report.verdicts.append(Verdict(to, measured, limit))
    return report


def _name(who: str, level: int) -> str:
    return f"{who}, {level} in flight"


def _turn(pair: Pair, level: int) -> Sample:
    pair.renew(hold=level)  # or what the server remembers would differ
    waves = [pair.client.do("at_once", goals=level, order=_ORDER) for _ in range(_WAVES[level])]
    return {
        "wall": statistics.median(wave["wall"] for wave in waves),
        "cpu": statistics.mean(wave["cpu"] for wave in waves),
        "unfair": statistics.median(_unfair(sorted(wave["took"])) for wave in waves),
    }


def _unfair(took: list[float]) -> float:
    """Return how much longer than the median goal the slowest of twenty took."""
    return took[min(len(took) - 1, int(0.95 * len(took)))] / statistics.median(took)
