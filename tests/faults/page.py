"""What docs/faults.md says around its tables, and which rows there have to be."""

from __future__ import annotations

from tests.faults.lab import (
    ACCEPTED,
    BEFORE_ACCEPT,
    CANCEL,
    DEADLINE,
    ENDS,
    FEEDBACK,
    PHASES,
    POLICIES,
    TIMEOUTS,
)
from tests.faults.table import PATH, Case, Row, render

KILL = "SIGKILL"
KILL_RESTART = "SIGKILL, restart"
TERM = "SIGTERM"
TERM_RESTART = "SIGTERM, restart"
STOP = "SIGSTOP, SIGCONT"
STOP_LIVENESS = "SIGSTOP, SIGCONT, with liveness"
OUTAGE = "Network outage, shorter than the lease"
LONG_OUTAGE = "Network outage, longer than the lease"
GIVEN_UP_STOPPED = "Given up on, while the server is stopped"
GIVEN_UP_OUTAGE = "Given up on, during a network outage"
LOSS = "30 % of all packets lost"
TWINS = "Two servers on one name"
OTHER_TYPE = "Another type on the name"

#: The phases in which an outage strikes: a goal can end, and its result be lost on the way.
OUTAGE_PHASES = (ENDS, ACCEPTED, FEEDBACK, BEFORE_ACCEPT)
OTHER_PHASES = (ACCEPTED, FEEDBACK, BEFORE_ACCEPT)
MANY = "100 goals, 10 at a time"
ONE_GOAL = "one goal"

#: What is done, by fault, in the order of the page.
EXPLAINED = {
    KILL: "The server's process is killed, and no other is started until all calls have ended.",
    KILL_RESTART: """
The server's process is killed and started again at once, under the same names. For some 20 s
the middleware shows both. Here the client has `Timeouts(accept=40.0)`: with less, a goal that was
not accepted may have its `AcceptanceTimeoutError` sooner.""",
    TERM: """
The server's process is asked to end, and does so properly, its goals unfinished; no other is
started until all calls have ended.""",
    TERM_RESTART: "The same, and the server is started again at once.",
    STOP: """
The server's process is stopped, as by a debugger or a machine that hangs, until the calls whose
goals it has not accepted have given up. To everybody outside, a server that is busy in its only
thread looks just like this: that is why nobody is taken for lost.""",
    STOP_LIVENESS: """
The same, by a client with `Timeouts(liveness=1.0)`, until all calls that take the server for lost
have noticed.""",
    OUTAGE: """
Client and server on two hosts (network namespaces, joined by a virtual cable). The link between
them goes down, and comes up again when the calls whose goals were not accepted have given up.
Some goals end on the server while the link is down.""",
    LONG_OUTAGE: """
The same, but the link comes up again only when the client has dropped the server. The server
knows nothing of it: its goals run on, until the client is back, which cancels those that it has
given up on. Here the client has `Timeouts(server=30.0)`, so that a second attempt outlasts the
outage.""",
    GIVEN_UP_STOPPED: """
While the server is stopped (SIGSTOP) a goal is given up on. When the server goes on, the goal is
cancelled, though its call has long ended.""",
    GIVEN_UP_OUTAGE: "The same, with the link between two hosts down, and up again.",
    LOSS: """
Two hosts; each drops 30 % of the packets that come in, at random. 100 goals, 10 at a time, with
one client; the row is about all of them. DDS asks for what was lost every 3 s, which makes this
slow; here it does so ten times a second (`tests/faults/heartbeats.xml`).""",
    TWINS: """
Two servers serve one name, which ROS lets them. Both execute each goal, and ROS has no way to
send it to one alone: the first answer counts, and the other server is told to cancel.""",
    OTHER_TYPE: """
The server ends properly with a goal in flight, and a server of another type takes the name; a
server of the right type comes back only when all calls have ended.""",
}

INTRO = f"""
# Faults, and what comes of them

This page is written by the tests in `tests/faults/`, which do what it tells of with real
processes, real signals and real networks, and fail where it is no longer so
(`ACTIONKIT_WRITE_FAULTS=1 pytest -n 0 tests/faults` writes it anew). What the words mean, and
which setting changes what, is told in [Losing the server](losing-the-server.md). What becomes of
very many goals at once is in the [table of attacks](attacks.md).

The client's timeouts are `server={TIMEOUTS.server:g}`, `accept={TIMEOUTS.accept:g}`,
`cancel={TIMEOUTS.cancel:g}` and `result={TIMEOUTS.result:g}` seconds; the calls have no deadline of
their own. The policy is "no retries" (`RetryPolicy.none()`) or the `resend=` of a `RetryPolicy`
with three attempts; the default is `confirmed_stopped`.

- **phase**: how far the goal was when the fault struck. "Ended, no result yet": the goal has
  ended, the client knows so, and the server has not sent the result.
- **outcome**: what the call came to. "goal UNKNOWN": what the error's `cancel` says of the goal.
  "goal varies": one run knows that the earlier goal has ended, and another does not.
- **noticed after**: from the fault until the client knew, in its timeline. No run may take
  longer. "-": there was nothing that it had to notice.
- **executed**: how many goals of the call began to execute, those cut short by the fault included.
- **at one time**: the most of them that executed at one time. More than one only where `always`
  says so, with two servers, and with `server_gone` where a server was only out of reach.
- **left running**: goals that nobody waits for, still running at the end, when a server is there
  again. Always 0.
"""


def cases() -> list[Case]:
    """All rows that there have to be, in order."""
    found = []
    for fault in EXPLAINED:
        for phase, policies in _PHASES.get(fault, dict.fromkeys(PHASES, POLICIES)).items():
            found += [Case(fault, phase, policy) for policy in policies]
    return found


_PHASES = {
    OUTAGE: dict.fromkeys(OUTAGE_PHASES, POLICIES),
    LONG_OUTAGE: dict.fromkeys(OUTAGE_PHASES, POLICIES),
    GIVEN_UP_STOPPED: dict.fromkeys((DEADLINE, CANCEL), ("confirmed_stopped",)),
    GIVEN_UP_OUTAGE: dict.fromkeys((DEADLINE, CANCEL), ("confirmed_stopped",)),
    LOSS: {MANY: ("confirmed_stopped",)},
    TWINS: {ONE_GOAL: POLICIES},
    OTHER_TYPE: dict.fromkeys(OTHER_PHASES, POLICIES),
}


def write(rows: list[Row]) -> str:
    """Write the page where every row is there; return what became of it."""
    by_case = {row.case: row for row in rows}
    missing = dict.fromkeys(case.fault for case in cases() if case not in by_case)
    if missing:
        return f"not written; rows are missing of: {'; '.join(missing)}"
    PATH.write_text(render(INTRO, EXPLAINED, [by_case[case] for case in cases()]))
    return f"written, {len(by_case)} rows"
