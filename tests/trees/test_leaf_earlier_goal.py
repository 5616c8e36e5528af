"""A new run of a leaf, and the goal of the run before it."""

from __future__ import annotations

import itertools
import os
from pathlib import Path
from typing import Any

import pytest
from py_trees.common import Status
from test_msgs.action import Fibonacci

from actionkit import GoalState, Ledger, RetryPolicy, Timeouts
from actionkit._ros.servers_in_sight.monitor import _IN_SIGHT_WITHIN
from actionkit.servers import _process
from actionkit.testing import tick_until
from actionkit.trees import ActionBehaviour
from tests.client.test_two_servers import BUSY
from tests.conftest import NEVER
from tests.trees.conftest import BOUND, MakeClient, Place, received


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


def test_or_the_server_stops_it_when_the_new_goal_comes(
    place: Place, open_client: MakeClient
) -> None:
    """A joint_trajectory_controller may leave a cancelled goal CANCELING until then."""
    server = place.server("preempting", "slow_cancel", gate=1)
    client = open_client("preempting")
    leaf = ActionBehaviour("a", client, {"order": 1}, earlier_goal="preempt")
    tick_until(leaf, lambda: leaf.future.known_to_run, BOUND)
    first = leaf.future
    leaf.stop(Status.INVALID)
    leaf.tick_once()
    assert leaf.future not in (None, first)
    server.wait_for("executing", goal_id=str(leaf.future.goal_id))
    server.wait_for("cancel_accepted", goal_id=str(first.goal_id))
    assert not first.done()
    server.release()
    assert first.outcome(BOUND).status is GoalState.REPLACED
    leaf.stop(Status.INVALID)
    assert leaf.future.outcome(BOUND).status is GoalState.CANCELED
    assert received(server) == 2


def test_a_goal_with_a_key_is_sent_once(
    place: Place, open_client: MakeClient, tmp_path: Path
) -> None:
    server = place.server("keyed", "fibonacci")
    client = open_client("keyed", ledger=Ledger(tmp_path / "goals.db"))
    legs = iter(["leg-1", "leg-1", "leg-2"])
    leaf = ActionBehaviour("a", client, {"order": 1}, key=lambda: next(legs))
    for sent in (1, 1, 2):
        tick_until(leaf, lambda: leaf.status is Status.SUCCESS, BOUND)
        assert received(server) == sent
        leaf.stop(Status.INVALID)


def test_a_key_in_other_hands_is_a_failure(
    place: Place, open_client: MakeClient, tmp_path: Path
) -> None:
    server = place.server("keyed_and_busy", "never_finishes")
    client = open_client("keyed_and_busy", ledger=Ledger(tmp_path / "goals.db"))
    future = client.call_async({"order": 1}, key="leg")
    leaf = ActionBehaviour("a", client, {"order": 1}, key="leg")
    leaf.tick_once()
    assert leaf.status is Status.FAILURE
    assert "is in the hands of another call of this process" in leaf.feedback_message
    server.wait_for("executing")
    future.cancel()
    assert future.outcome(BOUND).status is GoalState.CANCELED
    assert received(server) == 1


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


def test_a_goal_that_was_lost_with_its_server_does_not_hold_up_the_next(
    place: Place, open_client: MakeClient
) -> None:
    server = place.server("dying", script=["accept", "never"])
    leaf = ActionBehaviour("a", open_client("dying", timeouts=Timeouts(server=60.0)), {"order": 1})
    leaf.tick_once()
    server.wait_for("executing", goal_id=str(leaf.future.goal_id))
    lost = leaf.future
    server.terminate()
    tick_until(leaf, Status.FAILURE, BOUND)
    assert lost.known_to_run is None
    assert f"{lost.goal_id} of this call MAY STILL BE RUNNING" in leaf.feedback_message
    # The next run waits for a server, and not for news of the lost goal.
    leaf.tick_once()
    assert leaf.future is not None
    server.restart()
    tick_until(leaf, lambda: leaf.future.known_to_run, BOUND)
    server.wait_for("executing", goal_id=str(leaf.future.goal_id))
    # A server that does not know the lost goal proves nothing (C5.7).
    assert lost.known_to_run is None


@pytest.mark.long
@pytest.mark.parametrize("earlier_goal", ["wait", "preempt"])
def test_a_goal_of_a_server_that_is_only_silent_holds_up_the_next(
    earlier_goal: Any, place: Place, open_client: MakeClient
) -> None:
    server = place.server(f"mute_{earlier_goal}", script=["accept", "never"])
    client = open_client(server.action_name, timeouts=Timeouts(server=1.0, liveness=1.0))
    leaf = ActionBehaviour("a", client, {"order": 1}, earlier_goal=earlier_goal)
    leaf.tick_once()
    server.wait_for("executing", goal_id=str(leaf.future.goal_id))
    lost = leaf.future
    server.pause()
    try:
        tick_until(leaf, Status.FAILURE, BOUND)
        assert "answered nothing" in leaf.feedback_message
        leaf.tick_once()
        assert leaf.future is None
        tick_until(leaf, Status.FAILURE, BOUND)
        assert f"{lost.goal_id} of this behaviour MAY STILL BE RUNNING" in leaf.feedback_message
    finally:
        server.resume()
    server.wait_for("canceled", goal_id=str(lost.goal_id))
    tick_until(leaf, lambda: leaf.future is not None and leaf.future.known_to_run, BOUND)
    assert server.max_running == 1


@pytest.mark.long
def test_so_does_that_of_a_busy_server_that_was_started_twice(
    run_script: Any, action_server: Any, make_client: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_process, "_instances", itertools.repeat("twice"))
    first = run_script(BUSY, f"reference_server_{os.getpid()}_twice")
    assert first.line() == "up"
    policy = RetryPolicy(attempts=1, resend="server_gone")
    leaf = ActionBehaviour("a", make_client(retry=policy), {"order": 1})
    tick_until(leaf, lambda: leaf.future.known_to_run, BOUND)
    lost = leaf.future
    NEVER.wait(2 * _IN_SIGHT_WITHIN)  # one that comes sooner may have got the goal, too
    second = action_server("fibonacci")
    tick_until(leaf, Status.FAILURE, BOUND)
    assert "it was restarted, or started twice" in leaf.feedback_message
    leaf.tick_once()
    assert leaf.future is None
    assert f"waits for news of the earlier goal {lost.goal_id}" in leaf.feedback_message
    assert first.finish()[0] == 0
    tick_until(leaf, Status.SUCCESS, BOUND)
    second.sync()
    assert second.count("goal_received") == 1


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


def test_a_goal_that_its_client_lost_touch_with_is_not_run_beside_another(place: Place) -> None:
    """The client's own thread dies, and the tree is set up once more, which makes a new client."""
    server = place.server("lasting", script=["accept", "never"])
    leaf = ActionBehaviour("a", (Fibonacci, "lasting"), {"order": 1})
    leaf.setup()
    tick_until(leaf, lambda: leaf.future.known_to_run, BOUND)
    lost, client = leaf.future, leaf._hold.client
    runtime = client._session.connection.runtime
    runtime.run(lambda: setattr(runtime, "_broken", MemoryError("for the test")))
    assert lost.exception(BOUND) is not None
    assert lost.known_to_run is None
    tick_until(leaf, Status.FAILURE, BOUND)
    tick_until(leaf, lambda: "the client is closed" in leaf.feedback_message, BOUND)
    leaf.setup()
    assert leaf._hold.client is not client
    tick_until(
        leaf, lambda: f"{lost.goal_id} of this behaviour MAY" in leaf.feedback_message, BOUND
    )
    assert server.max_running == 1
    leaf.shutdown()
