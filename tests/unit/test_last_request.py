"""When a client closes, a server that had refused to cancel a goal is asked once more."""

from __future__ import annotations

import uuid
from typing import Any

import pytest

from actionkit import GoalState, Timeouts
from actionkit._calls.sending.last_request import LastRequest
from actionkit._goal.effects import AskCancel, Timer
from actionkit._goal.machine import Goal
from actionkit._goal.stages import CONFIRMED_AFTER, CancelReason
from actionkit._model.cancel_answer import CancelAnswer


class Attempt:
    """One with a goal that its caller gave up on, ten seconds ago."""

    def __init__(self) -> None:
        self.goal = Goal(uuid.uuid4(), Timeouts())
        self.goal.sent(0.0)
        self.goal.accepted(0.1)
        self.goal.give_up(CancelReason.DEADLINE, 1.0)
        self.asked = 0

    def refused(self, at: float) -> None:
        for now in (at, at + 2 * CONFIRMED_AFTER):
            self.goal.cancel_answered(CancelAnswer.REFUSED, now, asked_at=now)

    def left(self) -> Any:
        self.goal.timer(Timer.CANCEL, 3.0)
        return self

    def give_up(self, why: CancelReason) -> None:
        self.asked += AskCancel() in self.goal.give_up(why, 10.0)


@pytest.mark.parametrize("how", ["stops", "is refused again", "is lost"])
def test_its_answer_is_waited_for(how: str) -> None:
    attempt, request = Attempt(), LastRequest()
    attempt.refused(1.1)
    request.begin([attempt.left()])
    assert (attempt.asked, request.done()) == (1, False)
    attempt.goal.cancel_answered(CancelAnswer.REFUSED, 10.1, asked_at=10.0)
    request.look()
    assert not request.done()  # it is asked a second time, as always
    if how == "stops":
        attempt.goal.result(GoalState.CANCELED, None, 10.2, asked_at=10.0)
    elif how == "is refused again":
        attempt.refused(10.2)
    else:
        attempt.goal.server_lost("gone", 10.2)
    request.look()
    assert request.done()


def test_one_that_has_not_answered_yet_is_asked_and_not_waited_for() -> None:
    attempt, request = Attempt(), LastRequest()
    request.begin([attempt.left()])
    assert (attempt.asked, request.done()) == (1, True)
