"""A client and a server on two hosts, and what happens to goals if the network fails (C5.4)."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import pytest

from actionkit import Timeouts
from tests.faults import network, page
from tests.faults.lab import (
    ACCEPTED,
    BEFORE_ACCEPT,
    ENDS,
    FEEDBACK,
    NEVER_END,
    TIMEOUTS,
    Lab,
    at_once,
    executed,
    give_up,
    scripts,
    settle,
)
from tests.faults.table import Case, Row
from tests.hunting import REPEAT

_MANY = 100
_AT_A_TIME = 10


def test_nothing_gets_through_a_cable_that_is_cut(field):
    """Else the tests below would show nothing: by default there is shared memory, too."""
    server = field.serve("countdown", period=0.1)
    caller = field.caller()
    caller.call("goal", "no retries", 20.0)
    caller.wait_for_feedback("goal")
    field.cable.cut()
    server.wait_for("succeeded")
    caller.call("another", "no retries", 1.0)
    another = caller.seen("another", 10)
    assert another.error == "DeadlineExceededError"
    assert server.count("goal_received") == 1
    field.cable.mend()
    assert caller.seen("goal", 30).error == ""


@pytest.mark.parametrize("fault", [page.OUTAGE, page.LONG_OUTAGE])
@pytest.mark.long
def test_an_outage(fault, field):
    short = fault == page.OUTAGE
    server = field.serve("scripted", script=scripts(page.OUTAGE_PHASES))
    caller = field.caller(TIMEOUTS if short else replace(TIMEOUTS, server=30.0))
    lab = Lab(server, caller, page.OUTAGE_PHASES)
    lab.fill()
    struck = time.monotonic()
    field.cable.cut()
    lab.let_end(ENDS)
    for phase in [BEFORE_ACCEPT] if short else page.OUTAGE_PHASES:
        caller.seen(f"{phase}/no retries", 50)
    field.cable.mend()
    if not short:
        lab.see_stopped(ACCEPTED, FEEDBACK)
    server.release()
    lab.see_stopped(BEFORE_ACCEPT)
    seen = lab.seen()
    lab.still_works()
    page.record(lab.rows(fault, struck, seen))
    # The long outage swallows what resend="always" sends meanwhile.
    lab.close(watches=not short)


@pytest.mark.long
def test_goals_are_given_up_on_during_an_outage(field):
    server = field.serve("scripted", script=NEVER_END)
    caller = field.caller()
    cable = field.cable
    page.record(give_up(page.GIVEN_UP_OUTAGE, server, caller, cable.cut, cable.mend))
    assert not caller.close()


@pytest.mark.timeout(170)
@pytest.mark.parametrize("_", range(REPEAT))
@pytest.mark.long
def test_a_third_of_all_packets_is_lost(_, field, monkeypatch):
    network.skip_where_nothing_can_be_lost(field.cable)
    profiles = Path(__file__).parent / "heartbeats.xml"
    monkeypatch.setenv("FASTRTPS_DEFAULT_PROFILES_FILE", str(profiles))
    server = field.serve("fibonacci")
    caller = field.caller(Timeouts(server=30.0, accept=30.0))
    field.cable.lose(30)
    keys = [f"goal {number}" for number in range(_MANY)]
    seen = []
    for number, key in enumerate(keys):
        caller.call(key, "confirmed_stopped", 100.0)
        if number >= _AT_A_TIME:
            seen.append(caller.seen(keys[number - _AT_A_TIME], 110))
    seen += [caller.seen(key, 110) for key in keys[-_AT_A_TIME:]]
    assert {one.text for one in seen} == {""}
    left = settle(server)
    goals = [set(one.goals) for one in seen]
    events = server.events
    page.record(
        [
            Row(
                Case(page.LOSS, page.MANY, "confirmed_stopped"),
                f"{_MANY} results",
                None,
                executed=sum(executed(events, one) for one in goals),
                at_once=max(at_once(events, one) for one in goals),
                left=len(left),
            )
        ]
    )
    assert not caller.close()
