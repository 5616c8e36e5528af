"""Two servers on one name, and a name that a server of another type takes over (C5.6)."""

from __future__ import annotations

import time
from dataclasses import replace

import pytest

from actionkit import servers
from tests.faults import page
from tests.faults.lab import ACCEPTED, POLICIES, TIMEOUTS, Lab, at_once, executed, scripts, settle
from tests.faults.table import Case, Row

pytestmark = pytest.mark.long


def test_two_servers_on_one_name(action_server, make_caller):
    server = action_server("twins", gate=1)
    caller = make_caller()
    assert caller.client.wait_for_server(10)
    rows = []
    for count, policy in enumerate(POLICIES, 1):
        caller.call(policy, policy)
        server.wait_for("executing", count=2 * count)
        # The first answers; the other goes on, and has to be told to stop.
        server.release(1)
        seen = caller.seen(policy, 20)
        server.wait_for("canceled", count=count)
        goals = set(seen.goals)
        rows.append(
            Row(
                Case(page.TWINS, page.ONE_GOAL, policy),
                seen.outcome,
                seen.noticed(0.0),
                executed=executed(server.events, goals),
                at_once=at_once(server.events, goals),
                left=len(settle(server)),
            )
        )
    page.record(rows)
    assert not caller.close()


def test_another_type_takes_the_name(action_server, make_caller, ros_domain):
    lab = Lab(
        action_server("scripted", script=scripts(page.OTHER_PHASES)),
        make_caller(replace(TIMEOUTS, server=30.0)),
        page.OTHER_PHASES,
    )
    assert lab.caller.client.wait_for_server(10)
    lab.fill()
    struck = time.monotonic()
    lab.server.terminate()
    with servers.start("wrong_type", domain_id=ros_domain) as other:
        seen = lab.seen()
        assert other.count("goal_received") == 0
    # It is not to be told that nothing was sent.
    assert "attempt 2 sent nothing" in seen[f"{ACCEPTED}/server_gone"].text
    lab.server.restart()
    lab.still_works()
    page.record(lab.rows(page.OTHER_TYPE, struck, seen))
    lab.close()
