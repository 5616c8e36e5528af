"""7: what a behaviour tree of very many actions costs, beside one that has none."""

from __future__ import annotations

from contextlib import ExitStack
from functools import partial

from actionkit.testing import isolated_domain
from benchmarks.child import Child
from benchmarks.measure import Report, Sample, Scale, Verdict, alternate, figure, middle

_LEAVES, _ACTIONS = 200, 50
_OURS, _ALONE = "ActionKit", "py_trees alone"
_MOST = 1.0
"""Milliseconds: what a leaf may take of a tick."""


def run_all(scale: Scale) -> Report:
    """Measure ticks, the most that one leaf takes of one, threads, memory and the setup."""
    report = Report(7, f"Behaviour trees: {_LEAVES} leaves over {_ACTIONS} actions")
    turns = {name: partial(_tree, name, scale.pick(3, 10)) for name in (_OURS, _ALONE)}
    samples = alternate(scale.pick(2, 5), turns, "7, trees")
    for key, what in (
        ("sending", "tick that sends all goals"),
        ("running", "tick while all goals run"),
        ("interrupting", "interruption of all"),
    ):
        report.figures += [
            figure(f"{what}, CPU of its thread", samples, name, key, baseline=_ALONE)
            for name in turns
        ]
    report.figures += [
        figure("most that one leaf takes of a tick", samples, _OURS, "most"),
        figure("setup, with discovery", samples, _OURS, "setup"),
        figure("shutdown with all goals running", samples, _OURS, "shutdown"),
        figure("memory", samples, _OURS, "memory", unit="MB"),
        figure("threads of Python's", samples, _OURS, "threads", unit=""),
    ]
    most = 1e3 * middle(samples[_OURS], "most")
    report.verdicts.append(Verdict("most that one leaf takes of a tick", most, _MOST, "ms"))
    return report


def _tree(kind: str, rounds: int) -> Sample:
    with ExitStack() as stack:
        domain = stack.enter_context(isolated_domain())
        if kind == _OURS:
            server = stack.enter_context(Child(domain, "benchmarks.tree_server"))
            server.do("make", number=_ACTIONS)
        tree = stack.enter_context(Child(domain, "benchmarks.tree"))
        found = dict(tree.do("set_up", kind=kind, leaves=_LEAVES, actions=_ACTIONS))
        runs = [tree.do("run") for _ in range(rounds)]
        for key in runs[0]:
            found[key] = sorted(run[key] for run in runs)[rounds // 2]
        found["most"] = max(run["most"] for run in runs)
        found["shutdown"] = tree.do("shut_down")
        return found
