"""How a leaf ends with its tree, its thread, or in the middle of a tick."""

from __future__ import annotations

import gc
import threading
import uuid
from collections import deque
from types import SimpleNamespace
from typing import Any, cast

import py_trees
import pytest
from py_trees.common import Status
from test_msgs.action import Fibonacci

from actionkit import GoalFuture, Timeouts
from actionkit._calls.ending.closing import MARGIN
from actionkit._calls.futures.call_view import GoalsOfCall
from actionkit._goal.facts import GoalFacts
from actionkit.testing import tick_until
from actionkit.trees import ActionBehaviour
from actionkit.trees._runs import Run, Runs
from tests.conftest import NEVER
from tests.trees.conftest import BOUND, MakeClient, Place, received


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


@pytest.mark.long
def test_ctrl_c_ends_the_wait_of_a_shutdown_and_the_clients_are_closed(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A human does not want to wait for a server that does not stop its goal."""
    server = place.server("refusing", script=["refuse_cancel", "accept", "gate", "succeed"])
    place.server("fibonacci", "fibonacci", period=0.02)
    first = ActionBehaviour("a", (Fibonacci, "refusing"), {})
    second = ActionBehaviour("b", (Fibonacci, "fibonacci"), {"order": 40})
    root = py_trees.composites.Parallel(
        "both", policy=py_trees.common.ParallelPolicy.SuccessOnAll(), children=[first, second]
    )
    tree = py_trees.trees.BehaviourTree(root)
    tree.setup(timeout=BOUND)
    tick_until(tree, lambda: first.future.known_to_run and second.future.known_to_run, BOUND)
    clients = [first.client, second.client]
    wait, waits = GoalFuture._wait_until_over, []

    def interrupted_once(future: GoalFuture[Any, Any], seconds: float) -> bool:
        waits.append(seconds)
        if len(waits) == 1:
            raise KeyboardInterrupt
        return wait(future, seconds)

    monkeypatch.setattr(GoalFuture, "_wait_until_over", interrupted_once)
    with pytest.raises(KeyboardInterrupt):
        tree.shutdown()
    assert [client.closed for client in clients] == [True, True]
    assert waits[0] > clients[0].timeouts.cancel > MARGIN >= max(waits[1:], default=0.0)
    server.release(1)


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


@pytest.mark.long
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
    before = received(place.server("fibonacci"))
    runs = Runs()
    run = runs.begin(None)
    later = runs.begin(None)
    assert runs.before(run) == [later]
    assert runs.before(later) == []
    run.start(client, {"order": 2}, None, None)
    assert run.future is not None
    assert run.future.outcome(BOUND).attempts <= 1
    assert received(place.server("fibonacci")) == before


def test_a_run_that_was_given_up_sends_nothing(client: Any, place: Place) -> None:
    before = received(place.server("fibonacci"))
    runs = Runs()
    run = runs.begin(None)
    runs.close()
    run.start(client, {"order": 2}, None, None)
    assert run.future is not None
    assert run.future._call.unwanted
    assert run.future.outcome(BOUND).attempts <= 1
    assert run.future.known_to_run is False
    assert received(place.server("fibonacci")) == before


def test_of_two_threads_that_begin_a_run_one_sees_the_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    runs = Runs()
    first = runs.begin(None)
    inner: list[Run] = []

    def another_thread_begins() -> None:
        monkeypatch.undo()
        inner.append(runs.begin(None))

    monkeypatch.setattr(first, "give_up", another_thread_begins)
    outer = runs.begin(None)
    assert outer.unwanted or inner[0].unwanted


def test_a_goal_whose_start_is_interrupted_is_cancelled(monkeypatch: pytest.MonkeyPatch) -> None:
    """It may have begun, and the tree may go on with another branch."""
    asked: list[str] = []
    future = SimpleNamespace(done=lambda: False, cancel=lambda: asked.append("cancel"))

    def begin() -> None:
        raise Interrupted

    monkeypatch.setattr("actionkit.trees._runs.prepare_call", lambda *_, **__: (future, begin))
    run = Run(None)
    with pytest.raises(Interrupted):
        run.start(cast(Any, None), {}, None, None)
    assert run.unwanted
    assert run.future is cast(Any, future)
    assert asked == ["cancel"]


def test_a_forked_process_leaves_the_goals_to_its_parent(monkeypatch: pytest.MonkeyPatch) -> None:
    runs = Runs()
    run = runs.begin(None)
    with monkeypatch.context() as forked:
        forked.setattr("os.getpid", lambda: -1)
        runs.close()
    assert not run.unwanted
    runs.close()
    assert run.unwanted


def test_a_goal_that_stopped_does_not_count_while_its_call_may_send_another() -> None:
    run = Run(None)
    future = SimpleNamespace(done=lambda: False, known_to_run=False)
    run.future = cast(Any, future)
    assert run.known_to_run is None


@pytest.mark.parametrize(("known", "now"), [(True, None), (False, False)])
def test_of_a_goal_whose_client_was_closed_only_its_end_is_known(
    known: bool | None, now: bool | None
) -> None:
    run = Run(None)
    run.future = cast(Any, SimpleNamespace(done=lambda: True, known_to_run=known))
    run._client = cast(Any, SimpleNamespace(closed=False))
    assert run.known_to_run is known
    run._client = cast(Any, SimpleNamespace(closed=True))
    assert run.known_to_run is now


@pytest.mark.parametrize(
    ("known", "facts", "holds_up"),
    [
        (True, {"accepted": True}, True),
        (False, {"accepted": True, "ended": True, "over": True}, False),
        (None, {"accepted": True, "lost": True}, True),
        (None, {"accepted": True, "lost": True, "servers_gone": True}, False),
    ],
)
@pytest.mark.every
def test_which_earlier_goal_holds_up_a_run(
    known: bool | None, facts: dict[str, Any], holds_up: bool
) -> None:
    """Where nothing is known of it, only the graph can say that it does not."""
    goals = GoalsOfCall([GoalFacts(uuid.uuid4(), **facts)])
    call = SimpleNamespace(goals=goals)
    run = Run(None)
    run.future = cast(
        Any, SimpleNamespace(done=lambda: True, known_to_run=goals.known_to_run, _call=call)
    )
    run._client = cast(Any, SimpleNamespace(closed=False))
    assert run.known_to_run is known
    assert run.holds_up is holds_up


def test_only_a_goal_of_the_same_client_is_preempted() -> None:
    """The other client may be in another domain, where the server does not see the new goal."""
    run = Run(None)
    own, other = cast(Any, object()), cast(Any, object())
    run._client, run.future = own, cast(Any, SimpleNamespace(done=lambda: False))
    assert run.stops_for_another(own)
    assert not run.stops_for_another(other)


def test_a_leaf_that_was_shut_down_sends_nothing(client: Any, place: Place) -> None:
    before = received(place.server("fibonacci"))
    leaf = ActionBehaviour("a", client, {"order": 2})
    leaf.shutdown()
    leaf.tick_once()
    assert leaf.status is Status.FAILURE
    assert leaf.feedback_message.startswith("nothing was sent, because the tree was shut down")
    assert received(place.server("fibonacci")) == before


class Interrupted(BaseException):
    """As KeyboardInterrupt, which pytest would take for its own."""


@pytest.mark.long
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
    place.server("fibonacci").sync()
    assert str(future.goal_id) not in place.server("fibonacci").running()


@pytest.mark.long
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


@pytest.mark.long
def test_a_shutdown_by_another_thread_is_final(client: Any, place: Place) -> None:
    """A human stops the tree while it is about to send: `goal` is where the tick stands then."""
    inside, go_on = threading.Event(), threading.Event()

    def slow(leaf: Any) -> Any:
        inside.set()
        go_on.wait(BOUND)
        return {"order": 40}

    before = received(place.server("fibonacci"))
    leaf = ActionBehaviour("a", client, slow)
    ticking = threading.Thread(target=leaf.tick_once)
    ticking.start()
    inside.wait(BOUND)
    leaf.shutdown()
    go_on.set()
    ticking.join()
    tick_until(leaf, Status.FAILURE, BOUND)
    assert received(place.server("fibonacci")) == before
