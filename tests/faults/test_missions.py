"""A mission that is killed again and again does each of its legs once (C12).

What reached the server is read in its own journal.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

import pytest

from actionkit import Ledger
from tests import forked
from tests.conftest import without_noise

LEGS = 5
BEFORE_WRITTEN = "before the result is written"
WRITTEN = "written down, and not sent"
TO_BE_SENT = "to be sent now"
JOINS = "when it joins"
ANY_TIME = "at any time"
MOMENTS = (ANY_TIME, BEFORE_WRITTEN, WRITTEN, TO_BE_SENT, JOINS)
MISSION = """
import os, signal, sys, threading, time
from actionkit import Client, GoalRejectedError, GoalUnknownError, Ledger, LedgerError
from actionkit._calls.ledger.file import LedgerFile
from actionkit._calls.ledger.keys import KeyHold
from test_msgs.action import Fibonacci

name, moment, number = sys.argv[1], sys.argv[2], float(sys.argv[3])
left = int(number)

def dies():
    os.kill(os.getpid(), signal.SIGKILL)

def dies_at(cls, function, after=False, joins=False):
    usual = getattr(cls, function)
    def do(*args, **how):
        global left
        made = usual(*args, **how) if after else None
        left -= not joins or made.joins
        if left < 0:
            dies()
        return made if after else usual(*args, **how)
    setattr(cls, function, do)

if moment == "before the result is written":
    dies_at(KeyHold, "end")
elif moment == "written down, and not sent":
    dies_at(LedgerFile, "_take", after=True)
elif moment == "to be sent now":
    dies_at(KeyHold, "sends")
elif moment == "when it joins":
    left = 0
    dies_at(LedgerFile, "_take", after=True, joins=True)
with Client(Fibonacci, name) as client:
    client.wait_for_server(30)
    if moment == "at any time":
        threading.Timer(number, dies).start()
    for leg in range(5):
        try:
            client.call({"order": 5 + leg}, timeout=60.0, key=f"leg-{leg}")
        except GoalUnknownError:
            print("may have been done", leg, flush=True)
            Ledger(os.environ["ACTIONKIT_LEDGER"]).forget(f"leg-{leg}")
        except GoalRejectedError:
            break
        except LedgerError as error:
            print(error, flush=True)
            break
os._exit(0)
"""


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ACTIONKIT_LEDGER", str(tmp_path / "goals.db"))
    return tmp_path / "goals.db"


def start(server, moment="", number=0.0):
    words = [sys.executable, "-c", MISSION, server.action_name, moment, str(number)]
    return forked.Popen(words, stdout=subprocess.PIPE, text=True, env=dict(os.environ))


def run(server, moment="", number=0.0) -> tuple[bool, Counter[int]]:
    """Run the mission; return whether it was killed, and the legs that may have been done."""
    with start(server, moment, number) as program:
        said, _ = program.communicate(timeout=120)
    told = Counter(int(line.split()[-1]) for line in said.splitlines() if "may" in line)
    assert program.returncode in (0, -signal.SIGKILL)
    return program.returncode != 0, told


def done(server) -> Counter[int]:
    """How often each leg was begun."""
    received = [event for event in server.events if event.event == "accepted"]
    return Counter(int(event.details["order"]) - 5 for event in received)


def kills(seed: int, most: int) -> Iterator[tuple[str, float]]:
    chance = random.Random(seed)
    for _ in range(most):
        moment = chance.choice(MOMENTS)
        yield moment, chance.uniform(0, 0.8) if moment == ANY_TIME else chance.randrange(3)


SERVERS = {
    "quick": ("fibonacci", {"period": 0.02}),
    "slow to accept": ("slow_accept", {"period": 0.01, "delay": 0.4}),
    "restarted": ("fibonacci", {"period": 0.02}),
    "refuses at first": ("flaky", {"fails": 2, "how": "rejects", "period": 0.02}),
}


@pytest.mark.parametrize("kind", SERVERS)
@pytest.mark.parametrize("killed", [6, pytest.param(9, marks=pytest.mark.long)])
@pytest.mark.timeout(300)
def test_each_leg_of_a_mission_that_is_killed_is_done_once(kind, killed, action_server, path):
    name, options = SERVERS[kind]
    server = action_server(name, **options)
    told: Counter[int] = Counter()
    for moment, number in kills(killed, killed):
        told += run(server, moment, number)[1]
        if kind == "restarted":
            server.kill()
            server.restart()
    for _ in range(4):  # a leg that is refused ends the mission
        died, more = run(server)
        told += more
        assert not died
    begun = done(server)
    assert Ledger(path).leftovers() == []
    assert Ledger(path).keys() == {f"leg-{leg}": "succeeded" for leg in range(LEGS)}
    assert all(1 <= begun[leg] <= 1 + told[leg] for leg in range(LEGS)), (begun, told)


def test_two_processes_that_start_a_mission_at_once_do_each_leg_once(action_server, path):
    server = action_server("fibonacci", gate=1)
    with start(server) as one, start(server) as other, ThreadPoolExecutor() as threads:
        ends = [threads.submit(program.communicate, timeout=60) for program in (one, other)]
        refused, _ = next(as_completed(ends)).result()
        assert "key 'leg-0' is in the hands of process" in refused
        server.release()
        assert [without_noise(end.result()[0]) for end in ends].count("") == 1
    assert done(server) == dict.fromkeys(range(LEGS), 1)
