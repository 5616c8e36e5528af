"""The waits of a goal on a reference server, without a server."""

from __future__ import annotations

import threading
from typing import Any

import pytest

from actionkit.servers._run import Control, Run


class Silent:
    """A journal that nobody reads, and messages that nobody makes."""

    lock = threading.RLock()

    def emit(self, event: str, goal_id: str | None = None, **details: Any) -> None: ...
    def result(self, content: Any) -> Any: ...
    def feedback(self, content: Any) -> Any: ...


@pytest.fixture
def run() -> Run:
    silent = Silent()
    return Run(None, "a", server=0, number=0, journal=silent, control=Control(), make=silent)


def test_a_result_request_ends_its_wait(run: Run) -> None:
    run.request_result()
    assert not run.wait_result_request()


def test_a_cancel_counts_though_the_result_was_asked_for_before_the_goal_woke(run: Run) -> None:
    run.cancel()
    run.request_result()
    assert run.wait_result_request()
