"""Attacks on outcomes: races with deadlines, and classify functions that block (C2.3, C3.3)."""

from __future__ import annotations

import logging
import math
import random
import statistics
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import pytest

from actionkit import DeadlineExceededError, Outcome, RetryPolicy, Timeouts, Verdict
from tests.faults import attacks
from tests.faults.attacks import Row
from tests.faults.crowd import drain, endings
from tests.faults.page import attacked

pytestmark = pytest.mark.long

_GRACE = 2.0  # Timeouts.cancel
_AT_A_TIME = 20
_JITTER = 0.04
_SURELY = 0.5  # seconds before the end of the grace in which a result surely has come
_DEADLINE = 3.0


@dataclass(frozen=True)
class Server:
    """A server with goals that last a third of a second, and their result."""

    name: str
    order: int
    result: list[int]
    options: dict[str, Any] = field(default_factory=dict)


SERVERS = {
    # A server thinks about a cancel for a moment, in which the goal may succeed: rclpy's answer is
    # then that of a refusal.
    "takes": Server("fibonacci", 7, [0, 1, 1, 2, 3, 5, 8, 13], {"cancel_takes": 0.005}),
    "refuses": Server("refuses_cancel", 6, [0]),
}


def problem(outcome: Outcome[Any], deadline: float, end: tuple[str, float], result: Any) -> str:
    """Say what is wrong with the outcome of a call; `""` where nothing is."""
    event, at = end
    error = outcome.error
    if error is None:
        right = event == "succeeded" and list(outcome.result.sequence) == result
        return "" if right else f"a success, and the goal was {event}"
    if not isinstance(error, DeadlineExceededError):
        return f"{error!r}"
    late = error.late_result
    in_time = at < deadline + _GRACE - _SURELY
    if event == "succeeded" and in_time and (late is None or list(late.sequence) != result):
        return f"it succeeded {at - deadline:.3f} s after the deadline; late_result is {late}"
    if str(error.cancel) == "REFUSED" and event == "succeeded" and at < deadline + _GRACE:
        return "REFUSED, and it had succeeded"
    if str(error.cancel) in ("UNKNOWN", "NOT_NEEDED") and in_time:
        return f"{error.cancel}, and it was {event}"
    return ""


@pytest.mark.timeout(150)
@pytest.mark.parametrize("kind", attacks.RACES)
def test_attack_deadlines_near_the_ends_of_goals(kind, action_server, make_client):
    scene = SERVERS[kind]
    server = action_server(scene.name, period=0.05, journal="goals", **scene.options)
    client = make_client(timeouts=Timeouts(cancel=_GRACE), retry=RetryPolicy.none())
    assert client.wait_for_server(20)
    goal = {"order": scene.order}
    chance = random.Random(19)
    usual = 0.0
    calls = []
    for number in range(1 + attacks.CALLS // _AT_A_TIME):
        wave = []
        for _ in range(_AT_A_TIME):
            # The first wave is only there to see how long a goal takes.
            timeout = usual + chance.uniform(-_JITTER, _JITTER) if number else 20.0
            deadline = time.monotonic() + timeout
            wave.append((client.call_async(goal, timeout=timeout), timeout, deadline))
        ended = [(future.outcome(30), timeout, deadline) for future, timeout, deadline in wave]
        took = [outcome.elapsed for outcome, _, _ in ended if outcome.ok]
        # On a busy machine that changes.
        usual = statistics.median(took) if len(took) > 2 else usual + _JITTER
        calls += ended if number else []
    left = drain(server)
    ends = endings(server)
    # If the machine stopped, the deadline may pass before a goal is sent: NOT_NEEDED is right.
    never = ("never received", math.inf)
    problems = []
    for outcome, _, deadline in calls:
        text = problem(outcome, deadline, ends.get(str(outcome.goal_id), never), scene.result)
        problems += [text] if text else []
    late = sum(outcome.error is not None for outcome, _, _ in calls)
    print(f"{kind}: usual {usual:.3f} s; {late} late; {len(problems)} wrong: {problems[:5]}")
    assert late > attacks.CALLS // 20, "the deadlines did not come near the ends"
    assert not problems, f"{len(problems)} wrong: {problems[:5]}"
    delay = max(outcome.elapsed - timeout for outcome, timeout, _ in calls)
    attacked(Row(attacks.race(kind), len(left), len(problems), delay))


@pytest.fixture
def blocker() -> Iterator[threading.Event]:
    """What callbacks wait for; it comes at the end of the test."""
    event = threading.Event()
    yield event
    event.set()


def failure(outcome: Outcome[Any]) -> Verdict:
    return Verdict.PERMANENT


@pytest.mark.parametrize("n", attacks.BLOCKED)
def test_attack_a_judge_behind_blocked_callbacks(n, action_server, make_client, blocker):
    server = action_server("fibonacci", journal="goals")
    client = make_client(retry=RetryPolicy.none(), timeouts=Timeouts(accept=30.0))
    reached = threading.Semaphore(0)

    def block(_: object) -> None:
        reached.release()
        blocker.wait(60)

    for _ in range(n):
        client.call_async({"order": 3}, block)
    assert all(reached.acquire(timeout=20) for _ in range(8))  # as many as threads there are
    judge(attacks.blocked("callbacks", n), [client] * n, server)


@pytest.mark.parametrize("n", attacks.BLOCKED)
def test_attack_a_judge_behind_blocked_logs(n, action_server, make_client, blocker):
    server = action_server("fibonacci", journal="goals")
    clients = [
        make_client(retry=RetryPolicy.none(), timeouts=Timeouts(accept=30.0)) for _ in range(n)
    ]
    assert all(client.wait_for_server(30) for client in clients)

    class Stuck(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            blocker.wait(60)

    log, handler = logging.getLogger("actionkit.goal"), Stuck()
    log.addHandler(handler)
    log.setLevel(logging.DEBUG)
    try:
        for client in clients:
            client.call_async({"order": 3})
        server.wait_for("succeeded", count=n, timeout=30)
        judge(attacks.blocked("handlers", n), clients, server)
    finally:
        blocker.set()
        log.removeHandler(handler)
        log.setLevel(logging.NOTSET)


def judge(attack: attacks.Attack, clients: list[Any], server: Any) -> None:
    """Make a call with each client; its result will be classified as a failure."""
    futures = [
        client.call_async({"order": 3}, timeout=_DEADLINE, classify=failure) for client in clients
    ]
    outcomes = [future.outcome(30) for future in futures]
    successes = [outcome for outcome in outcomes if outcome.error is None]
    print(f"{attack}: {len(successes)} of {len(outcomes)} are successes")
    delay = max(0.0, *(outcome.elapsed - _DEADLINE for outcome in outcomes))
    attacked(Row(attack, len(drain(server)), len(successes), delay))
