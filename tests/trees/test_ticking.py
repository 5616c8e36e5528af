"""`tick_until` ticks until its condition is true, wakes when goals end, and has good errors."""

from __future__ import annotations

import time
from typing import Any

import py_trees
import pytest
from py_trees.common import Status

from actionkit.testing import tick_until
from actionkit.trees import ActionBehaviour
from tests.trees.conftest import Place


def test_it_ticks_as_often_as_needed_and_no_more() -> None:
    counted = py_trees.behaviours.TickCounter("count", duration=3, completion_status=Status.SUCCESS)
    assert tick_until(counted, Status.SUCCESS, period=0.001) == 4
    tree = py_trees.trees.BehaviourTree(py_trees.behaviours.Running("never"))
    assert tick_until(tree, Status.RUNNING) == 1
    assert tree.count == 1
    assert tick_until(tree, lambda: tree.count >= 3, period=0.001) == 2


def test_the_end_of_a_goal_wakes_it(place: Place) -> None:
    place.server("fibonacci", "fibonacci", period=0.01)
    leaf = ActionBehaviour("a", place.client("fibonacci"), {"order": 5})
    began = time.monotonic()
    assert tick_until(leaf, Status.SUCCESS, 60.0, period=50.0) == 2
    assert time.monotonic() - began < 40


@pytest.mark.parametrize("given", [{"timeout": float("nan")}, {"period": -1}, {"period": "1"}])
def test_a_time_that_is_none_is_refused(given: Any) -> None:
    with pytest.raises((TypeError, ValueError), match="seconds"):
        tick_until(py_trees.behaviours.Running("never"), Status.SUCCESS, **given)


def test_it_says_what_the_tree_is_instead() -> None:
    never = py_trees.behaviours.Running("the one that never ends")
    with pytest.raises(TimeoutError, match=r"RUNNING, and not SUCCESS within 0.01 s") as caught:
        tick_until(never, Status.SUCCESS, 0.01, period=0.005)
    assert isinstance(caught.value, AssertionError)
    assert "the one that never ends" in str(caught.value)
    failing = py_trees.behaviours.Failure("fails")
    with pytest.raises(AssertionError, match="FAILURE, and not SUCCESS, after 1 ticks"):
        tick_until(failing, Status.SUCCESS)
