"""The outcome of a call under a fault: a row of docs/maintainers/faults.md."""

from __future__ import annotations

from dataclasses import dataclass

from tests.tables import Cell, Seconds


@dataclass(frozen=True)
class Case:
    """One call: which fault strikes it, when, and what it may do about it."""

    fault: str
    phase: str
    policy: str


_OUTAGE = "Network outage, longer than the lease"
_LIVENESS = "SIGSTOP, SIGCONT, with liveness"
VARIES = {
    Case("SIGSTOP, SIGCONT", "before accept", "always"),
    Case(_LIVENESS, "executing, no feedback", "always"),
    Case(_LIVENESS, "during feedback", "always"),
    Case(_LIVENESS, "before accept", "always"),
    Case("Network outage, shorter than the lease", "before accept", "always"),
    Case(_OUTAGE, "executing, no feedback", "always"),
    Case(_OUTAGE, "during feedback", "always"),
}
"""Chance decides whether the first goal confirms its end before the second one's result comes."""

LATE = {Case(_OUTAGE, "ends during the fault", policy) for policy in ("server_gone", "always")}
"""Chance decides whether the result of the first goal comes before the second one is sent."""


@dataclass(frozen=True)
class Row:
    """What came of it.

    Attributes:
        case: What was done.
        outcome: How the call ended, in a few words.
        noticed: Seconds from the fault until the client knew; `None` where it did not need to.
        executed: How many goals of the call began to execute on the server.
        at_once: The most of them that executed at one time.
        left: How many of them were left running.
    """

    case: Case
    outcome: str
    noticed: float | None
    executed: int
    at_once: int
    left: int

    @property
    def cells(self) -> tuple[Cell, ...]:
        """How it is written."""
        noticed = "-" if self.noticed is None else Seconds(self.noticed)
        outcome, executed, at_once = self.outcome, str(self.executed), str(self.at_once)
        if self.case.policy == "always" and outcome.startswith("result, attempt"):
            # Whether the goal or a later one comes first is a matter of chance.
            executed = at_once = f"up to {outcome.split()[-1]}"
        if self.case in VARIES and outcome in (
            "result, attempt 2",
            "result, goal UNKNOWN, attempt 2",
        ):
            outcome, executed, at_once = "result, goal varies, attempt 2", "up to 2", "up to 2"
        if self.case in LATE and outcome in ("result", "result, attempt 2"):
            outcome = "result, attempt varies"
            if self.case.policy == "always":
                executed = at_once = "up to 2"
        return outcome, noticed, executed, at_once
