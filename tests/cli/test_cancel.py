"""`actionkit cancel`, beside goals of other processes (C6.3, R12)."""

from __future__ import annotations

import json
import signal
import uuid
from typing import Any

import pytest
from test_msgs.action import Fibonacci

from actionkit import Client, GoalState, Timeouts, servers
from actionkit._model.cancel_answer import CancelAnswer
from actionkit._model.environment.domain import Domain
from actionkit._ros.cancelling.cancel import AllSaid, CancelSaid
from actionkit._ros.cancelling.cancelling import _SETTLE, Cancelling
from actionkit._ros.others_goals.watch import GoalSeen
from actionkit.cli._shared.exits import Exit
from actionkit.cli.cancel_and_stop._stop_table import exit_of
from tests.cli.conftest import FIBONACCI, Running, World
from tests.cli.test_call import goal_id
from tests.waiting import until


def goals_of_others(world: World, server: str, count: int) -> dict[str, Running]:
    """Return programs that wait for goals which do not end by themselves, by the goals' ids."""
    calls = [world.start("call", server, FIBONACCI, "{order: 900}") for _ in range(count)]
    for call in calls:
        call.until("Goal accepted")
    return {goal_id(call.text): call for call in calls}


def test_goals_are_listed_and_canceled_by_id_and_all_at_once(world: World) -> None:
    server = world.server("never_finishes")
    calls = goals_of_others(world, "never_finishes", 3)
    first, *others = calls
    listed = world.run("cancel", "never_finishes")
    assert listed.code == Exit.USAGE
    assert all(f"{goal}  EXECUTING" in listed.out for goal in calls)
    assert "Nothing was canceled. To cancel one: actionkit cancel /never_finishes " in listed.err
    assert set(calls) <= server.running()

    one = world.run("cancel", "never_finishes", first.replace("-", ""))
    assert (one.code, one.err) == (Exit.OK, "")
    assert one.out == f"{first}  CONFIRMED   It was canceled, and runs no more.\n"
    server.wait_for("canceled", goal_id=first)
    assert calls[first].finish() == Exit.CANCELED
    assert set(others) <= server.running()

    every = world.run("cancel", "never_finishes", "--all", "--json")
    told = {line["goal_id"]: line for line in map(json.loads, every.out.splitlines())}
    assert every.code == Exit.OK
    assert {goal: told[goal]["cancel"] for goal in told} == dict.fromkeys(others, "CONFIRMED")
    server.sync()
    assert not server.running()
    for goal in others:
        assert calls[goal].finish() == Exit.CANCELED

    strange = str(uuid.uuid4())
    none = world.run("cancel", "never_finishes", first, strange)
    assert none.code == Exit.NO_SUCH_GOAL
    assert sorted(none.out.splitlines()) == sorted([
        f"{first}  NOT_NEEDED  It had ended before: CANCELED.",
        f"{strange}  NO_SUCH_GOAL  No server in sight knows it: it ended long ago, or never was"
        " here.",
    ])  # fmt: skip
    assert world.run("cancel", "never_finishes").out == "No goal is running.\n"
    assert world.run("cancel", "never_finishes", "--all").out == "No goal is running.\n"


def test_what_one_of_two_servers_has_ended_may_run_on_the_other(world: World) -> None:
    name = "never_finishes"
    server = world.server(name)
    slow = servers.start("slow_cancel", action_name=name, domain_id=world.domain, gate=1)
    there = Client(Fibonacci, name, node=Domain(world.domain), on_close="abandon")
    with slow as other, there as client:
        readiness = client._session.connection.link.readiness
        until(lambda: readiness.ready and len(readiness.servers) == 2)
        future = client.call_async({"order": 900})
        goal = str(future.goal_id)
        for each in (server, other):
            each.wait_for("executing", goal_id=goal)
        done = world.run("cancel", name, goal, "--timeout", "2")
        server.wait_for("canceled", goal_id=goal)
        every = world.run("cancel", name, "--all", "--timeout", "2")
        assert (done.code, every.code) == (Exit.CANCEL_UNKNOWN, Exit.CANCEL_UNKNOWN)
        assert f"{goal}  UNKNOWN" in done.out
        assert f"{goal}  UNKNOWN" in every.out
        other.release(1)
        other.wait_for("canceled", goal_id=goal)
        assert future.outcome(20).status is GoalState.CANCELED


@pytest.mark.long
def test_the_time_begins_when_a_goal_is_asked_for(world: World) -> None:
    world.server("countdown")  # without goals, so it has no status to send
    done = world.run("cancel", "countdown", str(uuid.uuid4()), "--timeout", "0.8")
    assert (done.code, done.err) == (Exit.NO_SUCH_GOAL, "")


@pytest.mark.long
def test_a_refusal_is_told(world: World) -> None:
    server = world.server("refuses_cancel")
    (goal,) = goals_of_others(world, "refuses_cancel", 1)
    done = world.run("cancel", "refuses_cancel", "--all")
    assert done.code == Exit.CANCEL_REFUSED
    assert (
        done.out == f"{goal}  REFUSED     The server refused to cancel it. IT IS STILL RUNNING.\n"
    )
    assert goal in server.running()


@pytest.mark.long
def test_an_accepted_cancellation_is_no_canceled_goal(world: World) -> None:
    server = world.server("slow_cancel", gate=1)
    ((goal, call),) = goals_of_others(world, "slow_cancel", 1).items()
    done = world.run("cancel", "slow_cancel", goal, "--timeout", "1.5")
    assert done.code == Exit.CANCEL_UNKNOWN
    assert done.out == (
        f"{goal}  UNKNOWN     The server is cancelling it, and did not end it. IT MAY STILL BE"
        " RUNNING.\n"
    )
    again = world.start("cancel", "slow_cancel", "--all", "--timeout", "60", before=AWAKE)
    again.until("waiting")
    again.signal(signal.SIGINT)
    assert again.finish() == Exit.INTERRUPTED
    # Where discovery takes long, the hint of a similar name comes first.
    assert again.text.endswith(f"{done.out}\n\nInterrupted.\n")
    server.release(1)
    assert call.finish() == Exit.CANCELED


LATE = """
import threading, time
import actionkit._ros.cancelling.cancel_goals as c
from actionkit._ros.others_goals.survey import Survey
see, put_into, began = Survey.actions, c._putter, []
def actions(self):
    began.append(time.monotonic())
    return see(self) if began[-1] - began[0] > 1.2 else {}
def putter(inbox, action):
    put = put_into(inbox, action)
    def later(news):
        threading.Timer(0.6 if isinstance(news, list) else 0.0, put, [news]).start()
    return later
Survey.actions, c._putter = actions, putter
"""
"""The server is seen late, and its status comes after its answer."""


NAMELESS = """
import actionkit._ros.others_goals.survey as s
from dataclasses import replace
endpoints = s._endpoints
s._endpoints = lambda infos: tuple(replace(end, node="") for end in endpoints(infos))
"""
"""The middleware tells of the names of nodes later than of what they have."""


@pytest.mark.parametrize("before", [LATE, NAMELESS], ids=["late", "nameless"])
@pytest.mark.long
def test_a_goal_of_a_server_that_comes_into_sight_slowly_is_told_of(
    world: World, before: str
) -> None:
    server = world.server("slow_cancel", gate=1)
    ((goal, call),) = goals_of_others(world, "slow_cancel", 1).items()
    assert world.run("cancel", "slow_cancel", goal, "--timeout", "0.5").code == Exit.CANCEL_UNKNOWN
    late = world.start("cancel", "slow_cancel", "--all", "--timeout", "1.5", before=before)
    assert late.finish() == Exit.CANCEL_UNKNOWN
    assert f"{goal}  UNKNOWN" in late.text
    server.release(1)
    assert call.finish() == Exit.CANCELED


AWAKE = """
import actionkit._ros.cancelling.cancelling as c
real = c.Cancelling.take_news
def take(self, *news):
    real(self, *news)
    if self.board.goals:
        print("waiting", flush=True)
        c.Cancelling.take_news = real
c.Cancelling.take_news = take
"""
"""Has the command tell, once, that it knows of a goal."""


@pytest.mark.long
def test_no_answer_is_told(world: World) -> None:
    server = world.server("blocking", gate=1)
    ((goal, call),) = goals_of_others(world, "blocking", 1).items()
    server.wait_for("executing", goal_id=goal)
    done = world.run("cancel", "blocking", goal, "--timeout", "1.5", "--json")
    assert done.code == Exit.CANCEL_UNKNOWN
    told = json.loads(done.out)
    assert (told["goal_id"], told["cancel"]) == (goal, "UNKNOWN")
    assert told["detail"] == "The server did not answer. IT MAY STILL BE RUNNING."
    server.release()
    assert call.finish() == Exit.OK


@pytest.mark.long
def test_a_goal_that_may_still_be_accepted_is_asked_for_until_then(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What `actionkit mcp` leaves behind does that: its goal would run without anybody."""
    server = world.server("slow_accept", gate=1, period=1.0)
    for variable in ("ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE"):
        monkeypatch.setenv(variable, world.environment[variable])
    patient = Timeouts(accept=60.0)
    with Client(Fibonacci, "slow_accept", on_close="abandon", timeouts=patient) as client:
        sent = client.call_async(Fibonacci.Goal(order=40))
        goal = str(sent.goal_id)
        server.wait_for("goal_received", goal_id=goal)
        cancel = world.start("cancel", "slow_accept", goal, "--may-come", "--timeout", "30")

        def asked_for_long() -> bool:
            events = [e for e in server.events if e.goal_id == goal]
            asked = [e.monotonic for e in events if e.event == "cancel_requested"]
            return bool(asked) and asked[-1] - asked[0] > _SETTLE + 0.5

        until(asked_for_long, "requests after it would have been taken for an unknown goal")
        server.release()
        server.wait_for("canceled", goal_id=goal)
        assert cancel.finish() == Exit.OK


def test_without_a_server(empty_world: World) -> None:
    done = empty_world.run("cancel", "/fibonacci", "--all", "--server-timeout", "0.3")
    assert (done.code, done.out) == (Exit.NO_SERVER, "")
    assert done.err.startswith(
        "Error: Action '/fibonacci' has no server in sight. `actionkit list`"
    )


def test_a_similar_name_is_told_while_the_looking_goes_on(world: World) -> None:
    world.server("fibonacci")
    cancel = world.start("cancel", "/fibonaci", "--server-timeout", "60")
    cancel.until("/fibonaci has no server in sight so far. Did you mean /fibonacci? Still looking")
    cancel.signal(signal.SIGINT)
    assert cancel.finish() == Exit.INTERRUPTED


# --- what is known when, on a clock of the test's ----------------------------------------------

GOAL = str(uuid.UUID(int=1))
A, R, T, U = (
    CancelAnswer.ACCEPTED,
    CancelAnswer.REFUSED,
    CancelAnswer.TERMINATED,
    CancelAnswer.UNKNOWN_GOAL,
)


def goal_is(cancelling: Cancelling, goal: str, state: str) -> None:
    if state:
        cancelling.take_news([GoalSeen(goal, state, 0)], 0.0)


def fate(
    *answers: CancelAnswer, state: str = "EXECUTING", now: float = 0.0, over: bool = False
) -> str | None:
    """Return what is said of a goal that was asked to be cancelled, and answered about, at 0 s."""
    cancelling = Cancelling("/a", [GOAL])
    assert cancelling.to_ask_singly(-1.0) == [], "its state may arrive"
    assert cancelling.to_ask_singly(0.0) == [GOAL]
    assert cancelling.to_ask_singly(0.0) == []
    for answer in answers:
        cancelling.take(CancelSaid(GOAL, answer), 0.0)
    goal_is(cancelling, GOAL, state)
    told = cancelling.settle(now, over=over)
    assert cancelling.settle(now, over=over) == []
    assert cancelling.done == bool(told)
    return told[0].cancel if told else None


@pytest.mark.parametrize(
    ("answers", "known", "said"),
    [
        ((), {"now": 9.0}, None),
        ((), {"over": True}, "UNKNOWN"),
        ((A,), {"now": 9.0}, None),
        ((A,), {"state": "CANCELING", "now": 9.0}, None),
        ((A,), {"state": "CANCELED"}, "CONFIRMED"),
        ((), {"state": "CANCELED"}, "CONFIRMED"),
        ((A,), {"state": "SUCCEEDED"}, "NOT_NEEDED"),
        ((A,), {"state": "LOST"}, "UNKNOWN"),
        ((A,), {"over": True}, "UNKNOWN"),
        # A refusal may be a race that the goal's end has won.
        ((R,), {}, None),
        ((R,), {"state": "SUCCEEDED"}, "NOT_NEEDED"),
        ((R,), {"now": 1.5}, "REFUSED"),
        ((R,), {"over": True}, "REFUSED"),
        ((R, A), {"now": 1.5}, None),
        ((A, R), {"now": 1.5}, None),
        ((R,), {"state": "CANCELING", "now": 1.5}, None),
        # Somebody else is cancelling it already, or it has just ended.
        ((T,), {"state": "CANCELING", "now": 1.5}, None),
        ((T,), {"state": "CANCELED"}, "CONFIRMED"),
        # One of two servers does not know it; it may only not have accepted it yet.
        ((U,), {"now": 1.5}, None),
        ((U,), {"over": True}, "UNKNOWN"),
        ((U, A), {"state": "", "now": 1.5}, None),
        ((U,), {"state": ""}, None),
        ((U,), {"state": "", "now": 1.5}, "NO_SUCH_GOAL"),
    ],
)
@pytest.mark.every
def test_what_is_said_of_a_goal(
    answers: tuple[CancelAnswer, ...], known: dict[str, Any], said: str | None
) -> None:
    assert fate(*answers, **known) == said


def test_a_goal_that_ended_after_its_refusal_does_not_run() -> None:
    cancelling = Cancelling("/a", [GOAL])
    cancelling.take(CancelSaid(GOAL, R), 0.0)
    goal_is(cancelling, GOAL, "EXECUTING")
    assert [fate.cancel for fate in cancelling.settle(1.5, over=False)] == ["REFUSED"]
    goal_is(cancelling, GOAL, "SUCCEEDED")
    assert [fate.cancel for fate in cancelling.settle(4.0, over=True)] == ["NOT_NEEDED"]
    assert cancelling.settle(4.0, over=True) == []
    assert exit_of(cancelling) is Exit.OK


def test_a_goal_that_had_ended_is_not_asked_about() -> None:
    cancelling = Cancelling("/a", [GOAL])
    goal_is(cancelling, GOAL, "CANCELED")
    assert cancelling.to_ask_singly(0.0) == []
    (told,) = cancelling.settle(0.0, over=False)
    assert (told.cancel, told.text) == ("NOT_NEEDED", "It had ended before: CANCELED.")
    assert cancelling.done
    assert cancelling.to_ask(9.0) is None, "all goals would be canceled"


def test_an_answer_to_an_earlier_request_is_none_to_the_last() -> None:
    """The server may have accepted a goal in between, and stopped answering."""
    cancelling = Cancelling("/a")
    cancelling.seen(["/server"])
    cancelling.take_news(("/server",), 0.0)
    first = cancelling.to_ask(0.0)
    cancelling.take_all(AllSaid(first, ()), 0.1)
    assert (cancelling.done, exit_of(cancelling)) == (True, Exit.OK)
    cancelling.once_more()
    assert cancelling.to_ask(4.0) == 2
    cancelling.settle(9.0, over=True)
    assert exit_of(cancelling) is Exit.CANCEL_UNKNOWN
    assert cancelling.unheard == "/a: 1 of 1 servers did not answer. GOALS MAY STILL BE RUNNING."
    third = cancelling.to_ask(9.0)  # it repeats the second
    cancelling.take_all(AllSaid(third, ()), 9.1)
    assert (cancelling.unheard, exit_of(cancelling)) == ("", Exit.OK)


@pytest.mark.long
def test_the_exit_code_is_that_of_the_worst() -> None:
    goals = [str(uuid.UUID(int=number)) for number in range(1, 4)]
    cancelling = Cancelling("/a", goals)
    assert exit_of(cancelling) is Exit.OK
    cancelling.take(CancelSaid(goals[0], U), 0.0)
    cancelling.settle(2.0, over=False)
    assert exit_of(cancelling) is Exit.NO_SUCH_GOAL
    goal_is(cancelling, goals[2], "EXECUTING")
    cancelling.settle(2.0, over=True)
    assert exit_of(cancelling) is Exit.CANCEL_UNKNOWN
    cancelling = Cancelling("/a", goals)
    goal_is(cancelling, goals[2], "EXECUTING")
    cancelling.take(CancelSaid(goals[2], R), 0.0)
    cancelling.settle(2.0, over=True)
    assert exit_of(cancelling) is Exit.CANCEL_REFUSED
