"""That the oracle of the soak finds what is not as promised, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import pytest

from actionkit.servers import ServerEvent
from tests.soak import plan, records
from tests.soak.oracle import Journal, judge
from tests.soak.records import Record, expected

G1, G2 = "goal 1", "goal 2"
RECORD = Record(
    "steady", 4, began=100.0, timeout=30.0, ended=101.0, goals=[G1], result=[0, 1, 1, 2, 3]
)
DEADLINE = replace(
    RECORD, timeout=1.0, ended=101.1, error="DeadlineExceededError", cancel="CONFIRMED", result=None
)


def journal(*events: str, goal: str = G1, at: float = 100.5, done: tuple[str, ...] = ()) -> Journal:
    return Journal([ServerEvent(event, goal, at, 0, {}) for event in events], done)


RUNS = ("accepted", "executing")


def found(record: Record, of: Journal) -> list[str]:
    return [problem.what for problem in judge(record, of)]


def test_what_callers_and_journals_agree_on_is_right():
    assert found(RECORD, journal(*RUNS, "succeeded")) == []
    assert found(DEADLINE, journal(*RUNS, "canceled")) == []
    undiscovered = replace(DEADLINE, error="ServerUnavailableError", cancel="NOT_NEEDED")
    assert found(undiscovered, journal()) == []
    late = replace(DEADLINE, late=expected("steady", 4))
    assert found(late, journal(*RUNS, "succeeded")) == []


@pytest.mark.parametrize(
    ("record", "seen"),
    [
        (RECORD, journal(*RUNS)),
        (RECORD, journal(*RUNS, "canceled")),
        (replace(RECORD, result=[0, 1]), journal(*RUNS, "succeeded")),
        (replace(RECORD, judge="failure"), journal(*RUNS, "succeeded")),
        (DEADLINE, journal(*RUNS)),
        (replace(DEADLINE, cancel="REFUSED"), journal(*RUNS, "succeeded", at=101.2)),
        (replace(DEADLINE, late=[1, 2]), journal(*RUNS, "canceled")),
        (replace(DEADLINE, ended=100.4), journal(*RUNS, "canceled")),
        (replace(DEADLINE, error="GoalRejectedError", cancel=""), journal(*RUNS)),
        (replace(DEADLINE, error="GoalAbortedError", cancel=""), journal(*RUNS, "canceled")),
        (replace(DEADLINE, error="ServerLostError", cancel=""), journal(*RUNS)),
        (replace(DEADLINE, error="ResultLostError", cancel=""), journal(*RUNS, done=("loss",))),
        (replace(DEADLINE, error="KeyError", cancel=""), journal(*RUNS)),
        (replace(DEADLINE, error="ServerUnavailableError", cancel=""), journal(*RUNS)),
        (replace(RECORD, error="ServerUnavailableError", result=None), journal()),
    ],
)
def test_an_outcome_that_is_not_true_is_found(record, seen):
    assert "wrong" in found(record, seen)


def test_a_server_that_was_killed_may_have_lost_goals_and_lines():
    killed = journal(*RUNS, done=("kill",))
    assert found(replace(DEADLINE, error="ServerLostError", cancel=""), killed) == []
    assert found(DEADLINE, killed) == []


def test_a_call_that_did_not_end_is_found():
    assert found(replace(RECORD, ended=None), journal(*RUNS)) == ["hung"]


def test_two_goals_of_a_call_at_one_time_are_found():
    twice = Journal(
        [
            ServerEvent("executing", G1, 100.1, 0, {}),
            ServerEvent("executing", G2, 100.2, 0, {}),
            ServerEvent("succeeded", G1, 100.3, 0, {}),
            ServerEvent("succeeded", G2, 100.4, 0, {}),
        ]
    )
    record = replace(RECORD, goals=[G1, G2])
    assert found(record, twice) == ["twice"]
    assert found(replace(record, policy="always"), twice) == []
    assert found(replace(record, goals=[G1]), journal("executing", "executing", "succeeded")) == [
        "twice"
    ]


def test_the_bound_of_a_call():
    assert RECORD.bound(healthy=True) == 132.0
    assert DEADLINE.bound(healthy=True) == 103.0
    given_up = replace(RECORD, given_up=110.0)
    assert given_up.bound(healthy=True) == pytest.approx(112.03)
    assert given_up.bound(healthy=False) == pytest.approx(114.03)
    assert replace(given_up, together=20).bound(healthy=False) == pytest.approx(122.6)
    # On a network that loses packets it is worth waiting while others are cancelled.
    assert given_up.bound(healthy=False, served_until=115.0) == pytest.approx(120.5)
    assert given_up.bound(healthy=False, served_until=300.0) == 132.0
    # A server that refuses: the goal runs on, and so does its call.
    assert replace(given_up, kind="stubborn").bound(healthy=True) == 132.0


def test_records_are_read_as_they_were_written(tmp_path):
    path = tmp_path / "records"
    records.write(path, [RECORD, DEADLINE])
    assert records.read(path) == [RECORD, DEADLINE]


def test_the_same_seed_makes_the_same_plan():
    plans = [[plan.make(seed, n, 20, with_network=True) for n in range(40)] for seed in (1, 1, 2)]
    assert plans[0] == plans[1] != plans[2]
    done = {fault.what for one in plans[0] for fault in one.faults}
    assert done == {"kill", "restart", "stop"}
    assert any(one.programs for one in plans[0])
    assert any(one.loss for one in plans[0])
