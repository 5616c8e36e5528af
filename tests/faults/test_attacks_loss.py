"""Attacks by a network that loses packets, with the middleware's own settings (C1.12, C2.1)."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from actionkit import Timeouts
from tests import forked
from tests.conftest import Script
from tests.faults import attacks, network
from tests.faults.attacks import Row
from tests.faults.conftest import Field
from tests.faults.crowd import drain, endings
from tests.faults.lab import Seen
from tests.faults.page import attacked
from tests.tables import WRITING

pytestmark = pytest.mark.long

_ROOT = Path(__file__).parents[2]
_AT_A_TIME = 10
_DEADLINE = 100
#: In every run of the suite: few calls, at the worst of the losses.
_ALWAYS = [(max(attacks.LOSSES), attacks.LOSS_CALLS_ALWAYS)]
_WRITTEN = [(percent, attacks.LOSS_CALLS) for percent in attacks.LOSSES]


def plain_client(field: Field, n: int) -> Script:
    """Start the client that ours is compared with, on the same host."""
    command = ["-m", "tests.faults.plain_client", str(n), str(_AT_A_TIME), str(_DEADLINE)]
    with field.cable.first.inside():
        process = forked.Popen(
            [sys.executable, *command],
            cwd=_ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": str(_ROOT)},
        )
    field.at_the_end(process.kill)
    script = Script(process)
    assert script.line() == "connected"
    return script


@pytest.mark.timeout(1500 if WRITING else 230)
@pytest.mark.parametrize(("percent", "n"), _ALWAYS + _WRITTEN)
def test_attack_packets_are_lost(percent, n, field):
    if not WRITING and (percent, n) not in _ALWAYS:
        pytest.skip("only when docs/maintainers/faults.md is written")
    network.skip_where_nothing_can_be_lost(field.cable)
    server = field.serve("fibonacci", journal="goals")
    # Of its own: one server's queue of ten requests is too short for the bursts of both.
    field.serve("fibonacci", action_name="plain", journal="none")
    plain = plain_client(field, n)
    caller = field.caller(Timeouts(server=30.0, accept=90.0))
    field.cable.lose(percent)
    plain.process.stdin.write("\n")
    plain.process.stdin.flush()
    seen, delays = call_many(caller, n)
    code, out, err = plain.finish(2 * _DEADLINE * n / _AT_A_TIME)
    assert code == 0, err
    succeeded = int(out.split()[-1])
    left = drain(server, 30, 15)
    ended = endings(server)
    failures = [one for one in seen if one.error]
    lies = [one for one in seen if not one.error and ended[one.goals[-1]][0] != "succeeded"]
    print(
        f"{percent} %: {len(failures)} of {n} failed, and of a plain client {n - succeeded};"
        f" slowest {max(delays):.1f} s; left {len(left)}; {[one.text for one in failures[:3]]}"
    )
    wrong = len(lies) + max(0, len(failures) - (n - succeeded))
    attacked(Row(attacks.loss(percent, n), len(left), wrong, max(delays)))


def call_many(caller: Any, n: int) -> tuple[list[Seen], list[float]]:
    """Make the calls, so many at a time; returns what they came to, and how long each took."""
    keys = [f"goal {number}" for number in range(n)]
    seen: list[Seen] = []
    for number, key in enumerate(keys):
        caller.call(key, "confirmed_stopped", float(_DEADLINE))
        if number >= _AT_A_TIME:
            seen.append(caller.seen(keys[number - _AT_A_TIME], _DEADLINE + 20))
    seen += [caller.seen(key, _DEADLINE + 20) for key in keys[-_AT_A_TIME:]]
    return seen, [one.events[-1][1] - one.events[0][1] for one in seen]
