"""rosbridge, with a web page that serves an action."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from tests.field import interfaces, rosbridge
from tests.field.kind import Kind
from tests.field.sources import SERVERS, upstream

_LAUNCHER = Path(__file__).parents[1] / "serve_rosbridge.py"
ENDS = {
    202: "the page says CANCELED, and nobody has cancelled",
    402: "it sends `result: false`",
    902: "it says ABORTED",
    1002: "it says UNKNOWN",
    502: "it sends a result of another type",
    802: "it sends the result twice",
}
"""What can happen, by the order of the goal."""
SUCCEEDS = "it succeeds after a cancel"
UNADVERTISES = "it unadvertises the action"
CLOSES = "it closes"
CRASHES = "it crashes"
RELOADED = "it is reloaded"
LATER = "it succeeds after a reload"
LATER_CANCEL = "it cancels after a reload"
RESTARTED = "it succeeds after a reload and a restart of rosbridge"


def _program() -> Sequence[str]:
    folders = os.pathsep.join(map(str, (rosbridge.packages(), interfaces.interfaces())))
    return str(_LAUNCHER), folders, str(upstream() / "rosbridge"), str(SERVERS / "webserver.py")


ROSBRIDGE = Kind(
    name="rosbridge, a web page as server",
    program=_program,
    # The hundreds say how the page ends the goal, the rest how many steps of 0.3 s it takes.
    # After 44 steps, the numbers are greater than the message's.
    goals={
        "short": {"order": 2},
        "long": {"order": 44},
        "aborts": {"order": 902},
        "ignores": {"order": 112},
    },
    log={  # what the page writes; rosbridge itself writes less
        "executing": "got send_action_goal",
        "cancel_requested": "got cancel_action_goal",
        "succeeded": "end ([01] .* 4$|succeeded after cancel)",
        "canceled": "end canceled",
        "aborted": "end 9 .* 6$",
    },
    results={"short": [0, 1, 1, 2], "aborts": [0, 1, 1, 2]},
    second="runs both",
    own=(
        *(ENDS[order] for order in (202, 902, 1002)),
        *(UNADVERTISES, RELOADED, ENDS[402], ENDS[802], SUCCEEDS, RESTARTED, LATER),
        *(ENDS[502], CLOSES, CRASHES, LATER_CANCEL),
    ),
)
KINDS = (ROSBRIDGE,)
