"""Writes the line of JSON about the hold."""

from __future__ import annotations

import time
from collections.abc import Sequence

from actionkit._observers.json_schema import note_line
from actionkit._ros.holds.state import Hold


def hold_line(held: bool | None, holds: Sequence[Hold], **more: object) -> str:
    """Return the line; `held` is `None` if it is not known whether agents are held."""
    told = [{"by": hold.by, "since": hold.since, "id": hold.hold_id} for hold in holds]
    return note_line("hold", "", time.time(), held=held, holds=told, **more)
