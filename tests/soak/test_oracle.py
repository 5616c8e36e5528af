"""The oracle of the soak finds broken promises, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import pytest

from actionkit.servers import ServerEvent
from tests.soak import plan, records
from tests.soak.oracle import Journal, excused, judge, merged, named, told_by
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


def several(*seen: tuple[int, str, str | None, float], done: tuple[str, ...] = ()) -> Journal:
    """The journal of several servers: which of them, what, of which goal, when."""
    servers: dict[int, list[ServerEvent]] = {0: [], 1: []}
    for server, event, goal, at in seen:
        servers[server].append(ServerEvent(event, goal, at))
    return Journal(merged(servers.values()), done)


BOTH = [(server, event, G1, 100.5) for server in (0, 1) for event in ("executing", "succeeded")]


def test_a_goal_that_two_servers_execute_ran_twice_only_where_they_were_not_to_be():
    assert found(RECORD, several(*BOTH)) == ["twice"]
    assert found(RECORD, several(*BOTH, done=("duplicate",))) == []
    again = [*BOTH, (1, "executing", G1, 100.6)]
    assert found(RECORD, several(*again, done=("duplicate",))) == ["twice"]


def test_two_goals_of_a_call_on_two_servers_are_found():
    record = replace(RECORD, goals=[G1, G2])
    runs = [(0, "executing", G1, 100.1), (1, "executing", G2, 100.5), (1, "succeeded", G2, 100.6)]
    for policy in ("no retries", "never_accepted", "confirmed_stopped", "server_gone"):
        one = replace(record, policy=policy)
        assert found(one, several(*runs, done=("twin",))) == ["twice"]
        ended = (0, "canceled", G1, 100.4)
        assert found(one, several(*runs, ended, done=("twin",))) == []
        killed = (0, "gone", None, 100.4)
        assert found(one, several(*runs, killed, done=("twin", "kill"))) == []
        hidden = several(*runs, (0, "hidden", None, 100.4), done=("linger",))
        assert found(one, hidden) == ([] if policy == "server_gone" else ["twice"])
        # It was out of sight before the call, and not meanwhile.
        seen = [(0, "hidden", None, 99.0), (0, "shown", None, 99.5), *runs]
        assert found(one, several(*seen, done=("linger",))) == ["twice"]


def test_what_is_wrong_is_found_beside_a_second_server():
    runs = [(1, event, G1, 100.5) for event in RUNS]
    assert found(RECORD, several(*runs, done=("duplicate",))) == ["wrong"]
    assert found(DEADLINE, several(*runs, done=("duplicate",))) == ["wrong"]
    assert found(DEADLINE, several(*runs, (0, "canceled", G1, 100.6), done=("twin",))) == []


def test_a_server_that_blocks_is_not_lost():
    lost = replace(DEADLINE, error="ServerLostError", cancel="")
    assert found(lost, journal(*RUNS, done=("blocks",))) == ["wrong"]
    assert found(lost, journal(*RUNS, done=("blocks", "linger"))) == []
    unanswered = replace(lost, error="AcceptanceTimeoutError")
    assert found(unanswered, journal(*RUNS, done=("blocks",))) == []


def test_a_result_counts_as_lost_if_its_server_seems_restarted_and_the_error_says_so():
    text = "its result cannot be had: it was restarted, or started twice: a server"
    lost = replace(DEADLINE, error="ResultLostError", cancel="", text=text)
    done = journal(*RUNS, "succeeded", done=("linger",))
    assert found(lost, done) == []
    assert found(replace(lost, text="its server is gone"), done) == ["wrong"]
    assert found(lost, journal(*RUNS, "succeeded", done=("stop",))) == ["wrong"]


def test_goals_that_may_still_run_are_named():
    goal = "0a1b2c3d-0000-4000-8000-0123456789ab"
    assert named(f"WARNING:1 goal MAY STILL BE RUNNING: no server ... steady {goal} stopped") == {
        goal
    }
    assert named(f"goal {goal} was lost\nIT MAY STILL BE RUNNING") == set()
    assert told_by(replace(DEADLINE, text=f"Goal {goal}: IT MAY STILL BE RUNNING")) == {goal}
    # There is no error to name the goals before the one that succeeded.
    assert told_by(replace(RECORD, cancel="UNKNOWN")) == {G1}
    assert told_by(RECORD) == set()


def test_goals_may_be_left_that_were_named_and_are_out_of_reach():
    goal = "0a1b2c3d-0000-4000-8000-0123456789ab"
    said = f"goal {goal} MAY STILL BE RUNNING"
    record = replace(DEADLINE, goals=[goal])
    assert excused({goal}, [record], said, {goal}) == {goal}
    assert excused({goal}, [record], "", {goal}) == set()
    assert excused({goal}, [record], said, set()) == set()
    assert excused({goal}, [replace(record, closed=True)], said, set()) == {goal}


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
    # A server that refuses: the goal continues, and so does its call.
    assert replace(given_up, kind="stubborn").bound(healthy=True) == 132.0


def test_records_are_read_as_they_were_written(tmp_path):
    path = tmp_path / "records"
    records.write(path, [RECORD, DEADLINE])
    assert records.read(path) == [RECORD, DEADLINE]


def test_the_same_seed_makes_the_same_plan():
    plans = [[plan.make(seed, n, 20, with_network=True) for n in range(40)] for seed in (1, 1, 2)]
    assert plans[0] == plans[1] != plans[2]
    done = {fault.what for one in plans[0] for fault in one.faults}
    assert done == {"kill", "restart", "stop", "duplicate", "twin", "linger", "vanish"}
    ways = {one.way for made in plans[0] for one in made.programs}
    assert ways & {*plan.CHILDREN}
    assert ways - {*plan.CHILDREN}
    assert any(one.loss for one in plans[0])
