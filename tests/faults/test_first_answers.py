"""The answers to a new node's first announcement are lost: it enters the graph again (C7.6)."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys

import pytest

from actionkit._ros.workarounds.node_replacement import _TRIES_ALONE, SWITCH

PROGRAM = """
import json, sys, time
from actionkit import Client
from actionkit._ros.communication import runtime
from test_msgs.action import Fibonacci

made = []
make_node = runtime.make_node

def make(*args, **own):
    made.append(time.monotonic())
    return make_node(*args, **own)

runtime.make_node = make
with Client(Fibonacci, "fibonacci") as client:
    result = client.call({"order": 3}, timeout=60)
    found = time.monotonic()
    patience = client._session.connection.runtime.node_replacement._patience
print(
    json.dumps(
        {
            "nodes": len(made),
            "seconds": found - made[0],
            "patience": patience,
            "result": list(result.sequence),
        }
    )
)
"""
_EXCHANGE = 0.5
"""Seconds from when a server is known to a node until the result of a short goal."""


@pytest.mark.parametrize("switch", ["1", "0"])
def test_the_first_answers_are_lost(switch, field, monkeypatch):
    if not shutil.which("nft"):
        pytest.skip("no nftables here (the command nft)")
    monkeypatch.setenv(SWITCH, switch)
    server = field.serve("fibonacci")
    field.cable.lose_first_answers()
    with field.cable.first.inside():
        program = subprocess.Popen(
            [sys.executable, "-c", PROGRAM], stdout=subprocess.PIPE, text=True
        )
    field.at_the_end(program.kill)
    out, _ = program.communicate(timeout=90)
    seen = json.loads(out.splitlines()[-1])
    assert seen["result"] == [0, 1, 1, 2]
    server.sync()
    assert server.count("goal_received") == 1
    if switch == "0":
        assert seen["nodes"] == 1
    elif seen["nodes"] == 1:
        # The server's regular announcement came just then: the time of that is chance.
        assert seen["seconds"] < seen["patience"] + _EXCHANGE
    else:
        # Mostly 2 or 3. On a busy machine also these answers come late, and no node is in sight.
        assert seen["nodes"] <= 1 + _TRIES_ALONE
