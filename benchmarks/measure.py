"""Samples taken in alternation, ratios between them, and verdicts on targets."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from rich.console import Console

console = Console(stderr=True)
Sample = Mapping[str, Any]
Samples = dict[str, list[Sample]]


@dataclass(frozen=True)
class Scale:
    """How much to measure.

    Attributes:
        quick: Whether it all has to be over in ten minutes.
    """

    quick: bool

    def pick(self, quick: int, full: int) -> int:
        """Return one of two numbers."""
        return quick if self.quick else full


@dataclass(frozen=True)
class Figure:
    """One line of the table.

    Attributes:
        what: What was measured.
        who: Of whom.
        value: The median over all rounds.
        unit: Its unit.
        baseline: With whom it is compared, or `""`.
        ratio: The median of the rounds' ratios to the baseline.
        low: Their first quartile.
        high: Their third quartile.
    """

    what: str
    who: str
    value: float
    unit: str
    baseline: str = ""
    ratio: float | None = None
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Verdict:
    """Whether a target is met."""

    target: str
    measured: float | None
    limit: float
    unit: str = "x"

    @property
    def met(self) -> bool:
        """Whether it is."""
        return self.measured is not None and self.measured <= self.limit

    @property
    def share(self) -> float:
        """How much of the limit is used: above one is missed."""
        if self.measured is None:
            return float("inf")
        if self.limit == 0:
            return 0.0 if self.met else float("inf")  # nothing at all is allowed
        return max(0.0, self.measured) / self.limit


@dataclass
class Plot:
    """Something for a picture.

    Attributes:
        title: What it tells.
        x: What goes along.
        y: What goes up.
        series: Lines: points of each, by name.
    """

    title: str
    x: str
    y: str
    series: dict[str, list[tuple[float, float]]] = field(default_factory=dict)

    def add(self, who: str, x: float, y: float) -> None:
        """Add a point to somebody's line."""
        self.series.setdefault(who, []).append((x, y))


@dataclass
class Report:
    """What one benchmark found.

    Attributes:
        number: Which of them it is.
        title: What it is about.
        figures: The lines of its table.
        verdicts: On its targets.
        plots: For the pictures.
        notes: What the table doesn't tell, in sentences.
        about: When, by which command and on what it was measured.
    """

    number: int
    title: str
    figures: list[Figure] = field(default_factory=list)
    verdicts: list[Verdict] = field(default_factory=list)
    plots: list[Plot] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    about: str = ""


def alternate(rounds: int, variants: Mapping[str, Callable[[], Sample]], what: str = "") -> Samples:
    """Let each variant have its turn in each round: A B, B A, A B, ..."""
    samples: Samples = {name: [] for name in variants}
    for number in range(rounds):
        console.print(f"  {what}: round {number + 1} of {rounds}", style="dim", end="\r")
        for name in list(variants)[:: 1 if number % 2 == 0 else -1]:
            samples[name].append(variants[name]())
    console.print()
    return samples


def middle(samples: Sequence[Sample], key: str) -> float:
    """Return the median over the rounds."""
    return statistics.median(float(sample[key]) for sample in samples)


def ratios(samples: Samples, name: str, baseline: str, key: str) -> list[float]:
    """Return the ratio of the two variants within each round, in ascending order."""
    both = zip(samples[name], samples[baseline], strict=True)
    return sorted(float(one[key]) / float(other[key]) for one, other in both if other[key])


def ratio(samples: Samples, name: str, baseline: str, key: str) -> float:
    """Return the median of these ratios."""
    return statistics.median(ratios(samples, name, baseline, key))


def figure(
    what: str, samples: Samples, name: str, key: str, *, unit: str = "ms", baseline: str = ""
) -> Figure:
    """Return a line of the table about one variant's samples, which are in seconds for "ms"."""
    value = middle(samples[name], key) * (1e3 if unit == "ms" else 1.0)
    found = ratios(samples, name, baseline, key) if baseline else []
    if len(found) < 2 or baseline == name:
        return Figure(what, name, value, unit)
    low, median, high = statistics.quantiles(found, n=4, method="inclusive")
    return Figure(what, name, value, unit, baseline, median, low, high)


def best(samples: Samples, names: Sequence[str], key: str) -> str:
    """Return which of the variants has the lowest median."""
    return min(names, key=lambda name: middle(samples[name], key))
