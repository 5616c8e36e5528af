"""Nav2's `SimpleActionServer`, which nearly all of its servers are made of."""

from __future__ import annotations

from collections.abc import Sequence

from tests.field import native
from tests.field.kind import Goal, Kind

ABORTS = {"order": 4005}
RETURNS = {"order": 2003}
"""Its work returns without having ended the goal."""
RAISES = {"order": 7002}
WORKS = {"order": 7015}
"""Its work looks at nothing for 1.5 s, not even at the server."""
TERMINATED = [-1]
"""The result with which the command `terminate_all` ends goals."""

DEACTIVATED = "deactivated in the middle of a goal"
RETURNED = "its work returns without ending the goal"
RAISED = "an exception in its work"
ENDED_OUTSIDE = "`terminate_all` from outside, and its work goes on"
REFUSED = "its work refuses to be preempted"
THREE = "two goals come while it is busy with one"
WAITED = "a goal is cancelled that waits while it is busy"
BOTH_END = "a goal is cancelled that waits to preempt another"
CROSSED = "a goal is cancelled, and another preempts it first"
DESTROYED = "destroyed in the middle of a goal"


def looks_at_nothing(tenths: int) -> Goal:
    """Return a goal with work that heeds no cancel, and no other goal, until it has succeeded."""
    return {"order": 5000 + tenths}


def refuses_preemption(tenths: int) -> Goal:
    """Return a goal with work that aborts what is to preempt it."""
    return {"order": 6000 + tenths}


def _nav2(name: str, kind: str, *own: str) -> Kind:
    def program() -> Sequence[str]:
        return native.program(kind)

    return Kind(
        name=f"Nav2, {name}",
        program=program,
        goals={
            "short": {"order": 4},
            "long": {"order": 120},
            "aborts": ABORTS,
            "ignores": {"order": 1040},
        },
        log={
            "executing": "SRV (execute|preempted by) ",
            "cancel_requested": "Received request for goal cancellation",
            "canceled": "Client requested to cancel the goal",
            # The second of a goal that another one preempts.
            "aborted": "Aborting handle|Cancelling the previous goal",
            "succeeded": "Setting succeed on current goal",
            "rejected": "Rejecting the goal",
            "raised": "failed while executing action callback",
            "work_done": "SRV succeeded_current",  # also if the goal has ended before
        },
        results={"short": [0, 1, 1, 2, 3], "aborts": [-7, 103]},
        second="preempts",
        own=own,
    )


SHARED = _nav2("`SimpleActionServer`", "nav", DESTROYED)
OWN_THREAD = _nav2(
    "the same with `spin_thread`",
    "navspin",
    *(DEACTIVATED, RETURNED, RAISED, ENDED_OUTSIDE, REFUSED, THREE, WAITED, BOTH_END, CROSSED),
    DESTROYED,
)
KINDS = (SHARED, OWN_THREAD)
