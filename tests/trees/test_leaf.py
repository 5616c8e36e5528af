"""A leaf that executes an action: its statuses, texts and goals, with real servers."""

from __future__ import annotations

from typing import Any

import pytest
from py_trees.blackboard import Blackboard
from py_trees.common import Status
from test_msgs.action import Fibonacci, NestedMessage

from actionkit import RetryPolicy, Verdict
from actionkit.testing import tick_until
from actionkit.trees import ActionBehaviour, FromBlackboard
from tests.trees.conftest import BOUND, MakeClient, Place, fate, received


def test_it_runs_until_its_goal_has_succeeded(client: Any) -> None:
    leaf = ActionBehaviour("a", client, {"order": 5}, feedback_key="said", result_key="got")
    said: list[str] = []
    leaf.tick_once()
    assert leaf.status is Status.RUNNING
    first = leaf.future
    assert first is not None
    assert first.outcome(BOUND).ok
    tick_until(leaf, Status.SUCCESS, BOUND)
    said.append(leaf.feedback_message)
    assert leaf.future is first
    assert Blackboard.get("got") == Fibonacci.Result(sequence=[0, 1, 1, 2, 3, 5])
    assert list(Blackboard.get("said").sequence) == [0, 1, 1, 2, 3, 5]
    assert said[0].startswith("succeeded after")
    # Another run is another goal, and nobody reads what the one before has left.
    leaf.tick_once()
    assert leaf.future is not first
    assert not Blackboard.exists("got")
    tick_until(leaf, Status.SUCCESS, BOUND)


def test_its_node_tells_how_far_the_goal_is(client: Any) -> None:
    leaf = ActionBehaviour("a", client, Fibonacci.Goal(order=40))
    seen: set[str] = set()

    def executing() -> bool:
        seen.add(leaf.feedback_message)
        return leaf.feedback_message.startswith("executing: sequence=[")

    tick_until(leaf, executing, BOUND)
    leaf.stop(Status.INVALID)
    assert "asked to cancel" in leaf.feedback_message
    assert leaf.future.outcome(BOUND).cancel is not None


@pytest.mark.long
def test_a_goal_may_come_from_a_function_or_the_blackboard(client: Any) -> None:
    orders = iter([3, 4])
    made = ActionBehaviour("a", client, lambda leaf: {"order": next(orders)}, result_key="got")
    for length in (4, 5):
        tick_until(made, Status.SUCCESS, BOUND)
        assert len(Blackboard.get("got").sequence) == length
    read = ActionBehaviour("b", client, FromBlackboard("mission.target"), result_key="more")
    read.tick_once()
    assert read.status is Status.FAILURE
    assert "'mission.target'" in read.feedback_message
    Blackboard.set("mission", type("Mission", (), {"target": Fibonacci.Goal(order=2)})())
    tick_until(read, Status.SUCCESS, BOUND)
    assert len(Blackboard.get("more").sequence) == 3


def test_a_goal_that_cannot_be_sent_is_a_failure_that_says_why(client: Any, place: Place) -> None:
    before = received(place.server("fibonacci"))

    def broken(leaf: Any) -> Any:
        raise KeyError("no such place")

    raising = ActionBehaviour("a", client, broken)
    raising.tick_once()
    assert raising.status is Status.FAILURE
    assert raising.feedback_message == (
        "the function for the goal raised KeyError: 'no such place'; nothing was sent"
    )
    for goal, word in (
        (FromBlackboard("target"), "blackboard key 'target'"),
        (lambda leaf: {"speed": 1}, "speed"),
        (lambda leaf: None, "function for the goal"),
    ):
        Blackboard.set("target", "to the kitchen")
        leaf = ActionBehaviour("b", client, goal)
        tick_until(leaf, Status.FAILURE, BOUND)
        assert word in leaf.feedback_message
    assert received(place.server("fibonacci")) == before


def test_failures_say_the_errors_sentence(client: Any, place: Place) -> None:
    rejected = ActionBehaviour("a", client, lambda leaf: {"order": -1})
    tick_until(rejected, Status.FAILURE, BOUND)
    assert "was rejected by the server" in rejected.feedback_message
    judged = ActionBehaviour(
        "b",
        client,
        {"order": 2},
        classify=lambda outcome: Verdict.PERMANENT,
        result_key="got",
    )
    tick_until(judged, Status.FAILURE, BOUND)
    assert len(Blackboard.get("got").sequence) == 3  # a failed goal's result may tell why
    nobody = ActionBehaviour("c", (Fibonacci, "nobody"), {"order": 2}, timeout=0.3)
    nobody.tick_once()
    assert nobody.status is Status.FAILURE
    assert "call setup()" in nobody.feedback_message


def test_retries_are_one_run(place: Place, open_client: MakeClient) -> None:
    server = place.server("flaky", "flaky", fails=2, how="aborts")
    retry = RetryPolicy(attempts=3, initial=0.01)
    leaf = ActionBehaviour(
        "a",
        open_client("flaky"),
        {"order": 2},
        retry=retry,
        classify=lambda outcome: None if outcome.ok else Verdict.TRANSIENT,
    )
    tick_until(leaf, Status.SUCCESS, BOUND)
    assert leaf.future.outcome(0).attempts == 3
    server.sync()
    assert server.max_running == 1


@pytest.mark.long
def test_a_deadline_ends_the_run_when_its_goal_was_cancelled(client: Any, place: Place) -> None:
    leaf = ActionBehaviour("a", client, {"order": 40}, timeout=0.3)
    tick_until(leaf, Status.FAILURE, BOUND)
    assert fate(place.server("fibonacci"), leaf.future.goal_id)[-1] == "canceled"


# --- what is refused ---------------------------------------------------------------------------

WRONG = {
    "client": ({"client": "fibonacci"}, TypeError, "client='fibonacci' must be a Client"),
    "no action": ({"client": (int, "x")}, TypeError, "must be an action class"),
    "goal": ({"goal": 5}, TypeError, "goal=5 must be a .*Fibonacci.Goal"),
    "a class": ({"goal": Fibonacci.Goal}, TypeError, "make an instance"),
    "another goal": ({"goal": NestedMessage.Goal()}, TypeError, "NestedMessage"),
    "field": ({"goal": {"order": 1.5}}, TypeError, "order"),
    "unknown field": ({"goal": {"speed": 1}}, ValueError, "speed"),
    "timeout": ({"timeout": -1}, ValueError, "timeout=-1"),
    "server_timeout": ({"server_timeout": "x"}, TypeError, "server_timeout='x'"),
    "retry": ({"retry": 3}, TypeError, "retry=3"),
    "classify": ({"classify": 3}, TypeError, "classify=3"),
    "ledger key": ({"key": 3}, TypeError, "key=3 must be a str, or a function"),
    "key and preempt": (
        {"key": "leg", "earlier_goal": "preempt"},
        ValueError,
        "does not go with earlier_goal='preempt'",
    ),
    "earlier_goal": ({"earlier_goal": "stop"}, ValueError, "'wait', 'fail' or 'preempt'"),
    "key": ({"result_key": "a.b"}, ValueError, "result_key='a.b'"),
    "empty key": ({"feedback_key": ""}, ValueError, "feedback_key=''"),
    "same key": ({"feedback_key": "a", "result_key": "a"}, ValueError, "must differ"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_arguments_are_named_at_once(name: str) -> None:
    given, error, text = WRONG[name]
    arguments = {"client": (Fibonacci, "fibonacci"), "goal": {"order": 1}, **given}
    with pytest.raises(error, match=text):
        ActionBehaviour("a", arguments.pop("client"), arguments.pop("goal"), **arguments)


@pytest.mark.long
@pytest.mark.parametrize(("key", "error"), [("", ValueError), ("/", ValueError), (3, TypeError)])
def test_a_key_must_be_a_name(key: Any, error: type[Exception]) -> None:
    with pytest.raises(error, match="FromBlackboard key"):
        FromBlackboard(key)
