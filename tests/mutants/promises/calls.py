"""Mutants of the two calls, and of how they end."""

from __future__ import annotations

from tests.mutants.mutant import Mutant

MUTANTS = (
    Mutant(
        "C1.10",
        "the interpreter's exit does not wait for confirmations",
        "_calls/exit.py",
        "    _await_freed(sessions, began, end_calls(sessions))\n",
        "    end_calls(sessions)\n",
        ("client/test_exit.py",),
    ),
    Mutant(
        "C2.4",
        "a goal that is accepted late is not cancelled",
        "_goal/machine.py",
        """        if self.unwanted:
            effects.append(fx.AskCancel())
        return effects + self._arm_stall(now)""",
        """        return effects + self._arm_stall(now)""",
        ("client/test_cancel.py::test_late_acceptance_after_the_deadline_is_cancelled",),
    ),
)
