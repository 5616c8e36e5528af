"""The ledger of a command, and what is told of the goals that are left over in it."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.problems import Problem

if TYPE_CHECKING:
    from actionkit import CancelReport, Ledger, Leftover

_SAID = {
    "CONFIRMED": "It was canceled, and runs no more.",
    "NOT_NEEDED": "It had ended, or no server knows it.",
    "REFUSED": "The server refused to cancel it. IT IS STILL RUNNING.",
    "UNKNOWN": "No server has confirmed it. IT MAY STILL BE RUNNING.",
}


def open_ledger(path: str | None) -> Ledger:
    """Open the ledger at `path`, else the usual one.

    Raises:
        Problem: It cannot be used.
    """
    from actionkit import Ledger
    from actionkit._internal_api import usual_ledger
    from actionkit._model.errors import LedgerError

    try:
        return Ledger(path or usual_ledger())
    except LedgerError as error:
        where = "" if path else ". Name it in the environment variable ACTIONKIT_LEDGER"
        raise Problem(Exit.FAILED, f"{error}{where}") from error
    except (OSError, RuntimeError) as error:  # no home, or one that cannot be written
        raise Problem(
            Exit.FAILED,
            f"the file of goals cannot be made ({error}). Name another file in the environment"
            " variable ACTIONKIT_LEDGER",
        ) from error


def what_happened(report: CancelReport) -> str:
    """Return it as a sentence."""
    return _SAID[str(report)]


def line_of(goal: Leftover) -> str:
    """Return a line about a goal that is left over."""
    at = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(goal.sent))
    who = f"process {goal.pid} on {goal.host}"
    key = "" if goal.key is None else f"  key {goal.key!r}"
    return f"{goal.action_name}  {goal.goal_id}{key}  sent {at} ({_age(goal.sent)} ago) by {who}"


def _age(sent: float) -> str:
    """Return the time since then in its largest unit."""
    seconds = max(0.0, time.time() - sent)
    for unit, size in (("d", 86400), ("h", 3600), ("min", 60)):
        if seconds >= size:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds:.0f} s"
