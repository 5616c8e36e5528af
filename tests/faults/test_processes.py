"""A server process that is killed, ended or stopped, in every phase of a goal (C5.1-C5.3, C5.5)."""

from __future__ import annotations

import time
from dataclasses import replace

import pytest

from actionkit._ros.servers_in_sight.monitor import _IN_SIGHT_WITHIN
from tests.conftest import NEVER
from tests.faults import page
from tests.faults.lab import (
    ACCEPTED,
    BEFORE_ACCEPT,
    FEEDBACK,
    NEVER_END,
    PHASES,
    TIMEOUTS,
    Lab,
    give_up,
    scripts,
)

pytestmark = pytest.mark.long


@pytest.fixture
def make_lab(action_server, make_caller):
    def make(timeouts=TIMEOUTS):
        server = action_server("scripted", script=scripts(PHASES))
        caller = make_caller(timeouts)
        assert caller.client.wait_for_server(10)
        lab = Lab(server, caller)
        lab.fill()
        return lab

    return make


@pytest.mark.parametrize(
    ("fault", "end", "back"),
    [
        (page.KILL, "kill", False),
        (page.KILL_RESTART, "kill", True),
        (page.TERM, "terminate", False),
        (page.TERM_RESTART, "terminate", True),
    ],
)
def test_a_server_that_ends(fault, end, back, make_lab):
    patient = replace(TIMEOUTS, accept=40.0)
    lab = make_lab(patient if fault == page.KILL_RESTART else TIMEOUTS)
    struck = time.monotonic()
    getattr(lab.server, end)()
    if back:
        # A fork can come into sight faster than a server in real life, and would count as one that
        # the latest goals were sent to, too.
        NEVER.wait(_IN_SIGHT_WITHIN)
        lab.server.restart()
    seen = lab.seen()
    if not back:
        lab.server.restart()
    lab.still_works()
    page.record(lab.rows(fault, struck, seen))
    lab.close()


@pytest.mark.parametrize(("fault", "liveness"), [(page.STOP, None), (page.STOP_LIVENESS, 1.0)])
def test_a_server_that_is_stopped_for_a_while(fault, liveness, make_lab):
    lab = make_lab(replace(TIMEOUTS, liveness=liveness))
    struck = time.monotonic()
    lab.server.pause()
    for key in lab.keys:
        if key == f"{BEFORE_ACCEPT}/no retries" or (liveness and key.endswith("/no retries")):
            lab.caller.seen(key, 30)
    lab.server.resume()
    if liveness:
        lab.see_stopped(ACCEPTED, FEEDBACK)
    lab.server.release()
    lab.see_stopped(BEFORE_ACCEPT)
    seen = lab.seen()
    lab.still_works()
    page.record(lab.rows(fault, struck, seen))
    lab.close()


def test_goals_are_given_up_on_while_their_server_is_stopped(action_server, make_caller):
    server = action_server("scripted", script=NEVER_END)
    caller = make_caller()
    assert caller.client.wait_for_server(10)
    page.record(give_up(page.GIVEN_UP_STOPPED, server, caller, server.pause, server.resume))
    assert not caller.close()
