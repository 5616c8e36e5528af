"""Which ledger a client has. Imports no SQLite where it has none."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from actionkit._calls.ledger.file import LedgerFile

VARIABLE = "ACTIONKIT_LEDGER"


def ledger_of(given: LedgerFile | None) -> LedgerFile | None:
    """Return the ledger of a client: the given one, or that of the environment.

    Raises:
        LedgerError: Its file cannot be used.
        TypeError: It is not a ledger.
    """
    path = os.environ.get(VARIABLE)
    if given is None and not path:
        return None
    from actionkit._calls.ledger.file import LedgerFile

    if given is None:
        return LedgerFile(str(path))
    if not isinstance(given, LedgerFile):
        raise TypeError(f"ledger={given!r} must be a Ledger: ledger=Ledger('mission.db')")
    return given


def flush() -> None:
    """Wait a moment until the goals that have stopped are removed, from all files."""
    file = sys.modules.get("actionkit._calls.ledger.file")
    flush_all = getattr(file, "flush", None)  # another thread may be importing it
    if flush_all is not None:
        flush_all()


def usual_path() -> Path:
    """Return the path of the environment; else that of a file of this user, and make its folder.

    Raises:
        OSError: The folder cannot be made.
    """
    if path := os.environ.get(VARIABLE):
        return Path(path)
    state = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    folder = Path(state) / "actionkit"
    folder.mkdir(parents=True, exist_ok=True)
    return folder / "goals.db"
