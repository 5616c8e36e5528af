"""A time axis: its unit, and ticks at round numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass

_UNITS = ((3600.0, "h", 3 * 3600.0), (60.0, "min", 180.0), (1.0, "s", 1.0), (0.001, "ms", 0.0))
"""Seconds of a unit, its sign, and the shortest time for which it is used."""
_ROUND = (1.0, 2.0, 5.0, 10.0)
"""Steps between ticks, times a power of ten: people read these easily."""


@dataclass(frozen=True)
class Axis:
    """Where the ticks are.

    Attributes:
        unit: Such as `"ms"`.
        ticks: Seconds, and what is written there.
    """

    unit: str
    ticks: tuple[tuple[float, str], ...]


def axis_for(seconds: float, most_ticks: int = 10) -> Axis:
    """Return the axis for a time of so many seconds."""
    scale, unit, _ = next(each for each in _UNITS if seconds >= each[2])
    length = max(seconds / scale, 1e-9)
    step = _step(length, most_ticks)
    count = math.floor(length / step + 1e-9)
    return Axis(unit, tuple((n * step * scale, f"{n * step:.10g}") for n in range(count + 1)))


def _step(length: float, most_ticks: int) -> float:
    least = length / most_ticks
    power = 10.0 ** math.floor(math.log10(least))
    return next(factor * power for factor in _ROUND if factor * power >= least * (1 - 1e-9))
