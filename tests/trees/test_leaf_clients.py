"""The clients of leaves: made, shared, given, closed."""

from __future__ import annotations

from typing import Any

import py_trees
import pytest
from py_trees.common import Status
from test_msgs.action import Fibonacci

from actionkit import ServerUnavailableError
from actionkit.testing import isolated_domain, tick_until
from actionkit.trees import ActionBehaviour
from actionkit.trees._clients import ClientHold
from tests.trees.conftest import BOUND, MakeClient, Place


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


@pytest.mark.long
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


@pytest.mark.long
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
