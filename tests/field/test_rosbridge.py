"""What rosbridge alone does with goals: its page sends any end, closes, crashes, and is reloaded.

The expected values come from what the page and rosbridge write.
"""

from __future__ import annotations

import re
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from actionkit import (
    ActionKitError,
    CancelReport,
    DeadlineExceededError,
    GoalAbortedError,
    GoalFuture,
    GoalNotReplacedError,
    GoalState,
    ResultLostError,
    RetryPolicy,
    ServerLostError,
    Timeouts,
    Verdict,
)
from tests.docs.snippets import ROOT, run_page
from tests.field.conftest import Field, start
from tests.field.kind import Kind, Server
from tests.field.kinds import rosbridge as rows
from tests.field.sources import SERVERS, upstream
from tests.rclpy_client import Driver
from tests.waiting import until

_GUIDE = ROOT / "docs" / "guides" / "web-pages.md"
on_rosbridge = pytest.mark.field(can=lambda kind: kind is rows.ROSBRIDGE)
SHORT = Timeouts(server=30.0, cancel=0.5)
NUMBERS = [0, 1, 1, 2]
"""The result of a page that takes two steps."""
CONNECTED = "Advertised action /fibonacci"
GONE = "Client disconnected"
_FAILED = "`GoalAbortedError`, or `ResultLostError`"
STUMBLED = "dictionary changed size during iteration"
"""rosbridge says so now and then, if a page advertises or unadvertises an action while goals run.

It aborts these goals, and does nothing else of what it was told.
"""


def ends(server: Server, count: int) -> dict[int, list[str]]:
    """Return what the page says of the ends of goals, by the goals' orders.

    Args:
        server: The page's.
        count: How many there are. What the page writes may come later than what it sends.
    """
    if count:
        server.wait_for_text("end .* action_goal", count)
    orders: dict[str, int] = {}
    ended: dict[int, list[str]] = {}
    for line in server.lines:
        if got := re.search(r"got send_action_goal (\S+) \{'order': (\d+)\}", line):
            orders[got[1]] = int(got[2])
        elif end := re.search(r"end (.*) (action_goal:\S+)(.*)", line):
            ended.setdefault(orders[end[2]], []).append(end[1] + end[3])
    return ended


def reload(server: Server) -> None:
    """Reload the page; twice, if rosbridge stumbles."""
    server.tell("kill page")
    server.wait_for_text(GONE)
    server.tell("start page")
    server.wait_for_text(f"{STUMBLED}|{CONNECTED}", 2)
    if any(STUMBLED in line for line in server.lines):
        server.tell("kill page")
        server.wait_for_text(GONE, 2)
        server.tell("start page")
        server.wait_for_text(CONNECTED, 2)


def said(future: GoalFuture[Any, Any]) -> str:
    """Wait for the end of a call, and return what it says, as the table does."""
    with suppress(ActionKitError):
        future.result()
    outcome = future.outcome()
    what = "the result" if outcome.ok else f"`{type(outcome.error).__name__}`"
    if future.known_to_run is False:
        return what
    assert (future.known_to_run, outcome.cancel) == (True, CancelReport.UNKNOWN)
    assert outcome.ok or "MAY STILL BE RUNNING" in str(outcome.error)
    return f"{what}, may still run"


@on_rosbridge
def test_a_page_ends_goals_in_each_way(field: Field) -> None:
    client = field.another_client(timeouts=replace(SHORT, result=3.0))
    orders = (202, 402, 502, 802, 902, 1002)
    calls = {order: client.call_async({"order": order}, timeout=20.0) for order in orders}
    field.server.wait_for_text("invalid transition .* with event CANCELED")
    field.server.wait_for_text("does not have a field nothing")
    calls[502].cancel()
    for order, what in rows.ENDS.items():
        field.told(what, said(calls[order]) if order != 402 else _FAILED)
    ended = {202: "2 5", 402: "4 4", 502: "5 4", 802: "8 4", 902: "9 6", 1002: "10 0"}
    assert ends(field.server, len(orders)) == {order: [end] for order, end in ended.items()}
    for order in (202, 902, 1002):
        error = calls[order].outcome().error
        assert isinstance(error, GoalAbortedError)
        assert list(error.result.sequence) == NUMBERS
    # rosbridge drops what comes with a false result, and may never send one.
    error = calls[402].outcome().error
    assert isinstance(error, (GoalAbortedError, ResultLostError))
    assert said(calls[402]) in _FAILED
    assert error.result is None or not list(error.result.sequence)
    assert list(calls[802].result().sequence) == NUMBERS
    # rosbridge drops a result of another type, and its goal never ends.
    assert said(calls[502]) == "`DeadlineExceededError`, may still run"
    assert field.server.count("executing") == len(orders)  # nothing is sent twice


@on_rosbridge
def test_a_page_succeeds_though_it_was_asked_to_cancel(field: Field) -> None:
    future = field.client.call_async({"order": 344}, timeout=20.0)
    field.server.wait_for("executing")
    future.cancel()
    field.told(rows.SUCCEEDS, said(future))
    assert ends(field.server, 1) == {344: ["succeeded after cancel"]}
    assert future.outcome().status is GoalState.SUCCEEDED


@on_rosbridge
@pytest.mark.parametrize("how", [rows.CLOSES, rows.CRASHES], ids=["closes", "crashes"])
def test_a_goal_of_a_page_that_is_gone_may_run(how: str, field: Field) -> None:
    """rosbridge keeps the goal as running, and takes each further one, which nobody hears of."""
    client = field.another_client(timeouts=SHORT)
    future = client.call_async({"order": 602 if how == rows.CLOSES else 44}, timeout=60.0)
    field.server.wait_for("executing")
    if how == rows.CRASHES:
        field.server.tell("kill page")
    field.server.wait_for_text(GONE)
    further = client.call_async({"order": 2}, timeout=60.0)
    further.wait_accepted()
    assert not future.done()
    future.cancel()
    further.cancel()
    assert isinstance(future.outcome().error, DeadlineExceededError)
    field.told(how, said(future))
    assert said(further) == said(future) == "`DeadlineExceededError`, may still run"
    assert ends(field.server, 0) == {}
    assert field.server.count("executing") == 1


@on_rosbridge
def test_an_action_that_is_unadvertised_takes_goals_and_never_ends_them(field: Field) -> None:
    client = field.another_client(timeouts=SHORT)
    aborted = client.call_async({"order": 702}, timeout=20.0)
    field.told(rows.UNADVERTISES, said(aborted))
    assert isinstance(aborted.outcome().error, GoalAbortedError)
    field.server.wait_for_text(f"Unadvertised action|{STUMBLED}")
    further = client.call_async({"order": 2}, timeout=60.0)
    if any(STUMBLED in line for line in field.server.lines):  # then it is still advertised
        assert further.outcome().ok
    else:
        # It drops two messages of feedback, and the result.
        field.server.wait_for_text("has not been advertised via rosbridge", 3)
        further.cancel()
        assert said(further) == "`DeadlineExceededError`, may still run"
    assert ends(field.server, 1) == {2: ["0 4"]}


@on_rosbridge
def test_a_page_that_is_reloaded(field: Field, caplog: pytest.LogCaptureFixture) -> None:
    """rosbridge keeps the old page's server beside the new one's, until it is started again."""
    server = field.server
    client = field.another_client(timeouts=SHORT, retry=RetryPolicy(attempts=2, initial=0.05))
    interrupted = client.call_async({"order": 44}, timeout=60.0)
    server.wait_for("executing")
    reload(server)
    server.wait_for_text("Goal state not set, assuming aborted")
    field.told(rows.RELOADED, said(interrupted))
    assert isinstance(interrupted.outcome().error, GoalAbortedError)
    assert until(lambda: "they are in one process: start it again" in caplog.text)
    assert ends(server, 0) == {}

    works = client.call_async({"order": 2}, timeout=20.0)
    assert list(works.result().sequence) == NUMBERS
    aborts = client.call_async({"order": 902}, timeout=20.0, classify=lambda _: Verdict.TRANSIENT)
    assert said(aborts) == "`GoalAbortedError`, may still run"
    cancelled = client.call_async({"order": 44}, timeout=60.0)
    server.wait_for("executing", 4)
    replaces = client.call_async({"order": 4}, timeout=20.0, replaces=cancelled)
    field.told(rows.LATER_CANCEL, said(cancelled))
    assert isinstance(cancelled.outcome().error, DeadlineExceededError)
    assert isinstance(replaces.outcome().error, GoalNotReplacedError)
    assert ends(server, 3) == {2: ["0 4"], 902: ["9 6"], 44: ["canceled"]}
    assert server.count("executing") == 4  # none was sent twice, and the last one not at all
    # The old server accepted all of them, and says that they run.
    field.told(rows.LATER, said(works))
    ids = [call.goal_id for call in (works, aborts, cancelled)]
    assert client.cancel_everything(1.0) == dict.fromkeys(ids, CancelReport.UNKNOWN)
    # It looks for three seconds, and on a busy machine a server may be seen later.
    assert until(lambda: "2 servers in one process" in field.command("doctor", "/fibonacci").out)

    lost = client.call_async({"order": 44}, timeout=60.0)
    server.wait_for("executing", 5)
    server.kill()
    server.start()
    assert isinstance(lost.outcome().error, ServerLostError)
    again = client.call_async({"order": 2}, timeout=40.0)
    assert list(again.result().sequence) == NUMBERS
    field.told(rows.RESTARTED, said(again))
    assert server.count("executing") == 6


@on_rosbridge
def test_the_guide(field: Field, tmp_path: Path) -> None:
    run_page(_GUIDE, tmp_path)
    field.server.wait_for("succeeded")


_TWO = """
import os, runpy, sys, threading
threading.Thread(target=lambda: (sys.stdin.read(), os._exit(0)), daemon=True).start()
sys.argv[:] = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")
"""


def two_servers() -> Path:
    """Return the script of the stand-in."""
    upstream()
    return SERVERS / "two_srv.py"


@pytest.mark.parametrize("nodes", ["same", "other"])
def test_what_one_of_two_servers_has_ended_may_run_on_the_other(
    nodes: str, ros_domain: int
) -> None:
    """As after a reload: another client has sent the goal, and has not cancelled it."""
    kind = Kind(
        name="two servers in one process",
        program=lambda: ("-c", _TWO, str(two_servers()), nodes),
        goals={},
        log={"executing": "ghost runs", "succeeded": "good succeeded", "canceled": "canceled"},
        second="runs both",
    )
    with ExitStack() as stack:
        server = start(kind)
        stack.callback(server.close)
        field = Field(server, kind, stack, lambda *_: None)
        client = field.another_client(timeouts=SHORT)
        driver = Driver(ros_domain).connect()
        stack.callback(driver.close)
        assert until(lambda: len(driver.servers()) == 2)
        goal_id, _ = driver.accepted(1)
        server.wait_for("executing")
        server.wait_for("succeeded")

        attached = client.attach(goal_id, timeout=20.0)
        assert attached.outcome().cancel is CancelReport.UNKNOWN
        assert attached.known_to_run is not False
        watched = field.command("watch", "/fibonacci", "--once")
        assert goal_id in watched.out
        assert "EXECUTING" in watched.out, watched
        stopped = field.command("stop", "/fibonacci", "--timeout", "1")
        assert stopped.code == 23, stopped
        assert "IT MAY STILL BE RUNNING" in stopped.out
