"""Servers in Python on other frameworks: synchros2, simple_actions, py_trees_ros."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from tests.field import interfaces
from tests.field.kind import Kind
from tests.field.sources import SERVERS, upstream

CANCELLED = "a goal is cancelled: its only thread is busy with it"
SECOND = "a second goal comes: its only thread is busy with the first"
MIXED_UP = "two goals at once, and it has several threads"
EXCEPTION = "an exception in its work"
THIRD = "a third goal comes while a second one waits for the end of the first"
CTRL_C = "it ends by Ctrl-C, and aborts its goal too late"
_LAUNCHER = Path(__file__).parents[1] / "serve_python.py"


def program(folder: str, script: str, *options: str) -> Sequence[str]:
    """Return what starts a script of the shared folder on top of a framework.

    Args:
        folder: Has the framework's package, below the sources.
        script: The file's name.
        options: Of the launcher.
    """
    paths = upstream() / folder, interfaces.interfaces()
    return str(_LAUNCHER), os.pathsep.join(map(str, paths)), str(SERVERS / script), *options


SYNCHROS2 = Kind(
    name="synchros2, `SingleGoalActionServer`",
    program=lambda: program("sync_pkg", "srv_sync.py"),
    goals={"short": {"order": 3}, "long": {"order": 40}},
    log={
        "executing": r"execute \w+ order",
        "cancel_requested": "Received cancel request",
        "canceled": r"canceled \w+",
        "succeeded": r"succeeded \w+",
        "aborted": "Error raised in execute callback",
    },
    results={"short": [0, 1, 1, 2]},
    second="preempts",
    own=(EXCEPTION, THIRD),
)
SIMPLE_ACTIONS = Kind(
    name="simple_actions, one thread",
    program=lambda: program("simple", "srv_simple.py"),
    goals={
        "short": {"order": 3},
        "aborts": {"order": 5},
        "busy": {"order": 11},
        "busy for long": {"order": 46},
    },
    log={
        "executing": "execute order",
        "succeeded": "done",
        "aborted": "uncaught exception .* bad five",
    },
    results={"short": [0, 1, 1, 2], "aborts": []},
    second="answers later",
    own=(CANCELLED, SECOND, MIXED_UP),
)
DOCK = Kind(
    name="py_trees_ros, mock `Dock`",
    program=lambda: program("pytrees_pkg", "srv_dock.py"),
    goals={"short": {"dock": True}, "long": {"dock": False}},
    log={
        "executing": "executing a goal",
        "cancel_requested": "cancel requested",
        "canceled": "goal cancelled at",
        "succeeded": "goal executed with success",
        "aborted": "goal pre-empted at",
    },
    second="preempts",
    action_type="py_trees_ros_interfaces/action/Dock",
    action_name="dock",
    prepare=interfaces.importable,
    own=(CTRL_C,),
)
KINDS = (SYNCHROS2, SIMPLE_ACTIONS, DOCK)
