"""Goals that may outlive the process: another one goes on cancelling them.

A host gives a process four seconds. A server that hangs for longer, or stands still in a debugger,
has not heard by then; and what it was sent is gone with the sender, where both share memory.
"""

from __future__ import annotations

import subprocess
import sys

from actionkit.agents._toolbox import Toolbox

_PATIENCE = "60"
"""Seconds for the server to come back to itself."""


def go_on_cancelling(toolbox: Toolbox) -> list[str]:
    """Have the goals cancelled that may still run, by a process of its own that outlives this.

    Returns:
        A line for people on each.
    """
    by_action: dict[str, list[str]] = {}
    told = []
    for goal in toolbox.goals():
        goal_id, tool = goal["goal_id"], goal["tool"]
        if goal["may_still_run"] and goal_id is not None:
            action = toolbox.action_of(tool)
            by_action.setdefault(action, []).append(goal_id)
            told.append(
                f"goal {goal_id} of {action} may still be running; another process goes on"
                f" cancelling it for {_PATIENCE} seconds"
            )
    for action, ids in by_action.items():
        subprocess.Popen(
            [
                *(sys.executable, "-m", "actionkit", "cancel", action, *ids),
                *("--timeout", _PATIENCE, "--server-timeout", _PATIENCE),
            ],
            # The host may wait for the end of all who have its pipes, or kill our whole group.
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
    return told
