"""A process with a behaviour tree of very many leaves, which tells what its ticks cost."""

from __future__ import annotations

import gc
import os
import statistics
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import py_trees
from py_trees.common import ParallelPolicy, Status
from test_msgs.action import Fibonacci

from actionkit.trees import ActionBehaviour
from benchmarks import child, process

_TICKS = 50
_PATIENCE = 60.0


class Timed(ActionBehaviour[Any, Any, Any]):
    """A leaf that notes how long it keeps the ticking thread busy."""

    most = 0.0
    """Seconds of that thread, of the leaf that took longest."""

    def initialise(self) -> None:
        self._note(super().initialise)

    def update(self) -> Status:
        return self._note(super().update)

    def terminate(self, new_status: Status) -> None:
        self._note(lambda: super(Timed, self).terminate(new_status))

    def _note(self, do: Callable[[], Any]) -> Any:
        began = time.thread_time()
        try:
            return do()
        finally:
            Timed.most = max(Timed.most, time.thread_time() - began)


class Trees:
    """The commands."""

    def __init__(self) -> None:
        self._root: Any = None
        self._tree: Any = None

    def set_up(self, kind: str, leaves: int, actions: int) -> dict[str, float]:
        """Make and set up a tree; return what that takes, and what the process then has."""
        before = process.resident(os.getpid())
        made: list[Any] = [
            Timed(str(n), (Fibonacci, f"action_{n % actions}"), {"order": 1}, server_timeout=60.0)
            if kind == "ActionKit"
            else py_trees.behaviours.Running(str(n))
            for n in range(leaves)
        ]
        policy = ParallelPolicy.SuccessOnAll(synchronise=False)
        self._root = py_trees.composites.Parallel("all", policy, made)
        self._tree = py_trees.trees.BehaviourTree(self._root)
        began = time.perf_counter()
        self._tree.setup()
        return {
            "setup": time.perf_counter() - began,
            "memory": (process.resident(os.getpid()) - before) / 1e6,
            "threads": float(threading.active_count()),
        }

    def run(self) -> dict[str, float]:
        """Send all goals, tick while they run, and interrupt them; return seconds of each."""
        gc.collect()
        Timed.most = 0.0
        found = {"sending": _timed(self._tree.tick)}
        self._until(lambda leaf: leaf.future.known_to_run)
        running = [_timed(self._tree.tick) for _ in range(_TICKS)]
        found["running"] = statistics.median(running)
        found["threads"] = float(threading.active_count())
        found["interrupting"] = _timed(lambda: self._root.stop(Status.INVALID))
        found["most"] = Timed.most
        self._until(lambda leaf: leaf.future.done() and leaf.future.known_to_run is False)
        return found

    def shut_down(self) -> float:
        """Shut the tree down; return the seconds that takes."""
        self._tree.tick()
        self._until(lambda leaf: leaf.future.known_to_run)
        began = time.perf_counter()
        self._tree.shutdown()
        return time.perf_counter() - began

    def _until(self, wanted: Callable[[Any], object]) -> None:
        until = time.monotonic() + _PATIENCE
        leaves = [leaf for leaf in self._root.children if isinstance(leaf, Timed)]
        while not all(wanted(leaf) for leaf in leaves):
            if time.monotonic() > until:
                raise TimeoutError("the goals did not come that far")
            time.sleep(0.02)
        time.sleep(0.2)  # for what follows upon it in other threads


def _timed(do: Callable[[], object]) -> float:
    """Return the seconds of this thread that something takes."""
    began = time.thread_time()
    do()
    return time.thread_time() - began


if __name__ == "__main__":
    answers = child.claim_stdout()
    trees = Trees()
    commands = (trees.set_up, trees.run, trees.shut_down)
    child.serve(answers, {command.__name__: command for command in commands})
    sys.exit()
