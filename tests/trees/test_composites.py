"""Decorators and composites of py_trees work with goals; random trees leave no goal running."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from typing import Any

import py_trees
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from py_trees.common import OneShotPolicy, ParallelPolicy, Status

from actionkit import Outcome, Verdict
from actionkit.testing import tick_until
from actionkit.trees import ActionBehaviour
from tests.conftest import NEVER
from tests.hunting import examples
from tests.trees.conftest import BOUND, Place

ENDS = ("succeeded", "canceled", "aborted")

#: Servers for the random trees: name, and options.
KINDS: dict[str, tuple[str, dict[str, Any]]] = {
    "works": ("fibonacci", {"period": 0.005}),
    "fails": ("scripted", {"script": ["accept", {"wait": 0.01}, "abort"]}),
    "late": ("scripted", {"script": [{"accept_after": 0.03}, {"wait": 0.02}, "succeed"]}),
    "slow": ("scripted", {"script": [{"cancel_after": 0.03}, "accept", {"wait": 0.1}, "succeed"]}),
    "stubborn": ("scripted", {"script": ["refuse_cancel", "accept", {"wait": 0.05}, "succeed"]}),
}


def leaf_of(place: Place, kind: str, order: int = 3, **options: Any) -> Any:
    name, given_options = KINDS[kind]
    place.server(kind, name, **given_options)
    return ActionBehaviour(kind, place.client(kind), {"order": order}, **options)


def sent(leaf: Any, seen: list[Any]) -> None:
    """Note the goal that a leaf has sent, if it is another one."""
    if leaf.future is not None and leaf.future not in seen:
        seen.append(leaf.future)


def test_retry_sends_another_goal_after_each_failure(place: Place) -> None:
    leaf = leaf_of(place, "fails")
    root = py_trees.decorators.Retry("root", leaf, num_failures=3)
    goals: list[Any] = []

    def failed() -> bool:
        sent(leaf, goals)
        return root.status is Status.FAILURE

    tick_until(root, failed, BOUND)
    assert len(goals) == 3
    assert [goal.outcome(0).attempts for goal in goals] == [1, 1, 1]


@pytest.mark.long
def test_one_shot_sends_one_goal_ever(place: Place) -> None:
    leaf = leaf_of(place, "works")
    root = py_trees.decorators.OneShot("root", leaf, policy=OneShotPolicy.ON_COMPLETION)
    tick_until(root, Status.SUCCESS, BOUND)
    goal = leaf.future
    for _ in range(3):
        root.tick_once()
    assert root.status is Status.SUCCESS
    assert leaf.future is goal


@pytest.mark.parametrize("memory", [True, False])
def test_a_sequence_sends_again_only_what_it_ticks_again(place: Place, memory: bool) -> None:
    first, second = leaf_of(place, "works", order=2), leaf_of(place, "works", order=30)
    root = py_trees.composites.Sequence("root", memory, children=[first, second])
    tick_until(root, lambda: second.future is not None, BOUND)
    goal = first.future
    root.tick_once()
    # Without a memory the first child is asked anew in each tick, which is another goal. While that
    # runs the second is interrupted.
    assert (first.future is goal) == memory
    assert second.status is (Status.RUNNING if memory else Status.INVALID)
    root.stop(Status.INVALID)
    assert second.future.outcome(BOUND).cancel is not None


@pytest.mark.long
@pytest.mark.parametrize("all_of_them", [True, False])
def test_a_parallel_ends_by_its_policy(place: Place, all_of_them: bool) -> None:
    quick, slow = leaf_of(place, "works", order=1), leaf_of(place, "works", order=25)
    every, one = ParallelPolicy.SuccessOnAll(), ParallelPolicy.SuccessOnOne()
    root = py_trees.composites.Parallel("root", every if all_of_them else one, [quick, slow])
    tick_until(root, Status.SUCCESS, BOUND)
    assert quick.future.outcome(BOUND).ok
    assert slow.future.outcome(BOUND).ok == all_of_them
    assert slow.future.known_to_run is False


# --- random trees ------------------------------------------------------------------------------


class Flag(py_trees.behaviour.Behaviour):
    """Succeeds or fails as the story says."""

    def __init__(self, flags: dict[str, bool]) -> None:
        super().__init__("flag")
        self.flags = flags

    def update(self) -> Status:
        if self.flags["broken"]:
            raise BrokenPipeError("a behaviour of the user's raises in the middle of a tick")
        return Status.SUCCESS if self.flags["fine"] else Status.FAILURE


def retry_aborted_once(outcome: Outcome[Any]) -> Verdict | None:
    return Verdict.TRANSIENT if outcome.error and outcome.attempts == 1 else None


LEAVES = st.tuples(
    st.sampled_from(list(KINDS)), st.integers(-1, 8), st.sampled_from(["wait", "fail"])
)
SHAPES: Any = st.recursive(
    st.one_of(LEAVES, st.just("flag")),
    lambda inner: st.one_of(
        st.tuples(
            st.sampled_from(["sequence", "selector"]),
            st.booleans(),
            st.lists(inner, min_size=1, max_size=3),
        ),
        st.tuples(st.just("parallel"), st.booleans(), st.lists(inner, min_size=1, max_size=3)),
        st.tuples(
            st.sampled_from(["timeout", "retry", "once", "inverter", "guard"]),
            st.sampled_from([0.0, 0.02, 0.05]),
            inner,
        ),
    ),
    max_leaves=6,
)
STORIES = st.lists(
    st.sampled_from(
        [*["tick"] * 4, "pause", "long pause", "flip", "stop", "break", "again", "prune"],
    ),
    min_size=3,
    max_size=20,
)


def grown(shape: Any, place: Place, flags: dict[str, bool], leaves: list[Any]) -> Any:
    """Return the behaviour of a shape, and note its leaves."""
    if shape == "flag":
        return Flag(flags)
    if shape[0] in KINDS:
        kind, order, earlier = shape
        options = {"earlier_goal": earlier, "classify": retry_aborted_once}
        leaves.append(leaf_of(place, kind, max(order, 0) if kind != "works" else order, **options))
        return leaves[-1]
    word, value, inner = shape
    if isinstance(inner, list):
        children = [grown(one, place, flags, leaves) for one in inner]
        if word == "parallel":
            policy = ParallelPolicy.SuccessOnOne() if value else ParallelPolicy.SuccessOnAll(False)
            return py_trees.composites.Parallel(word, policy, children)
        kind = py_trees.composites.Sequence if word == "sequence" else py_trees.composites.Selector
        return kind(word, memory=value, children=children)
    child = grown(inner, place, flags, leaves)
    decorators: dict[str, Callable[[], Any]] = {
        "timeout": lambda: py_trees.decorators.Timeout(word, child, duration=value),
        "retry": lambda: py_trees.decorators.Retry(word, child, num_failures=2),
        "once": lambda: py_trees.decorators.OneShot(word, child, OneShotPolicy.ON_COMPLETION),
        "inverter": lambda: py_trees.decorators.Inverter(word, child),
        "guard": lambda: py_trees.decorators.EternalGuard(
            word, child, condition=lambda: flags["fine"]
        ),
    }
    return decorators[word]()


def spans(server: Any, call: Any) -> list[tuple[float, float]]:
    """Return when the goals of a call began and ended on their server, as its journal tells."""
    found = []
    for goal_id in {str(event.goal_id) for event in call.timeline if event.state.name == "SENT"}:
        server.wait_for("goal_received", goal_id=goal_id)
        while not (ended := times(server, goal_id, "rejected", *ENDS)):
            assert call.known_to_run is False, "the client does not take for over what is not"
            NEVER.wait(0.01)
        if accepted := times(server, goal_id, "accepted"):
            found.append((accepted[0], ended[0]))
    return found


def times(server: Any, goal_id: str, *names: str) -> list[float]:
    return [e.monotonic for e in server.events if e.goal_id == goal_id and e.event in names]


@pytest.mark.long
@settings(examples(60), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(shape=SHAPES, story=STORIES)
def test_whatever_happens_no_goal_runs_on_and_no_leaf_runs_two(
    place: Place, shape: Any, story: list[str]
) -> None:
    flags, leaves = {"fine": True, "broken": False}, list[Any]()
    root = grown(shape, place, flags, leaves)
    tree = py_trees.trees.BehaviourTree(root)
    tree.setup()
    goals: list[list[Any]] = [[] for _ in leaves]
    for step in story:
        if step in ("tick", "break"):
            flags["broken"] = step == "break"
            # The latter is py_trees' own, where the child that a memory led to was pruned.
            with suppress(BrokenPipeError, AssertionError):
                tree.tick()
            for leaf, seen in zip(leaves, goals, strict=True):
                sent(leaf, seen)
        elif step == "flip":
            flags["fine"] = not flags["fine"]
        elif step == "stop":
            root.stop(Status.INVALID)
        elif step == "again":
            tree.shutdown()
            tree.setup()
        elif step == "prune":
            for part in list(root.iterate()):
                if isinstance(part.parent, py_trees.composites.Composite):
                    tree.prune_subtree(part.id)
                    break
        else:
            NEVER.wait(0.03 if step == "long pause" else 0.008)
    tree.shutdown()
    for leaf, seen in zip(leaves, goals, strict=True):
        server = place.servers[leaf.name]
        for goal in seen:
            goal.outcome(BOUND)
        ran = sorted(span for goal in seen for span in spans(server, goal))
        assert all(before[1] <= after[0] for before, after in pairwise(ran)), ran
    for kind, server in place.servers.items():
        for goal_id in server.running():
            event = "succeeded" if kind == "stubborn" else "canceled"
            server.wait_for(event, goal_id=goal_id)
