"""Where the rows of docs/awaiting.md come together, and are compared with those written there.

With `ACTIONKIT_WRITE_AWAITING=1` in the environment the page is written, in one process (`-n 0`);
only those rows change that were tried.
"""

from __future__ import annotations

import os
from collections.abc import Callable

import pytest

from actionkit import CancelReport, Client, GoalFuture
from actionkit.servers import Server
from tests.awaiting import table
from tests.awaiting.page import FORMS
from tests.awaiting.table import Form, Row

_ROWS: pytest.StashKey[list[Row]] = pytest.StashKey()
WRITING = os.environ.get("ACTIONKIT_WRITE_AWAITING") == "1"

CONFIRMED = "cancelled, and confirmed before the wait ended"
CANCELLED = "cancelled"
NOTHING = "nothing: the goal goes on"


@pytest.fixture
def record(request: pytest.FixtureRequest) -> Callable[[Form, str, str], None]:
    """Take a row, and compare it with the page."""
    rows = request.config.stash.setdefault(_ROWS, [])

    def take(form: Form, works: str, reached: str) -> None:
        assert form in FORMS
        row = Row(form, works, reached)
        rows.append(row)
        if not WRITING:
            written = table.read(table.PATH.read_text()).get(form)
            assert row == written, f"not as docs/awaiting.md says: {row.line}"

    return take


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    if WRITING:
        rows = config.stash.get(_ROWS, [])
        known = table.PATH.read_text() if table.PATH.exists() else ""
        table.PATH.write_text(table.merge(rows, known))
        terminalreporter.section("docs/awaiting.md")
        terminalreporter.write_line(f"written, {len(rows)} rows of them new")


@pytest.fixture
def server(action_server) -> Server:
    """A server whose goals last 0.3 s for each number."""
    return action_server("fibonacci", period=0.3)


QUICK, LONG = {"order": 1}, {"order": 100}


@pytest.fixture
def client(server, make_client) -> Client:
    """A client that knows the server."""
    client = make_client()
    assert client.wait_for_server(20)
    return client


@pytest.fixture
def begun(server, client) -> GoalFuture:
    """A goal that runs for longer than any test."""
    future = client.call_async(LONG)
    server.wait_for("executing")
    return future


def reached(server: Server, client: Client, future: GoalFuture) -> str:
    """Return what the server has heard of, by its own journal, when a wait has just ended."""
    if future.done():
        assert future.outcome(0).cancel is CancelReport.CONFIRMED
        server.wait_for("canceled", goal_id=str(future.goal_id))
        return CONFIRMED
    # Another goal is cancelled: when that has come, so has every request that was sent before it.
    later = client.call_async(LONG)
    server.wait_for("executing", goal_id=str(later.goal_id))
    later.cancel()
    server.wait_for("canceled", goal_id=str(later.goal_id))
    asked = [event for event in server.events if event.event == "cancel_requested"]
    if any(event.goal_id == str(future.goal_id) for event in asked):
        server.wait_for("canceled", goal_id=str(future.goal_id))
        return CANCELLED
    assert str(future.goal_id) in server.running()
    future.cancel()
    server.wait_for("canceled", goal_id=str(future.goal_id))
    return NOTHING
