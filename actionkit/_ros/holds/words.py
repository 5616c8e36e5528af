"""Describes holds in words for people. Pure, except that it reads the time zone."""

from __future__ import annotations

import time
from collections.abc import Sequence

from actionkit._model.printable import visible
from actionkit._ros.holds.state import UNREADABLE, Hold

_MOST = 3


def who(holds: Sequence[Hold]) -> str:
    """Return who holds since when, the oldest hold first."""
    shown = [f"{visible(hold.by)}{since(hold)}" for hold in holds[:_MOST]]
    more = len(holds) - _MOST
    return ", ".join(shown) + (f" and {more} more" if more > 0 else "")


def since(hold: Hold) -> str:
    """Return when a hold began, by the clock of the computer where it began."""
    if hold.by == UNREADABLE:
        return ""
    return time.strftime(" since %Y-%m-%d %H:%M:%S", time.localtime(hold.since))
