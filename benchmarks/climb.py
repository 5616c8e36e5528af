"""Measuring at growing sizes, until something breaks or the time is over."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence

from benchmarks.measure import Figure, Plot, Report, Sample, Samples, console, figure, middle

_LONG = 300
Turn = Callable[[int], Sample]
"""Measures at a size. It raises RuntimeError where that can't be done."""


class Climb:
    """One kind of size and who is measured at it, each from small to large, within a time.

    Whoever fails at each try of a size is not tried at a larger one: the report tells where it
    broke.
    """

    def __init__(
        self, report: Report, what: str, unit: str, seconds: float, tries: int = 2
    ) -> None:
        """Name what is measured, the unit of its sizes, and what time and tries there are."""
        self._tries = tries
        self.samples: Samples = {}
        self._report = report
        self._what = what
        self._unit = unit
        self._until = time.monotonic() + seconds
        self._out: set[str] = set()
        self._measured: dict[str, list[int]] = {}

    def left(self) -> float:
        """Return the seconds that are left, none below one."""
        return max(1.0, self._until - time.monotonic())

    def up(self, sizes: Sequence[int], turns: Mapping[str, Turn], rounds: int) -> None:
        """Measure at each size, all in alternation."""
        self._measured = {who: [] for who in turns}
        for size in sizes:
            for number in range(rounds):
                console.print(f"  9, {self._what}: {size:,}, round {number + 1}", style="dim")
                for who in list(turns)[:: 1 if number % 2 == 0 else -1]:
                    self._try(who, size, turns[who])
            for who in turns:
                if len(self.samples.get(self.row(who, size), ())) == rounds:
                    self._measured[who].append(size)
                else:
                    self._out.add(who)
                    self.samples.pop(self.row(who, size), None)

    def _try(self, who: str, size: int, turn: Turn) -> None:
        if who in self._out:
            return
        if time.monotonic() >= self._until:
            self._note(who, size, "there was no time left to try")
            self._out.add(who)
            return
        sample = self._attempt(who, size, turn)
        for _ in range(self._tries - 1):
            if sample is None and time.monotonic() < self._until:
                sample = self._attempt(who, size, turn)
        if sample is None:
            self._out.add(who)
        else:
            self.samples.setdefault(self.row(who, size), []).append(sample)

    def _attempt(self, who: str, size: int, turn: Turn) -> Sample | None:
        try:
            return turn(size)
        except RuntimeError as error:
            why = str(error).strip().splitlines()[-1]
            if len(why) > _LONG:
                why = why[:_LONG] + " ..."
            self._note(who, size, why.removeprefix("RuntimeError: "))
            return None

    def _note(self, who: str, size: int, why: str) -> None:
        note = f"{self.row(who, size)}: {why.rstrip('.')}."
        console.print(f"  {note}", style="yellow")
        self._report.notes.append(note)

    def row(self, who: str, size: int) -> str:
        """Return the name of a row."""
        return f"{who}, {self.sized(size)}"

    def sized(self, size: int) -> str:
        """Return a size with its unit."""
        return f"{size:,} {self._unit}"

    def figures(self, what: str, key: str, raw: str, *, unit: str = "ms") -> None:
        """Put a line for each who and size into the report, beside the raw client's."""
        for who, sizes in self._measured.items():
            for size in sizes:
                name, other = self.row(who, size), self.row(raw, size)
                baseline = other if other in self.samples and who != raw else ""
                line = figure(what, self.samples, name, key, unit=unit, baseline=baseline)
                if baseline and line.ratio is None and (to := middle(self.samples[other], key)):
                    # One round only: there is no spread.
                    line = Figure(
                        what,
                        name,
                        line.value,
                        unit,
                        baseline,
                        middle(self.samples[name], key) / to,
                    )
                self._report.figures.append(line)

    def plot(self, title: str, y: str, key: str, scale: float, x: str = "") -> None:
        """Put a curve for each who into the report."""
        plot = Plot(title, x or self._unit, y)
        for who, sizes in self._measured.items():
            for size in sizes:
                plot.add(who, size, scale * middle(self.samples[self.row(who, size)], key))
        self._report.plots.append(plot)

    def last_ratio(self, who: str, raw: str, key: str) -> tuple[int, float] | None:
        """Return the largest size at which both were measured, and their ratio there."""
        both = set(self._measured.get(who, ())) & set(self._measured.get(raw, ()))
        if not both:
            return None
        size = max(both)
        other = middle(self.samples[self.row(raw, size)], key)
        return size, middle(self.samples[self.row(who, size)], key) / max(1e-9, other)
