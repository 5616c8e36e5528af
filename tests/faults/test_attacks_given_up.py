"""Attacks: a program gives up on very many goals at once; all are cancelled (C2.3 to C2.5)."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from actionkit.servers import Server
from tests.conftest import NEVER
from tests.faults import attacks
from tests.faults.attacks import Attack, Row
from tests.faults.crowd import CODES, Crowd, drain, endings, untold, wrong
from tests.faults.page import attacked
from tests.tables import WRITING

pytestmark = pytest.mark.long

_CANCEL = 2.0  # Timeouts.cancel of the programs


@pytest.fixture
def crowd(ros_domain: int, tmp_path: Path) -> Iterator[Callable[..., Crowd]]:
    """Start programs; those that still run are killed at the end."""
    with ExitStack() as stack:

        def start(way: str, n: int, **settings: Any) -> Crowd:
            started = Crowd(way, n, tmp_path, **settings)
            stack.callback(started.kill)
            return started

        yield start


def judged(attack: Attack, server: Server, crowds: list[Crowd], began: float) -> Row:
    """Wait for the ends of the goals, and compare."""
    left = drain(server)
    ended = endings(server)
    mistaken = [end for one in crowds for end in wrong(one, ended)]
    ids = {end.goal for one in crowds for end in one.ends}
    last = max((at for goal, (_, at) in ended.items() if goal in ids), default=began)
    delay = max(last, *(one.reported_at for one in crowds)) - began
    if crowds[0].way == "deadline":
        delay = max(end.elapsed - (end.timeout or 0) for one in crowds for end in one.ends)
    print(f"{attack}: left {len(left)}, delay {delay:.1f}, wrong {len(mistaken)}: {mistaken[:3]}")
    return Row(attack, len(left), len(mistaken), delay)


def give_up(way: str, n: int, server: Server, start: Callable[..., Crowd]) -> Row:
    settings = {"lead": 5 + 0.03 * n} if way == "deadline" else {}
    one = start(way, n, **settings)
    one.fill(server)
    began = one.give_up()
    if way in ("cancel_all", "deadline"):
        assert one.line() == "ended"
        row = judged(attacks.given_up(way, n), server, [one], began)
        one.tell()
        code, err = one.finish(30)
    else:
        code, err = one.finish(60)
        row = judged(attacks.given_up(way, n), server, [one], began)
    assert code == CODES.get(way, 0), err
    assert err == "" or (way == "ctrl_c" and err.rstrip().endswith("KeyboardInterrupt"))
    return row


@pytest.mark.timeout(600 if WRITING else 120)
@pytest.mark.parametrize(
    "n", [n if n < 500 else pytest.param(n, marks=pytest.mark.heavy) for n in attacks.SIZES]
)
@pytest.mark.parametrize("way", attacks.WAYS)
def test_attack_many_goals_are_given_up_on(way, n, action_server, crowd):
    if not WRITING and (way, n) not in attacks.ALWAYS:
        pytest.skip("only when docs/maintainers/faults.md is written")
    server = action_server("never_finishes", journal="goals")
    row = give_up(way, n, server, crowd)
    if way == "deadline":
        assert row.delay < _CANCEL + 1.5
    attacked(row)


@pytest.mark.timeout(240)
def test_attack_ten_processes_are_interrupted_together(action_server, crowd):
    server = action_server("never_finishes", journal="goals")
    with ThreadPoolExecutor(10) as starters:  # each waits until its program sees the server
        crowds = list(starters.map(lambda _: crowd("ctrl_c", 60), range(10)))
    for one in crowds:
        one.fill(server)
    began = time.monotonic()
    for one in crowds:
        one.give_up()
    assert {one.finish(60)[0] for one in crowds} == {-signal.SIGINT}
    attack = Attack(attacks.GIVEN_UP, attacks.TEN_PROCESSES, attacks.goals(600))
    attacked(judged(attack, server, crowds, began))


def test_attack_each_ctrl_c_ends_a_wait(action_server, crowd):
    server = action_server("slow_cancel", gate=1, journal="goals")
    one = crowd("ctrl_c", 100, cancel=60.0)
    one.fill(server)
    one.give_up()
    # The goals are known to be on their way to their ends, which will take a minute.
    server.wait_for("cancel_accepted", count=100, timeout=30)
    began = time.monotonic()
    while one.process.poll() is None and time.monotonic() < began + 30:
        one.process.send_signal(signal.SIGINT)
        NEVER.wait(1.0)
    delay = time.monotonic() - began
    code, _ = one.finish(60)
    assert code != 0
    server.release()
    left = drain(server)
    attack = Attack(attacks.GIVEN_UP, attacks.TWO_PRESSES, attacks.goals(100))
    attacked(Row(attack, len(left), 0, delay))


@pytest.mark.parametrize("way", attacks.DEAF_WAYS)
def test_attack_a_server_that_does_not_answer(way, action_server, crowd):
    server = action_server("never_finishes", journal="goals")
    one = crowd(way, 100, log=way == "close")
    one.fill(server)
    server.pause()
    began = one.give_up()
    code, err = one.finish(60)
    assert code == 0, err
    delay = one.reported_at - began
    assert delay < (_CANCEL + 2.0 if way == "close" else _CANCEL + 6.0)
    mistaken = [end for end in one.ends if end.cancel != "UNKNOWN"]
    server.resume()
    left = drain(server)
    print(
        f"{way}: left {len(left)}, delay {delay:.1f}, wrong {len(mistaken)}: {mistaken[:3]}\n{err}"
    )
    attacked(Row(attacks.deaf(way), untold(left, err), len(mistaken), delay))
