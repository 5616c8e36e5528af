"""The waits of a goal on a reference server, without a server."""

from __future__ import annotations

import threading
from typing import Any

import pytest

from actionkit.servers._run import Control, GoalStopped, Run


class Silent:
    """A journal that nobody reads."""

    lock = threading.RLock()

    def emit(self, event: str, goal_id: str | None = None, **details: Any) -> None: ...


@pytest.fixture
def run() -> Run:
    return Run(
        None,
        "a",
        server=0,
        number=0,
        order=0,
        journal=Silent(),
        control=Control(),
        make_message=lambda part, content: None,
    )


def test_a_result_request_ends_its_wait(run: Run) -> None:
    run.request_result()
    run.wait_result_request()


def test_a_cancel_counts_though_the_result_was_asked_for_before_the_goal_woke(run: Run) -> None:
    run.cancel()
    run.request_result()
    with pytest.raises(GoalStopped):
        run.wait_result_request()


def test_a_goal_that_heeds_no_cancel_is_stopped_by_none(run: Run) -> None:
    run.heeds_cancel = False
    run.cancel()
    run.pause(0)
    run.heeds_cancel = True
    with pytest.raises(GoalStopped):
        run.pause(0)
