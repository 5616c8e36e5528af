"""Shows what happened to the goals of all actions, for `actionkit stop`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from actionkit._ros.cancelling.cancelling import Cancelling
from actionkit.cli._shared.exits import Exit
from actionkit.cli._shared.say import say

_EXITS = {
    "REFUSED": Exit.CANCEL_REFUSED,
    "UNKNOWN": Exit.CANCEL_UNKNOWN,
    "NO_SUCH_GOAL": Exit.NO_SUCH_GOAL,
}
"""The exit codes, the worst first; goals with other answers have stopped."""
_WORST = (Exit.CANCEL_REFUSED, Exit.CANCEL_UNKNOWN, Exit.FAILED, Exit.NO_SERVER)


def worst(codes: Sequence[Exit]) -> Exit:
    """Return the worst of these exit codes."""
    return next((code for code in _WORST if code in codes), Exit.OK)


def say_error(name: str, error: Exception) -> None:
    """Say that the goals of an action cannot be cancelled."""
    say(f"Error: {name}: {type(error).__name__}: {error}", err=True)


def exit_of(action: Cancelling) -> Exit:
    """Return the worst exit code of all goals; with a silent server, the fate is not known."""
    found = {fate.cancel for fate in action.fates}
    code = next((code for cancel, code in _EXITS.items() if cancel in found), Exit.OK)
    return Exit.CANCEL_UNKNOWN if code is Exit.OK and action.unheard else code


_HEADS = ("ACTION", "SERVER", "GOALS", "CANCELED", "ENDED", "REFUSED", "UNKNOWN")


def table(actions: Sequence[Cancelling]) -> list[str]:
    """Return the lines of a table of actions, and a line for each goal that may still run."""
    rows = [_HEADS] + [_row(action) for action in actions]
    widths = [max(len(row[column]) for row in rows) for column in range(len(_HEADS))]
    lines = []
    for row in rows:
        cells = [
            cell.ljust(width) if column < 2 else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    for action in actions:
        if action.unheard:
            lines.append(action.unheard)
        for fate in action.fates:
            if fate.cancel in ("REFUSED", "UNKNOWN"):
                lines.append(f"{action.name} {fate.goal_id}: {fate.text}")
    return lines


def _row(action: Cancelling) -> tuple[str, ...]:
    counts = Counter(fate.cancel for fate in action.fates)
    goals = str(len(action.fates)) if action.fates or not action.silent else "?"
    numbers = [counts[name] for name in ("CONFIRMED", "NOT_NEEDED", "REFUSED", "UNKNOWN")]
    servers = ", ".join(action.servers) or "-"
    return (action.name, servers, goals, *(str(number) if number else "-" for number in numbers))
