"""The part of a future that shows its goal at any time, without waiting."""

from __future__ import annotations

import uuid
from typing import Generic

from actionkit._calls.futures.call_view import CallView
from actionkit._calls.futures.feedback_broadcast import FeedbackBroadcast, FeedbackStream
from actionkit._model.action_type import FeedbackT
from actionkit._model.values import GoalState, Timeline


class LiveGoal(Generic[FeedbackT]):
    """The read-only part of a `GoalFuture`."""

    _call: CallView
    _feedback: FeedbackBroadcast[FeedbackT]

    @property
    def goal_id(self) -> uuid.UUID:
        """The id of the current goal; each attempt has its own id."""
        return self._call.goal_id

    @property
    def state(self) -> GoalState:
        """The last known state of the goal."""
        return self._call.state

    @property
    def known_to_run(self) -> bool | None:
        """Whether a goal of this call runs on a server, if that is known now.

        `True`: a server has the goal and has not ended it. `False`: no goal of the call runs; none
        was sent, or each has ended. `None`: this is not known. The server has not answered or is
        gone, or the client was closed and let the goal run.

        The value stays up to date after the future is done. If the call gave up on a goal, the
        client watches that goal until it has ended, while the client is open.
        """
        return self._call.goals.known_to_run

    @property
    def timeline(self) -> Timeline:
        """The events so far, oldest first."""
        return self._call.timeline.events()

    @property
    def latest_feedback(self) -> FeedbackT | None:
        """The newest feedback message, or `None`."""
        return self._feedback.latest

    def feedback(self) -> FeedbackStream[FeedbackT]:
        """Return an iterable over feedback, for `for` and `async for`.

        It begins with the newest message, and ends when the goal ends. A reader that falls far
        behind misses the oldest messages.
        """
        return self._feedback.stream()
