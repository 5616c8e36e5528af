"""No tick waits: all calls that could block are counted, with servers in any state."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

import py_trees
import pytest
from py_trees.blackboard import Blackboard
from py_trees.common import Status

from actionkit import Client
from actionkit.testing import tick_until
from actionkit.trees import ActionBehaviour, FromBlackboard
from tests.trees.conftest import BOUND, MakeClient, Place

MAY_BLOCK = {
    *("sleep", "select", "poll", "epoll", "wait", "join", "recv", "read", "readline", "fsync"),
    *("acquire", "wait_set_wait", "get", "call", "system", "waitpid", "connect", "accept"),
}
"""Functions in C that wait: of locks, sockets, processes, queues and rclpy's wait set."""
HARMLESS = {"get"}  # of dictionaries; those of queues are written in Python, and wait by `acquire`


class Watched:
    """Notes the calls of this thread that may block."""

    def __init__(self) -> None:
        self.calls: list[str] = []

    def _see(self, frame: FrameType, event: str, function: Any) -> None:
        if event == "c_call":
            name = function.__name__
            owner = getattr(function, "__self__", None)
            if name == "__enter__" and type(owner).__module__ == "_thread":
                name = "acquire"
            if name in MAY_BLOCK - HARMLESS and type(owner).__name__ not in ("str", "bytes"):
                place = f"{Path(frame.f_code.co_filename).name}:{frame.f_code.co_name}"
                self.calls.append(f"{name} of {type(owner).__name__} in {place}")

    def __enter__(self) -> Watched:
        sys.setprofile(self._see)
        return self

    def __exit__(self, *_: object) -> None:
        sys.setprofile(None)


def test_what_may_block_is_seen() -> None:
    import threading

    with Watched() as watched:
        time.sleep(0)
        threading.Lock().acquire()
        threading.Event().wait(0)
    assert len(watched.calls) >= 3


LIVES = {
    "executes": ["accept", {"feedback": 3}, "gate", "succeed"],
    "refuses": ["refuse_cancel", "accept", "gate", "succeed"],
    "answers late": ["gate", "accept", "succeed"],
}


@pytest.mark.parametrize("life", [*LIVES, "is not there"])
@pytest.mark.every
def test_no_tick_blocks(life: str, place: Place, open_client: MakeClient) -> None:
    action = life.replace(" ", "_")
    server = None
    if life in LIVES:
        server = place.server(action, script=LIVES[life])
        client = open_client(action)
    else:
        from test_msgs.action import Fibonacci

        client = Client(Fibonacci, action)
    Blackboard.set("target", {"order": 2})
    goals: list[Any] = [{"order": 1}, lambda leaf: {"order": 3}, FromBlackboard("target")]
    leaves = [
        ActionBehaviour(f"{n}", client, goal, feedback_key=f"said{n}", result_key=f"got{n}")
        for n, goal in enumerate(goals)
    ]
    root = py_trees.composites.Parallel(
        "all", policy=py_trees.common.ParallelPolicy.SuccessOnAll(), children=leaves
    )

    def watched(do: Callable[[], object]) -> Callable[[], object]:
        def tick() -> None:
            with Watched() as seen:
                do()
            assert seen.calls == []

        return tick

    tick = watched(root.tick_once)
    tick()  # sends
    if server is not None:
        for leaf in leaves:
            server.wait_for("goal_received", goal_id=str(leaf.future.goal_id))
    tick()  # looks
    watched(lambda: root.stop(Status.INVALID))()
    tick()  # waits for the earlier goals
    if server is not None:
        server.release()
        tick_until(root, Status.SUCCESS, BOUND)
    else:
        watched(lambda: root.stop(Status.INVALID))()
        client.close()
    tick()  # begins again, or fails
    watched(lambda: root.stop(Status.INVALID))()
    for leaf in leaves:
        leaf.shutdown()
