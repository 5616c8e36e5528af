"""The interpreter's exit waits only once for each cancellation (C2.5)."""

from __future__ import annotations

import time
from typing import Any, cast

import pytest

from actionkit._calls.ending import exit as _exit
from actionkit._calls.ending.closing import await_ends
from actionkit._calls.futures.future import GoalFuture
from actionkit._calls.sending.last_request import LastRequest

GRACE = 0.5


class GoalFutureNeverOver(GoalFuture[Any, Any]):
    """The future of a call that does not end."""

    def __init__(self) -> None:
        self.waits = 0

    def __del__(self) -> None:
        pass

    def done(self) -> bool:
        return False

    def _wait_until_over(self, seconds: float) -> bool:
        self.waits += 1
        return False


class FakeSession:
    """One with goals that are not confirmed; it takes note until when it is waited for."""

    confirmed_at = 0.0

    def __init__(self, given_up_at: float) -> None:
        self.given_up_at = given_up_at
        self.waited_until: list[float] = []

    def await_freed(self, until: float) -> bool:
        self.waited_until.append(until)
        return True


@pytest.mark.parametrize("ago", [0.0, 100.0])
def test_goals_that_were_waited_for_in_vain_are_not_waited_for_again(
    ago: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_exit, "end_calls", lambda sessions: GRACE)
    began = time.monotonic()
    session = FakeSession(began - ago)
    _exit._close_sessions(cast(Any, [session]))
    assert session.waited_until == ([] if ago else [began + GRACE])


def test_the_last_request_gives_no_second_wait() -> None:
    """Only a call that ends shows that others may end, too."""
    never, request = GoalFutureNeverOver(), LastRequest()
    request.drop()
    await_ends([never, request], GRACE)
    assert never.waits == 1
