"""Decodes the answers to cancel requests."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from action_msgs.srv import CancelGoal

from actionkit._model.cancel_answer import CancelAnswer


def cancel_answer(response: Any, goal_id: bytes, canceling: Collection[bytes]) -> CancelAnswer:
    """Return what a `CancelGoal` response says about one goal.

    `canceling` has the ids from the response's list of goals that are being cancelled now.
    """
    if goal_id in canceling:
        return CancelAnswer.ACCEPTED
    if response.return_code == CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID:
        return CancelAnswer.UNKNOWN_GOAL
    if response.return_code == CancelGoal.Response.ERROR_GOAL_TERMINATED:
        return CancelAnswer.TERMINATED
    # rclpy's servers refuse with the code for "no error" and a list without the goal (R12).
    return CancelAnswer.REFUSED
