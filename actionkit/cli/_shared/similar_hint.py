"""Tells early that another name may be meant: looking for a server takes up to seven seconds."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from actionkit._model.similar_names import similar_names
from actionkit.cli._shared.say import say

if TYPE_CHECKING:
    from actionkit._ros.others_goals.survey import ActionSeen, Survey

_AFTER = 1.0
"""Seconds in which most servers that run come into sight."""


def hint_at_similar(survey: Survey, name: str) -> None:
    """Say it once, on stderr, if only similar names have a server after a second of looking.

    `name` is a full name. The looking goes on: its server may be late.
    """
    over = False
    before: list[str] = []

    def on_look(actions: dict[str, ActionSeen]) -> None:
        nonlocal over, before
        if over or time.monotonic() - survey.opened < _AFTER:
            return
        served = [action.name for action in actions.values() if action.servers]
        over = name in served
        if over or served == before:
            return
        before = served
        if near := similar_names(name, served):
            over = True
            say(
                f"{name} has no server in sight so far. Did you mean {' or '.join(near)}?"
                " Still looking; Ctrl-C ends it.",
                err=True,
            )

    survey.on_look.append(on_look)
