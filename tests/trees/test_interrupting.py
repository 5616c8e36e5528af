"""Each way to give up on a goal in a tree, in each phase of the goal, as the server sees it."""

from __future__ import annotations

import gc
import signal
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import py_trees
import pytest
from py_trees.common import ParallelPolicy, Status
from test_msgs.action import Fibonacci

from actionkit.servers import Server
from actionkit.testing import tick_until
from actionkit.trees import ActionBehaviour
from tests import forked
from tests.conftest import Script
from tests.tables import Page
from tests.trees.conftest import BOUND, Place, fate

NOBODY = "no server is there"
UNANSWERED = "sent, not answered"
RUNNING = "executing"
REFUSING = "executing, the server refuses to cancel"
ENDED = "ended, not ticked since"
PHASES = (NOBODY, UNANSWERED, RUNNING, REFUSING, ENDED)

PAGE = Page("behaviour-trees.md", {"interrupted": [(phase,) for phase in PHASES]})
"""One table for all ways to interrupt a tree: the same has to reach the server."""

SCRIPTS = {
    UNANSWERED: ["gate", "accept", "never"],
    RUNNING: ["accept", "never"],
    REFUSING: ["refuse_cancel", "accept", "gate", "succeed"],
    ENDED: ["accept", "gate", "succeed"],
}
ACTIONS = {phase: f"phase_{number}" for number, phase in enumerate(PHASES)}


def record(phase: str, reached: str, ended: str) -> None:
    """Compare a row with the page."""
    PAGE.record("interrupted", {(phase,): (reached, ended)})


class Always(py_trees.behaviour.Behaviour):
    """Has the status that the test says."""

    def __init__(self, status: Status) -> None:
        super().__init__("flag")
        self.is_now = status

    def update(self) -> Status:
        return self.is_now


Interrupt = Callable[[], object]


def selector(leaf: Any) -> tuple[Any, Interrupt]:
    urgent = Always(Status.FAILURE)
    root = py_trees.composites.Selector("root", memory=False, children=[urgent, leaf])

    def interrupt() -> None:
        urgent.is_now = Status.RUNNING
        root.tick_once()

    return root, interrupt


def timeout(leaf: Any) -> tuple[Any, Interrupt]:
    root = py_trees.decorators.Timeout("root", leaf, duration=1000.0)

    def interrupt() -> None:
        root.finish_time = 0.0
        root.tick_once()

    return root, interrupt


def guard(leaf: Any) -> tuple[Any, Interrupt]:
    fine = [True]
    root = py_trees.decorators.EternalGuard("root", leaf, condition=lambda: fine[0])

    def interrupt() -> None:
        fine[0] = False
        root.tick_once()

    return root, interrupt


def parallel(leaf: Any) -> tuple[Any, Interrupt]:
    other = Always(Status.RUNNING)
    policy = ParallelPolicy.SuccessOnOne()
    root = py_trees.composites.Parallel("root", policy, children=[other, leaf])

    def interrupt() -> None:
        other.is_now = Status.SUCCESS
        root.tick_once()

    return root, interrupt


def stop(leaf: Any) -> tuple[Any, Interrupt]:
    root = py_trees.composites.Sequence("root", memory=True, children=[leaf])
    return root, lambda: root.stop(Status.INVALID)


def shutdown(leaf: Any) -> tuple[Any, Interrupt]:
    root = py_trees.composites.Sequence("root", memory=True, children=[leaf])
    tree = py_trees.trees.BehaviourTree(root)

    def interrupt() -> None:
        tree.shutdown()
        leaf.setup()  # so that it can be ticked again

    return root, interrupt


TREES = {
    "a selector turns to a child of higher priority": selector,
    "the time of a Timeout decorator is up": timeout,
    "the condition of an EternalGuard fails": guard,
    "another child ends a Parallel with SuccessOnOne": parallel,
    "root.stop(INVALID)": stop,
    "tree.shutdown()": shutdown,
}


def reach(phase: str, root: Any, leaf: Any, server: Server | None) -> None:
    """Tick until the goal is in a phase."""
    root.tick_once()
    assert leaf.status is Status.RUNNING
    goal_id = str(leaf.future.goal_id)
    if server is None:
        return
    if phase == UNANSWERED:
        server.wait_for("goal_received", goal_id=goal_id)
    else:
        server.wait_for("executing", goal_id=goal_id)
        tick_until(root, lambda: leaf.future.known_to_run, BOUND)
    if phase == ENDED:
        server.release(1)
        assert leaf.future.outcome(BOUND).ok
        assert leaf.status is Status.RUNNING


def reached(phase: str, server: Server | None, goal_id: str) -> tuple[str, str]:
    """Let the server do what it does of its own, and return what reached it and how it ended."""
    if server is None:
        return "nothing", "-"
    if phase in (UNANSWERED, REFUSING):
        server.wait_for("cancel_requested", goal_id=goal_id)
        server.release(1)
    end = "succeeded" if phase in (REFUSING, ENDED) else "canceled"
    server.wait_for(end, goal_id=goal_id)
    seen = fate(server, goal_id)
    words = ["the goal"] if "goal_received" in seen else []
    if "cancel_requested" in seen:
        words.append("the cancel" if phase != REFUSING else "the cancel, which is refused")
    return "; ".join(words), end  # a cancel that was repeated may come after it


def serve(phase: str, place: Place) -> Server | None:
    return place.server(ACTIONS[phase], script=SCRIPTS[phase]) if phase in SCRIPTS else None


@pytest.mark.parametrize("way", TREES.values(), ids=TREES)
@pytest.mark.every
def test_a_tree_that_gives_up(way: Callable[[Any], tuple[Any, Interrupt]], place: Place) -> None:
    for phase in PHASES:
        server, action = serve(phase, place), ACTIONS[phase]
        leaf = ActionBehaviour("leaf", place.client(action), {"order": 1})
        root, interrupt = way(leaf)
        reach(phase, root, leaf, server)
        first, goal_id = leaf.future, str(leaf.future.goal_id)
        interrupt()
        root.parent = leaf.parent = None  # the leaf goes on alone
        if way is shutdown:
            leaf.stop(Status.INVALID)  # py_trees leaves the statuses as they are
        if phase != ENDED:
            assert leaf.status is Status.INVALID
            if server is not None:  # before the next run begins, which would cancel it, too
                server.wait_for("cancel_requested", goal_id=goal_id)
            leaf.tick_once()
        what, ended = reached(phase, server, goal_id)
        leaf.stop(Status.INVALID)
        tick_until(leaf, lambda: leaf.future not in (None, first), BOUND)  # noqa: B023
        if server is not None:
            again = server.wait_for("goal_received", goal_id=str(leaf.future.goal_id))[0]
            over = server.wait_for(ended, goal_id=goal_id)[0]
            assert over.monotonic < again.monotonic, (
                "the next goal was sent before the end of the first"
            )
        leaf.future.cancel()
        if phase in (UNANSWERED, REFUSING, ENDED) and server is not None:
            server.release(1)
        if server is not None:
            until = "canceled" if phase in (UNANSWERED, RUNNING) else "executing"
            server.wait_for(until, goal_id=str(leaf.future.goal_id))
        record(phase, what, ended)  # last, as it may raise


@pytest.mark.long
def test_a_tree_that_is_dropped(place: Place) -> None:
    for phase in PHASES:
        server, action = serve(phase, place), ACTIONS[phase]
        leaf: Any = ActionBehaviour(
            "leaf", (Fibonacci, action), {"order": 1}, server_timeout=BOUND if server else 0.0
        )
        root: Any = py_trees.composites.Sequence("root", memory=True, children=[leaf])
        if server is not None:
            leaf.setup()
        else:
            from actionkit import ServerUnavailableError

            with pytest.raises(ServerUnavailableError):
                leaf.setup()
        reach(phase, root, leaf, server)
        future, goal_id = leaf.future, str(leaf.future.goal_id)
        del leaf, root
        gc.collect()
        what, ended = reached(phase, server, goal_id)
        if server is None:
            assert future.outcome(BOUND).attempts <= 1
            assert future.known_to_run is False
        record(phase, what, ended)


PROGRAM = """
import sys, time
import py_trees
from test_msgs.action import Fibonacci
from actionkit import cancel_on_signals
from actionkit.trees import ActionBehaviour
if sys.argv[2] == "SIGTERM":
    cancel_on_signals()
leaf = ActionBehaviour("leaf", (Fibonacci, sys.argv[1]), {"order": 1}, server_timeout=60.0)
tree = py_trees.trees.BehaviourTree(leaf)
tree.setup()
while True:
    tree.tick()
    if leaf.future.known_to_run:
        print(leaf.future.goal_id, flush=True)
    time.sleep(0.02)
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda n: n.name)
def test_a_program_that_ticks(number: signal.Signals, place: Place) -> None:
    server = serve(RUNNING, place)
    assert server is not None
    program = forked.Popen(
        [sys.executable, "-c", PROGRAM, ACTIONS[RUNNING], number.name],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    try:
        goal_id = Script(program).line()
        program.send_signal(number)
        assert program.wait(BOUND) == -number
    finally:
        program.kill()
        program.communicate()
    what, ended = reached(RUNNING, server, goal_id)
    record(RUNNING, what, ended)


def test_every_row_is_there() -> None:
    PAGE.check()
