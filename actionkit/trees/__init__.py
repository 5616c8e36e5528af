"""Actions as leaves of behaviour trees, for py_trees 2.

    from actionkit.trees import ActionBehaviour, FromBlackboard

    dock = ActionBehaviour("dock", (Dock, "dock"), {"speed": 0.2}, timeout=30.0)
    tree = py_trees.trees.BehaviourTree(dock)
    tree.setup(timeout=15.0)

A tick never blocks, and a goal that the tree gives up on is cancelled. Needs py_trees:
`pip install -e '.[trees]'` in a checkout.
"""

try:
    import py_trees as _py_trees  # noqa: F401  for the error alone
except ImportError as _error:
    raise ImportError(
        "actionkit.trees needs py_trees 2, which cannot be imported here"
        f" ({_error}): pip install 'py_trees>=2.2'"
    ) from _error

from actionkit.trees._behaviour import ActionBehaviour
from actionkit.trees._sources import FromBlackboard

__all__ = ["ActionBehaviour", "FromBlackboard"]
