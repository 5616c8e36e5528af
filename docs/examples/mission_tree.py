"""A mission as a behaviour tree: drive to a shelf, pick, drive home, dock; charge when needed.

    python docs/examples/mission_tree.py [LOG]

It starts reference servers that stand for the robot, and writes the log of all goals into LOG.
"""

from __future__ import annotations

import operator
import sys
import time
from typing import Any

import py_trees
from py_trees.behaviours import CheckBlackboardVariableValue, SetBlackboardVariable
from py_trees.blackboard import Blackboard
from py_trees.common import ComparisonExpression, Status
from test_msgs.action import Fibonacci, NestedMessage

from actionkit import Client, JsonLines, cancel_on_signals, servers
from actionkit.trees import ActionBehaviour, FromBlackboard

SHELF = {"nested_field": {"float64_value": 3.0}}  # metres to drive
HOME = {"nested_field": {"float64_value": 1.0}}


def mission(navigate: Client[Any], pick: Client[Any], dock: Any) -> Any:
    """Return the root of the tree; the clients are yours."""
    charge = py_trees.composites.Sequence(
        "charge",
        memory=False,
        children=[
            CheckBlackboardVariableValue(
                "battery low?", ComparisonExpression("battery", 20.0, operator.lt)
            ),
            ActionBehaviour("charge at dock", dock, {"order": 8}, timeout=60.0),
            SetBlackboardVariable("battery full", "battery", 100.0, overwrite=True),
        ],
    )
    work = py_trees.composites.Sequence(
        "work",
        memory=True,
        children=[
            ActionBehaviour(
                "to the shelf", navigate, FromBlackboard("shelf"), feedback_key="driving"
            ),
            py_trees.decorators.Retry(
                "up to three times",
                ActionBehaviour("pick", pick, {"order": 4}, timeout=20.0),
                num_failures=3,
            ),
            ActionBehaviour("home", navigate, HOME),
            ActionBehaviour("dock", dock, {"order": 3}, timeout=60.0),
        ],
    )
    # Charging is not the end of the mission: it goes on when the battery is not low any more.
    first = py_trees.decorators.SuccessIsRunning("then go on", charge)
    # Without a memory: each tick asks for the battery first. Where that is low, `work` is
    # interrupted, and its goal cancelled; the leaf says when the goal has stopped.
    return py_trees.composites.Selector("robot", memory=False, children=[first, work])


def use_battery(tree: py_trees.trees.BehaviourTree) -> None:
    """Let the battery run low once, half-way to the shelf. A real one has a subscription."""
    once_low = Blackboard.exists("once_low") and Blackboard.get("once_low")
    if not once_low and Blackboard.exists("driving"):
        percent = Blackboard.get("driving").nested_field.float32_value
        if percent >= 50.0:
            Blackboard.set("battery", 15.0)
            Blackboard.set("once_low", True)


def main(log: str) -> None:
    """Run the mission once."""
    Blackboard.set("battery", 90.0)
    Blackboard.set("shelf", SHELF)
    observer = JsonLines(log)
    with (
        servers.start("navigate", action_name="navigate", speed=4.0, rate=20.0),
        servers.start("flaky", action_name="pick", fails=1, period=0.03),
        servers.start("fibonacci", action_name="dock", period=0.05),
        Client(NestedMessage, "navigate", observers=[observer]) as navigate,
        Client(Fibonacci, "pick", observers=[observer]) as pick,
        Client(Fibonacci, "dock", observers=[observer]) as dock,
        cancel_on_signals(),
    ):
        for client in (navigate, pick, dock):
            client.wait_for_server(20.0)
        tree = py_trees.trees.BehaviourTree(mission(navigate, pick, dock))
        tree.setup(timeout=20.0)
        tree.add_pre_tick_handler(use_battery)
        shown = ""
        try:
            while tree.root.status is not Status.SUCCESS:
                tree.tick()
                tip = tree.tip()
                now = "" if tip is None else tip.name
                if now != shown:
                    shown = now
                    print(py_trees.display.unicode_tree(tree.root, show_status=True))
                time.sleep(0.02)
        finally:
            tree.shutdown()  # also after Ctrl-C: cancels what runs, and waits for it
    observer.close()
    print("mission", tree.root.status.name)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "mission.jsonl")
