"""A picture of a real run, with retries and a crash of the server (contract C6.3).

With ACTIONKIT_WRITE_PICTURES=1 in the environment the picture, and the log that it shows, are
written into docs/pictures/. Without, the picture there must have the structure of this run's.
"""

from __future__ import annotations

import os
import shutil
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from actionkit import GoalState, JsonLines, Outcome, RetryPolicy, Timeouts, Verdict
from actionkit.cli._app import app

PICTURES = Path(__file__).resolve().parent.parent / "docs" / "pictures"
NAME = "retry_and_crash"
SVG = "{http://www.w3.org/2000/svg}"
LONG = {"feedback": 100, "period": 0.1}
SHORT = {"feedback": 6, "period": 0.1}
# One for each goal that the server gets, in turn.
SCRIPT: list[Any] = [
    [SHORT],
    ["reject"],
    [SHORT, {"abort": [9]}],
    [SHORT, {"abort": [7]}],
    [SHORT],  # the second attempt of the one before
    [LONG],  # until its deadline
    [LONG],  # until its caller cancels
    [LONG],  # until the crash
    [{"feedback": 15, "period": 0.1}, {"restart": "kill"}],
    [SHORT],  # what was lost, once more
]


def try_aborted_again(outcome: Outcome[Any]) -> Verdict:
    if outcome.status is GoalState.ABORTED:
        return Verdict.TRANSIENT
    return Verdict.SUCCESS if outcome.error is None else Verdict.PERMANENT


@pytest.fixture
def log(action_server, make_client, tmp_path) -> Path:
    """The log of a run in which much goes wrong."""
    path = tmp_path / f"{NAME}.jsonl"
    observer = JsonLines(path)
    client = make_client(
        observers=[observer],
        timeouts=Timeouts(server=30.0, liveness=1.0),
        retry=RetryPolicy(initial=0.3, jitter=0.0, resend="server_gone"),
    )
    early = client.call_async({"order": 1})
    server = action_server("scripted", script=SCRIPT)
    assert early.outcome(30).ok
    assert client.call_async({"order": 2}).outcome(20).status is GoalState.REJECTED
    assert client.call_async({"order": 3}).outcome(20).status is GoalState.ABORTED
    again = client.call_async({"order": 4}, classify=try_aborted_again)
    assert again.outcome(30).ok
    late = client.call_async({"order": 5}, timeout=1.5)
    server.wait_for("executing", goal_id=str(late.goal_id))
    unwanted = client.call_async({"order": 6})
    server.wait_for("executing", goal_id=str(unwanted.goal_id))
    lost = [client.call_async({"order": 7})]
    server.wait_for("feedback", goal_id=str(unwanted.goal_id), count=5)
    unwanted.cancel()
    assert unwanted.outcome(10).status is GoalState.CANCELED
    assert late.outcome(10).status is GoalState.CANCELED
    lost.append(client.call_async({"order": 8}))
    assert [each.outcome(60).ok for each in lost] == [True, True]
    client.close()
    observer.close()
    return path


def structure(svg: Path) -> list[list[list[str]]]:
    """Return, for each call, for each attempt, what is drawn, without where.

    Except the bars of canceling: the goal's end may overtake the answer to the cancel request.
    """
    calls = ET.parse(svg).getroot().findall(f"{SVG}g")
    return [
        [
            [
                str(part.get("class")).split()[-1]
                for part in attempt
                if part.get("class") not in (None, "canceling")
            ]
            for attempt in call.findall(f"{SVG}g")
        ]
        for call in calls
        if str(call.get("class")).startswith("call ")
    ]


WAITING = ["server", "accept"]
RAN = [*WAITING, "accepted", "executing"]
LOST = [[*RAN, "pause", "pause", "feedback", "lost"], [*RAN, "feedback", "succeeded"]]
EXPECTED = [
    [[*RAN, "feedback", "succeeded"]],
    [[*WAITING, "rejected"]],
    [[*RAN, "feedback", "aborted"]],
    [[*RAN, "pause", "pause", "feedback", "aborted"], [*RAN, "feedback", "succeeded"]],
    [[*RAN, "feedback", "timed_out", "canceled"]],
    [[*RAN, "feedback", "canceled"]],
    LOST,
    LOST,
]


@pytest.mark.long
@pytest.mark.heavy
def test_a_run_with_retries_and_a_crash(log: Path) -> None:
    svg = log.with_suffix(".svg")
    ran = CliRunner().invoke(app, ["timeline", str(log), "--svg", str(svg)])
    assert ran.exit_code == 0, ran.output
    assert structure(svg) == EXPECTED
    if os.environ.get("ACTIONKIT_WRITE_PICTURES"):
        PICTURES.mkdir(exist_ok=True)
        for each in (log, svg):
            shutil.copy(each, PICTURES / each.name)
    assert structure(PICTURES / svg.name) == structure(svg)


def test_the_picture_in_the_documentation_is_of_the_log_beside_it(tmp_path: Path) -> None:
    svg = tmp_path / "again.svg"
    log = PICTURES / f"{NAME}.jsonl"
    ran = CliRunner().invoke(app, ["timeline", str(log), "--svg", str(svg)])
    assert ran.exit_code == 0, ran.output
    assert svg.read_text() == (PICTURES / f"{NAME}.svg").read_text()
