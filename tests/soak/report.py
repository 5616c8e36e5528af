"""The reports of the soak: each minute, at its end, and as JSON."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.soak.rounds import Result

_SHOWN = 5
_MB = 1e6


@dataclass
class Totals:
    """All rounds until now.

    Attributes:
        seed: Of the soak.
        seconds: For which it has gone on.
        rounds: How many there were.
        outcomes: How many calls ended how.
        problems: How many there were of each sort.
        texts: What the first of each sort were.
        late: The longest delay beyond a call's bound, in seconds.
        unconfirmed: Calls given up on with healthy servers, and not confirmed in time.
        programs: How many were told to end.
        told: How many goals were left running, but named, and out of reach.
        faults: How many there were of each sort.
        states: What must not grow, after each round, by place.
    """

    seed: int
    seconds: float = 0.0
    rounds: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    problems: Counter[str] = field(default_factory=Counter)
    texts: dict[str, list[str]] = field(default_factory=dict)
    late: float = 0.0
    unconfirmed: int = 0
    programs: int = 0
    told: int = 0
    faults: Counter[str] = field(default_factory=Counter)
    states: dict[str, list[dict[str, Any]]] = field(default_factory=dict)

    def add(self, number: int, result: Result) -> None:
        """Take the result of a round."""
        self.rounds += 1
        self.outcomes.update(result.outcomes)
        self.late = max(self.late, result.late)
        self.unconfirmed += result.unconfirmed
        self.programs += result.programs
        self.told += result.told
        self.faults.update(fault.what for fault in result.plan.faults)
        self.faults.update(one.way for one in result.plan.programs)
        if result.state:
            self.states.setdefault(result.place, []).append(result.state)
        for problem in result.problems:
            self.problems[problem.what] += 1
            texts = self.texts.setdefault(problem.what, [])
            texts.append(f"round {number} ({result.place}: {result.plan.text}): {problem.text}")

    @property
    def calls(self) -> int:
        return self.outcomes.total()

    @property
    def good(self) -> bool:
        """Whether nothing was left and nothing wrong."""
        return not self.problems and self.calls > 0

    @property
    def grown(self) -> str:
        """How memory and tables went, from the first round's end to the last's."""
        parts = []
        for place, states in self.states.items():
            first, last = states[0], states[-1]
            parts.append(
                f"{place}: memory {first['memory'] / _MB:.1f} to {last['memory'] / _MB:.1f} MB,"
                f" tables {first['tables']} to {last['tables']},"
                f" threads {first['threads']} to {last['threads']}"
            )
        return "; ".join(parts) or "not measured"

    @property
    def line(self) -> str:
        """One line for each minute."""
        return (
            f"{self.seconds / 60:5.1f} min, {self.rounds} rounds, {self.calls} calls,"
            f" {self.programs} programs; left running {self.problems['left']}"
            f" ({self.told} more were named),"
            f" wrong {self.problems['wrong']}, run twice {self.problems['twice']},"
            f" hung {self.problems['hung']}, late {self.problems['late']};"
            f" longest delay beyond the bound {self.late:.1f} s; {self.unconfirmed} unconfirmed"
        )

    @property
    def text(self) -> str:
        """The whole story, for the end."""
        lines = [self.line, f"seed {self.seed}; {self.grown}"]
        lines.append(f"done: {dict(sorted(self.faults.items()))}")
        lines.append("outcomes:")
        lines += [f"  {number:7} {outcome}" for outcome, number in self.outcomes.most_common()]
        for what, texts in self.texts.items():
            lines.append(f"{what}, {len(texts)} in all, the first of them:")
            lines += [f"  {text}" for text in texts[:_SHOWN]]
        lines.append("nothing left running, nothing wrong" if self.good else "NOT AS PROMISED")
        return "\n".join(lines)

    def write(self, path: Path) -> None:
        """Write it as JSON."""
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(self.__dict__ | {"good": self.good}, indent=2) + "\n")
