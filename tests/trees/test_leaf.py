"""A leaf that has an action done: its statuses, its words, its goals, with real servers."""

from __future__ import annotations

import gc
import threading
from collections import deque
from collections.abc import Callable
from typing import Any

import py_trees
import pytest
from py_trees.blackboard import Blackboard
from py_trees.common import Status
from test_msgs.action import Fibonacci, NestedMessage

from actionkit import Client, RetryPolicy, ServerUnavailableError, Timeouts, Verdict
from actionkit.testing import isolated_domain, tick_until
from actionkit.trees import ActionBehaviour, FromBlackboard
from actionkit.trees._clients import ClientHold
from actionkit.trees._runs import Runs
from tests.conftest import NEVER
from tests.trees.conftest import Place, fate

BOUND = 30.0
MakeClient = Callable[..., Client[Any, Any, Any]]


@pytest.fixture
def client(place: Place, open_client: MakeClient) -> Client[Any, Any, Any]:
    """A client of the server fibonacci, which sends feedback and rejects negative orders."""
    place.server("fibonacci", "fibonacci", period=0.02)
    return open_client("fibonacci")


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
    received = place.server("fibonacci").count("goal_received")

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
    assert place.server("fibonacci").count("goal_received") == received


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
    assert server.max_running == 1


def test_a_deadline_ends_the_run_when_its_goal_was_cancelled(client: Any, place: Place) -> None:
    leaf = ActionBehaviour("a", client, {"order": 40}, timeout=0.3)
    tick_until(leaf, Status.FAILURE, BOUND)
    assert fate(place.server("fibonacci"), leaf.future.goal_id)[-1] == "canceled"


# --- the earlier goal --------------------------------------------------------------------------


def test_a_new_run_waits_until_the_earlier_goal_has_stopped(
    place: Place, open_client: MakeClient
) -> None:
    server = place.server("slow_cancel", script=[{"cancel_after": 0.4}, "accept", "never"])
    leaf = ActionBehaviour("a", open_client("slow_cancel"), {"order": 1})
    tick_until(leaf, lambda: leaf.future.known_to_run, BOUND)
    first = leaf.future
    server.wait_for("executing", goal_id=str(first.goal_id))
    leaf.stop(Status.INVALID)
    leaf.tick_once()
    assert leaf.status is Status.RUNNING
    assert leaf.future is None
    assert f"waits until the earlier goal {first.goal_id}" in leaf.feedback_message
    tick_until(leaf, lambda: leaf.future is not None, BOUND)
    second = leaf.future
    accepted = server.wait_for("accepted", goal_id=str(second.goal_id))[0]
    stopped = server.wait_for("canceled", goal_id=str(first.goal_id))[0]
    assert stopped.monotonic < accepted.monotonic
    leaf.shutdown()
    assert server.max_running == 1


def test_or_it_fails_and_says_so(place: Place, open_client: MakeClient) -> None:
    server = place.server("slow_cancel", script=[{"cancel_after": 0.4}, "accept", "never"])
    leaf = ActionBehaviour("a", open_client("slow_cancel"), {"order": 1}, earlier_goal="fail")
    tick_until(leaf, lambda: leaf.future.known_to_run, BOUND)
    first = leaf.future
    server.wait_for("executing", goal_id=str(first.goal_id))
    leaf.stop(Status.INVALID)
    leaf.tick_once()
    assert leaf.status is Status.FAILURE
    assert f"the earlier goal {first.goal_id} of this behaviour still runs" in leaf.feedback_message
    leaf.shutdown()


def test_a_refused_cancel_is_waited_for_and_told(place: Place, open_client: MakeClient) -> None:
    server = place.server("refusing", script=["refuse_cancel", "accept", "gate", "succeed"])
    leaf = ActionBehaviour("a", open_client("refusing"), {"order": 1})
    leaf.tick_once()
    first = leaf.future
    server.wait_for("executing", goal_id=str(first.goal_id))
    leaf.stop(Status.INVALID)
    tick_until(leaf, lambda: "refused to cancel" in leaf.feedback_message, BOUND)
    assert leaf.future is None
    server.release(1)
    tick_until(leaf, lambda: leaf.future is not None, BOUND)
    server.wait_for("accepted", goal_id=str(leaf.future.goal_id))
    server.release(1)
    tick_until(leaf, Status.SUCCESS, BOUND)
    assert server.max_running == 1


def test_after_its_server_was_lost_it_does_not_wait_for_ever(
    place: Place, open_client: MakeClient
) -> None:
    server = place.server("dying", script=["accept", "never"])
    leaf = ActionBehaviour("a", open_client("dying", timeouts=Timeouts(server=2.0)), {"order": 1})
    leaf.tick_once()
    server.wait_for("executing", goal_id=str(leaf.future.goal_id))
    lost = leaf.future
    server.terminate()
    tick_until(leaf, Status.FAILURE, BOUND)
    assert lost.known_to_run is None
    # No server: the leaf says for a while what it waits for, and then that it does not know.
    leaf.tick_once()
    assert leaf.status is Status.RUNNING
    assert "waits for news of the earlier goal" in leaf.feedback_message
    tick_until(leaf, Status.FAILURE, BOUND)
    assert f"{lost.goal_id} of this behaviour MAY STILL BE RUNNING" in leaf.feedback_message
    # A server that does not know the goal proves that it is gone.
    server.restart()
    tick_until(leaf, lambda: leaf.future is not None and leaf.future.known_to_run, BOUND)
    assert lost.known_to_run is False


def test_its_time_includes_the_wait_for_the_earlier_goal(
    place: Place, open_client: MakeClient
) -> None:
    server = place.server("refusing", script=["refuse_cancel", "accept", "gate", "succeed"])
    leaf = ActionBehaviour("a", open_client("refusing"), {"order": 1}, timeout=20.0)
    leaf.tick_once()
    server.wait_for("executing", goal_id=str(leaf.future.goal_id))
    leaf.stop(Status.INVALID)
    leaf._timeout = 0.2
    tick_until(leaf, Status.FAILURE, BOUND)
    assert "the time for this run is up" in leaf.feedback_message
    server.release(1)


def test_a_goal_that_its_client_lost_touch_with_is_not_run_beside_another(
    place: Place, open_client: MakeClient
) -> None:
    """The client's own thread dies, and the client goes on with another one."""
    server = place.server("lasting", script=["accept", "never"])
    client = open_client("lasting", timeouts=Timeouts(server=0.5))
    leaf = ActionBehaviour("a", client, {"order": 1})
    tick_until(leaf, lambda: leaf.future.known_to_run, BOUND)
    lost = leaf.future
    runtime = client._session.port.runtime
    runtime.run(lambda: setattr(runtime, "_broken", MemoryError("for the test")))
    assert lost.exception(BOUND) is not None
    assert lost.known_to_run is None
    tick_until(leaf, Status.FAILURE, BOUND)
    tick_until(leaf, lambda: "MAY STILL BE RUNNING" in leaf.feedback_message, BOUND)
    assert client.wait_for_server(BOUND)
    assert server.max_running == 1
    leaf.shutdown()


# --- clients -----------------------------------------------------------------------------------


def test_leaves_share_a_client_that_is_closed_with_the_last_of_them(place: Place) -> None:
    place.server("fibonacci", "fibonacci", period=0.02)
    trees = []
    for _ in range(2):
        leaves = [ActionBehaviour(name, (Fibonacci, "fibonacci"), {"order": 2}) for name in "ab"]
        root = py_trees.composites.Sequence("root", memory=True, children=leaves)
        trees.append(py_trees.trees.BehaviourTree(root))
        trees[-1].setup(timeout=BOUND)
    clients = {leaf.client for tree in trees for leaf in tree.root.children}
    assert len(clients) == 1
    (shared,) = clients
    assert shared is not None
    tick_until(trees[0], Status.SUCCESS, BOUND)
    trees[0].shutdown()
    assert not shared.closed
    tick_until(trees[1], Status.SUCCESS, BOUND)
    trees[1].shutdown()
    assert shared.closed
    trees[1].tick()
    assert "shut down; setup() begins anew" in trees[1].root.children[0].feedback_message
    trees[1].setup(timeout=BOUND)
    tick_until(trees[1], Status.SUCCESS, BOUND)
    trees[1].shutdown()


def test_leaves_of_two_domains_do_not_share_a_client(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A test that has not shut down its tree must not send the next one's goals to its servers."""
    place.server("fibonacci", "fibonacci", period=0.02)
    first, second = (ActionBehaviour(n, (Fibonacci, "fibonacci"), {"order": 2}) for n in "ab")
    first.setup()
    with isolated_domain() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        second._server_timeout = 0.1
        with pytest.raises(ServerUnavailableError):
            second.setup()
        assert second.client is not first.client
        second.shutdown()
    first.shutdown()


def test_a_clients_own_end_is_told(place: Place, open_client: MakeClient) -> None:
    place.server("fibonacci", "fibonacci", period=0.02)
    client = open_client("fibonacci")
    leaf = ActionBehaviour("a", client, {"order": 40})
    assert not client.closed
    tick_until(leaf, lambda: leaf.future.known_to_run, BOUND)
    client.close()
    assert client.closed
    tick_until(leaf, Status.FAILURE, BOUND)
    leaf.tick_once()
    assert leaf.feedback_message == "nothing was sent, because the client is closed"
    leaf.shutdown()


def test_setup_does_not_wait_for_ever(place: Place) -> None:
    leaf = ActionBehaviour("dock", (Fibonacci, "nobody_there"), {}, server_timeout=0.2)
    with pytest.raises(ServerUnavailableError, match=r"'/nobody_there'.*behaviour 'dock'"):
        leaf.setup()
    leaf.shutdown()
    assert leaf.client is None


def test_the_time_for_a_setup_ends_it_whatever_it_does(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`tree.setup(timeout=...)` raises out of a signal handler, once."""
    leaves = [ActionBehaviour(n, (Fibonacci, n), {}, server_timeout=0.1) for n in "ab"]
    root = py_trees.composites.Sequence("root", memory=True, children=leaves)
    make = ClientHold.make

    def late(hold: ClientHold, node: Any) -> None:
        if hold is leaves[1]._hold:
            raise RuntimeError("tree setup interrupted or timed out")
        make(hold, node)

    with monkeypatch.context() as patch:
        patch.setattr(ClientHold, "make", late)
        with pytest.raises(RuntimeError, match="timed out"):
            leaves[0].setup()
    root.shutdown()
    leaves[0].shutdown()


def test_a_node_may_be_given_to_setup(place: Place) -> None:
    import rclpy
    from rclpy.context import Context

    place.server("/robot1/fibonacci", "fibonacci")
    context = Context()
    context.init(args=[])
    node = rclpy.create_node("planner", namespace="robot1", context=context)
    leaf = ActionBehaviour("a", (Fibonacci, "fibonacci"), {"order": 2})
    try:
        leaf.setup(node=node)
        assert leaf.client is not None
        assert leaf.client.action_name == "/robot1/fibonacci"
        tick_until(leaf, Status.SUCCESS, BOUND)
    finally:
        leaf.shutdown()
        node.destroy_node()
        context.shutdown()


# --- the end of a tree -------------------------------------------------------------------------


def test_a_shutdown_cancels_all_goals_first_and_waits_once(
    place: Place, open_client: MakeClient
) -> None:
    """Goals of later leaves do not run on while an earlier one's is waited for."""
    stubborn = place.server("refusing", script=["refuse_cancel", "accept", "gate", "succeed"])
    prompt = place.server("running", script=["accept", "never"])
    grace = 0.5
    leaves = [
        ActionBehaviour(str(number), open_client(name, timeouts=Timeouts(cancel=grace)), {})
        for number, name in enumerate(["refusing", "refusing", "refusing", "running", "running"])
    ]
    root = py_trees.composites.Parallel(
        "all", policy=py_trees.common.ParallelPolicy.SuccessOnAll(), children=leaves
    )
    tree = py_trees.trees.BehaviourTree(root)
    tree.setup(timeout=BOUND)
    tree.tick()
    for leaf in leaves:
        server = prompt if leaf.client.action_name == "/running" else stubborn
        server.wait_for("executing", goal_id=str(leaf.future.goal_id))
    tree.shutdown()
    asked = [
        (prompt if leaf.client.action_name == "/running" else stubborn)
        .wait_for("cancel_requested", goal_id=str(leaf.future.goal_id))[0]
        .monotonic
        for leaf in leaves
    ]
    assert max(asked) - min(asked) < grace  # none was waited for before all were asked
    for leaf in leaves[3:]:
        prompt.wait_for("canceled", goal_id=str(leaf.future.goal_id))
        assert leaf.future.known_to_run is False
    assert [leaf.future.known_to_run for leaf in leaves[:3]] == [True] * 3
    stubborn.release(3)


def test_a_tree_that_is_dropped_leaves_no_goal_running(place: Place) -> None:
    server = place.server("running", script=["accept", "never"])
    leaf = ActionBehaviour("a", (Fibonacci, "running"), {"order": 1})
    root = py_trees.composites.Sequence("root", memory=True, children=[leaf])
    tree = py_trees.trees.BehaviourTree(root)
    tree.setup(timeout=BOUND)
    tree.tick()
    goal_id = str(leaf.future.goal_id)
    server.wait_for("executing", goal_id=goal_id)
    del leaf, root, tree
    gc.collect()
    server.wait_for("canceled", goal_id=goal_id)


def test_it_may_be_ticked_by_one_thread_after_the_other(client: Any) -> None:
    leaf = ActionBehaviour("a", client, {"order": 3})

    def one_tick() -> None:
        thread = threading.Thread(target=leaf.tick_once)
        thread.start()
        thread.join()

    while leaf.status is not Status.SUCCESS:
        one_tick()
        assert leaf.status is not Status.FAILURE, leaf.feedback_message
        NEVER.wait(0.01)
    assert leaf.future.outcome(0).attempts == 1


def test_threads_that_tick_at_once_do_not_run_two_goals(
    place: Place, open_client: MakeClient
) -> None:
    """py_trees is not made for it; but no goal runs that the leaf does not know."""
    server = place.server("running", script=["accept", "never"])
    leaf = ActionBehaviour("a", open_client("running"), {"order": 1})
    before = {event.goal_id for event in server.events if event.goal_id}
    together = threading.Barrier(4)

    def tick() -> None:
        together.wait()
        for _ in range(20):
            leaf.tick_once()

    threads = [threading.Thread(target=tick) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    tick_until(leaf, lambda: leaf.future is not None and leaf.future.known_to_run, BOUND)
    leaf.shutdown()
    for goal_id in server.running() - before:
        server.wait_for("canceled", goal_id=goal_id)


def test_one_run_sends_one_goal_whoever_ticks(client: Any) -> None:
    runs = Runs()
    run = runs.begin(None)
    run.start(client, {"order": 2}, None, None)
    goal = run.future
    run.start(client, {"order": 2}, None, None)
    assert run.future is goal
    assert goal is not None
    assert goal.outcome(BOUND).ok
    assert runs.before(runs.begin(None)) == []


def test_a_run_sends_nothing_once_another_has_begun(client: Any, place: Place) -> None:
    """Two threads tick: one has begun a run, and comes to sending after the other one's begin."""
    received = place.server("fibonacci").count("goal_received")
    runs = Runs()
    run = runs.begin(None)
    later = runs.begin(None)
    assert runs.before(run) == [later]
    assert runs.before(later) == []
    run.start(client, {"order": 2}, None, None)
    assert run.future is not None
    assert run.future.outcome(BOUND).attempts <= 1
    assert place.server("fibonacci").count("goal_received") == received


def test_a_run_that_was_given_up_sends_nothing(client: Any, place: Place) -> None:
    received = place.server("fibonacci").count("goal_received")
    runs = Runs()
    run = runs.begin(None)
    runs.close()
    run.start(client, {"order": 2}, None, None)
    assert run.future is not None
    assert run.future.outcome(BOUND).attempts <= 1
    assert run.future.known_to_run is False
    assert place.server("fibonacci").count("goal_received") == received


class Interrupted(BaseException):
    """As KeyboardInterrupt, which pytest would take for its own."""


@pytest.mark.parametrize("begun", [False, True])
def test_an_interrupt_in_the_middle_of_a_tick_leaves_no_goal_unknown(
    begun: bool, client: Any, place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C just before, or just after, the goal is handed over to be sent."""
    begin = client._session.begin

    def interrupted(call: Any) -> None:
        if begun:
            begin(call)
        raise Interrupted

    leaf = ActionBehaviour("a", client, {"order": 40})
    with monkeypatch.context() as patch:
        patch.setattr(client._session, "begin", interrupted)
        with pytest.raises(Interrupted):
            leaf.tick_once()
    future = leaf.future
    leaf.shutdown()
    assert future.outcome(BOUND).error is not None
    assert future.known_to_run is False
    assert str(future.goal_id) not in place.server("fibonacci").running()


def test_an_interrupt_before_a_tick_has_made_its_goal_is_no_goal_that_may_run(
    client: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C when the goal was about to be made, and nothing says that it was not."""

    class Tickets(deque[None]):
        def pop(self) -> None:  # type: ignore[override]
            super().pop()
            raise Interrupted

    leaf = ActionBehaviour("a", client, {"order": 2})
    with monkeypatch.context() as patch:
        patch.setattr("actionkit.trees._runs.deque", Tickets)
        with pytest.raises(Interrupted):
            leaf.tick_once()
    tick_until(leaf, Status.SUCCESS, BOUND)


def test_a_shutdown_by_another_thread_is_final(client: Any, place: Place) -> None:
    """A human stops the tree while it is about to send: `goal` is where the tick stands then."""
    inside, go_on = threading.Event(), threading.Event()

    def slow(leaf: Any) -> Any:
        inside.set()
        go_on.wait(BOUND)
        return {"order": 40}

    received = place.server("fibonacci").count("goal_received")
    leaf = ActionBehaviour("a", client, slow)
    ticking = threading.Thread(target=leaf.tick_once)
    ticking.start()
    inside.wait(BOUND)
    leaf.shutdown()
    go_on.set()
    ticking.join()
    tick_until(leaf, Status.FAILURE, BOUND)
    assert place.server("fibonacci").count("goal_received") == received


# --- what is refused ---------------------------------------------------------------------------

WRONG = {
    "client": ({"client": "fibonacci"}, TypeError, "client='fibonacci' must be a Client"),
    "no action": ({"client": (int, "x")}, TypeError, "no action type"),
    "goal": ({"goal": 5}, TypeError, "goal=5 must be a .*Fibonacci.Goal"),
    "a class": ({"goal": Fibonacci.Goal}, TypeError, "make an instance"),
    "another goal": ({"goal": NestedMessage.Goal()}, TypeError, "NestedMessage"),
    "field": ({"goal": {"order": 1.5}}, TypeError, "order"),
    "unknown field": ({"goal": {"speed": 1}}, ValueError, "speed"),
    "timeout": ({"timeout": -1}, ValueError, "timeout=-1"),
    "server_timeout": ({"server_timeout": "x"}, TypeError, "server_timeout='x'"),
    "retry": ({"retry": 3}, TypeError, "retry=3"),
    "classify": ({"classify": 3}, TypeError, "classify=3"),
    "earlier_goal": ({"earlier_goal": "stop"}, ValueError, "'wait' or 'fail'"),
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


@pytest.mark.parametrize(("key", "error"), [("", ValueError), ("/", ValueError), (3, TypeError)])
def test_a_key_must_be_a_name(key: Any, error: type[Exception]) -> None:
    with pytest.raises(error, match="FromBlackboard key"):
        FromBlackboard(key)
