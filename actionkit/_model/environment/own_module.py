"""Starts a module of ActionKit in a process of its own."""

from __future__ import annotations

import sys

_RUN = """
import sys
sys.path[:] = sys.argv[1].split("\\n")
import runpy
sys.argv[:] = sys.argv[2:]
runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
"""


def command_for(module: str, *words: str) -> list[str]:
    """Return the command that runs a module, which imports from where this process imports.

    With `-m` alone, Python looks into the current folder first. So a `queue.py` of the user's there
    would be imported in place of Python's own, and the process would fail.
    """
    return [sys.executable, "-c", _RUN, "\n".join(sys.path), module, *words]
