"""Chooses the unit of a time axis, and ticks at round numbers."""

from __future__ import annotations

import math

_UNITS = ((3600.0, "h", 3 * 3600.0), (60.0, "min", 180.0), (1.0, "s", 1.0), (0.001, "ms", 0.0))
"""Seconds in a unit, its symbol, and the shortest time for which it is used."""
_MOST_TICKS = 10
"""With more ticks, there would be too little room for the labels."""
_ROUND = (1.0, 2.0, 5.0, 10.0)
"""Steps between ticks, multiplied by a power of ten: easy to read."""


def axis_for(seconds: float) -> tuple[str, list[tuple[float, str]]]:
    """Return the unit and the ticks, each in seconds with its label."""
    scale, unit, _ = next(each for each in _UNITS if seconds >= each[2])
    length = max(seconds / scale, 1e-9)
    step = _step(length)
    count = math.floor(length / step + 1e-9)
    return unit, [(n * step * scale, f"{n * step:.10g}") for n in range(count + 1)]


def _step(length: float) -> float:
    least = length / _MOST_TICKS
    power = 10.0 ** math.floor(math.log10(least))
    return next(factor * power for factor in _ROUND if factor * power >= least * (1 - 1e-9))
