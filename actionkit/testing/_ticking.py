"""Ticks a behaviour tree in a test, without sleeping."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from actionkit._model.settings import check_seconds

if TYPE_CHECKING:
    from py_trees.behaviour import Behaviour
    from py_trees.common import Status
    from py_trees.trees import BehaviourTree


class TreeNotThereError(AssertionError, TimeoutError):
    """The tree did not reach the wanted state. Both a failed assertion and a timeout."""


def tick_until(
    tree: BehaviourTree | Behaviour,
    wanted: Status | Callable[[], object],
    timeout: float = 10.0,
    *,
    period: float = 0.05,
) -> int:
    """Tick a tree until it has a status, or until a function returns true.

    The next tick follows as soon as a goal of an `ActionBehaviour` in the tree has ended. It
    follows after `period` at the latest, for timers, conditions and other behaviours.

    Args:
        tree: A tree, or a single behaviour.
        wanted: The wanted status of the root; or a function that is called after each tick.
        timeout: Seconds to wait.
        period: Seconds between two ticks, at most.

    Returns:
        How many ticks it took, at least 1.

    Raises:
        TypeError, ValueError: A time is not a number of seconds.
        AssertionError: (also a `TimeoutError`) `wanted` did not come in time, or the tree ended
            with another status, such as SUCCESS instead of FAILURE. The message shows the tree.
    """
    check_seconds("timeout", timeout, optional=False)
    check_seconds("period", period, optional=False)
    root: Any = getattr(tree, "root", tree)
    tick: Callable[[], object] = getattr(tree, "tick_once", tree.tick)  # a behaviour has both
    until = time.monotonic() + timeout
    goal_ended = threading.Event()
    heard: set[Any] = set()
    ticks = 0
    while True:
        goal_ended.clear()
        tick()
        ticks += 1
        if wanted() if callable(wanted) else root.status is wanted:
            return ticks
        left = until - time.monotonic()
        ended = not callable(wanted) and root.status.name in ("SUCCESS", "FAILURE")
        if left <= 0 or ended:
            error = TreeNotThereError(_said(root, wanted, ticks, timeout, ended=ended))
            raise error
        for node in root.iterate():
            future: Any = getattr(node, "future", None)
            if future is not None and future not in heard:
                heard.add(future)
                future.add_done_callback(lambda _: goal_ended.set())
        goal_ended.wait(min(period, left))


def _said(root: Any, wanted: Any, ticks: int, timeout: float, *, ended: bool) -> str:
    from py_trees.display import unicode_tree

    what = "what was waited for" if callable(wanted) else wanted.name
    when = "" if ended else f" within {timeout:g} s"
    shown = unicode_tree(root, show_status=True).rstrip()
    return f"the tree is {root.status.name}, and not {what}{when}, after {ticks} ticks:\n{shown}"
