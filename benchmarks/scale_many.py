"""Scale in number: of actions and servers, of client processes, of goals in flight."""

from __future__ import annotations

import statistics
from contextlib import ExitStack
from functools import partial
from typing import Any

from actionkit.testing import isolated_domain
from benchmarks import process
from benchmarks.child import Child
from benchmarks.clients import BEST_RAW, OURS
from benchmarks.climb import Climb, Turn
from benchmarks.measure import Report, Sample, Scale, Verdict
from benchmarks.server import NAME

_PER_SERVER = 5
_GOALS = 5
_CALLS = 20
_WARM = 2
_PATIENCE = 60.0
_ANSWER = 15.0
"""Seconds for calls that take milliseconds each."""
_START = 2.0
_SLOW = 0.008
"""Seconds for all goals, and for each: who is slower than that is out."""
_REMEMBERED = 60.0
"""Seconds. With 5, a busy server forgets results of thousands before anyone could ask for them."""
_NOISE = 1.1
"""No more than the raw client, but for the machine's noise."""
_KINDS = {OURS[0]: "ActionKit", BEST_RAW: "rclpy"}


def actions(report: Report, scale: Scale) -> None:
    """Many actions, five on each server, all called by one process."""
    sizes = (10, 50) if scale.quick else (10, 200)
    with ExitStack() as stack:
        domain = stack.enter_context(isolated_domain())
        # A participant may announce itself to a few low numbers of the domain only. The client's
        # is to be among them: this one comes before the servers, and makes room for it.
        with Child(domain, "benchmarks.server") as first:
            first.do("leave")
            names: list[str] = []
            servers = [
                stack.enter_context(Child(domain, "benchmarks.server"))
                for _ in range(sizes[-1] // _PER_SERVER)
            ]
            for server in servers:
                for _ in range(_PER_SERVER):
                    names.append(f"action_{len(names)}")
                    server.do("renew", name=names[-1], result_timeout=_REMEMBERED)
        climb = Climb(report, "actions", "actions", scale.pick(25, 100))

        def turn(kind: str, number: int) -> Sample:
            with Child(domain, "benchmarks.fleet", kind) as fleet:
                fleet.patience = min(_PATIENCE, climb.left())
                found = _do(fleet, "open", names=names[:number])
                chains = _do(fleet, "chains", goals=_GOALS)
                return {
                    **found,
                    **chains,
                    "unfair": _unfair(chains["took"]),
                    "kilobytes": found["memory"] / 1e3,
                }

        turns: dict[str, Turn] = {who: partial(turn, kind) for who, kind in _KINDS.items()}
        climb.up(sizes, turns, 1)
    climb.figures("actions at a time: wall time per call", "wall", BEST_RAW)
    climb.figures("actions at a time: client CPU per call", "cpu", BEST_RAW)
    climb.figures("actions at a time: slowest action to median", "unfair", BEST_RAW, unit="x")
    climb.figures("connect to them all", "connect", BEST_RAW)
    climb.figures("client CPU to connect, per action", "connect_cpu", BEST_RAW)
    climb.figures("memory per action", "kilobytes", BEST_RAW, unit="kB")
    climb.plot("Connecting to many actions", "seconds", "connect", 1.0)
    climb.plot("Actions called at a time", "client CPU, ms a call", "cpu", 1e3)
    _verdicts(report, climb, "called at a time", "cpu", "wall")


def processes(report: Report, scale: Scale) -> None:
    """Many client processes on one server, which all call at a time."""
    sizes = (1, 5) if scale.quick else (1, 5, 10, 20)
    climb = Climb(report, "processes", "processes", scale.pick(15, 60))
    with ExitStack() as stack:
        turns: dict[str, Turn] = {}
        for who in _KINDS:
            domain = stack.enter_context(isolated_domain())
            server = stack.enter_context(Child(domain, "benchmarks.server"))
            server.do("reset", result_timeout=_REMEMBERED)
            turns[who] = partial(_together, climb, domain, server, who)
        climb.up(sizes, turns, 1)
    climb.figures("processes at a time: wall time per call of all", "wall", BEST_RAW)
    climb.figures("processes at a time: client CPU per call", "cpu", BEST_RAW)
    climb.figures("processes at a time: server CPU per call", "server", BEST_RAW)
    climb.figures("processes at a time: slowest process to median", "unfair", BEST_RAW, unit="x")
    climb.plot("Client processes on one server", "ms a call of all", "wall", 1e3)
    _verdicts(report, climb, "on one server", "cpu", "wall")


def _together(climb: Climb, domain: int, server: Child, who: str, number: int) -> Sample:
    """Only those that take part are there: the server sends to each."""
    with ExitStack() as stack:
        workers = [
            stack.enter_context(Child(domain, "benchmarks.worker", who)) for _ in range(number)
        ]
        _all(workers, min(_PATIENCE, climb.left()), "open")
        _all(workers, min(_PATIENCE, climb.left()), "in_a_row", calls=_WARM, order=5)
        before = process.cpu(server.pid)
        samples = _all(workers, min(_ANSWER, climb.left()), "in_a_row", calls=_CALLS, order=5)
        used = process.cpu(server.pid) - before
    return {
        # All run at a time: the server's rate is what counts.
        "wall": statistics.mean(one["wall"] for one in samples) / number,
        "cpu": statistics.mean(one["cpu"] for one in samples),
        "server": used / (_CALLS * number),
        "unfair": _unfair([sum(one["took"]) for one in samples]),
    }


def _all(
    workers: list[Child], patience: float, command: str, **arguments: Any
) -> list[dict[str, Any]]:
    """Have all do the same at the same time."""
    try:
        for worker in workers:
            worker.patience = patience
            worker.begin(command, **arguments)
        return [worker.end() for worker in workers]
    except RuntimeError:
        for worker in workers:
            worker.kill()
        raise


def one_action(report: Report, scale: Scale) -> None:
    """Very many goals of one action in flight."""
    sizes = (100, 1000) if scale.quick else (100, 1000, 3000)
    climb = _in_flight(report, 1, sizes, scale.pick(20, 45))
    climb.plot("Goals of one action in flight", "wall time, ms a goal", "wall", 1e3, "goals")


def ten_actions(report: Report, scale: Scale) -> None:
    """The same, spread over ten actions: no server has to list them all."""
    _in_flight(report, 10, (1000,) if scale.quick else (1000, 10_000), scale.pick(15, 60))


def _in_flight(report: Report, number: int, sizes: tuple[int, ...], seconds: float) -> Climb:
    where = "of one action" if number == 1 else f"of {number} actions"
    climb = Climb(report, f"goals {where}", f"goals {where}", seconds, tries=1)
    names = [NAME, *(f"{NAME}_{one}" for one in range(1, number))]
    with ExitStack() as stack:
        turns: dict[str, Turn] = {}
        for who, kind in _KINDS.items():
            domain = stack.enter_context(isolated_domain())
            server = stack.enter_context(Child(domain, "benchmarks.server"))
            turns[who] = partial(_flood, climb, domain, server, kind, names)
        climb.up(sizes, turns, 1)
    climb.figures("in flight: wall time per goal", "wall", BEST_RAW)
    climb.figures("in flight: client CPU per goal", "cpu", BEST_RAW)
    climb.figures("in flight: server CPU per goal", "server", BEST_RAW)
    climb.figures("in flight: slowest 5 % to median goal", "unfair", BEST_RAW, unit="x")
    climb.figures("in flight: client memory per goal", "kilobytes", BEST_RAW, unit="kB")
    _verdicts(report, climb, "in flight", "cpu", "wall")
    return climb


def _flood(
    climb: Climb, domain: int, server: Child, kind: str, names: list[str], goals: int
) -> Sample:
    server.do("reset", result_timeout=_REMEMBERED)
    for name in names[1:]:
        server.do("renew", name=name, result_timeout=_REMEMBERED)
    with Child(domain, "benchmarks.fleet", kind) as fleet:
        fleet.patience = min(_PATIENCE, climb.left())
        _do(fleet, "open", names=names)
        server.do("hold", goals=goals)
        seconds = min(climb.left(), _START + _SLOW * goals)
        fleet.patience = seconds + 10.0
        before = process.cpu(server.pid)
        found = _do(fleet, "flood", goals=goals, seconds=seconds)
        used = process.cpu(server.pid) - before
        took = sorted(found["took"])
        slow = took[min(len(took) - 1, int(0.95 * len(took)))] / statistics.median(took)
        return {
            **found,
            "server": used / goals,
            "unfair": slow,
            "kilobytes": found["memory"] / 1e3,
        }


def _do(child: Child, command: str, **arguments: Any) -> dict[str, Any]:
    """Have a child do something; one that fails has more to do than to leave in peace."""
    try:
        answer: dict[str, Any] = child.do(command, **arguments)
    except RuntimeError:
        child.kill()
        raise
    return answer


def _unfair(took: list[float]) -> float:
    return max(took) / statistics.median(took)


def _verdicts(report: Report, climb: Climb, what: str, *keys: str) -> None:
    for key in keys:
        found = climb.last_ratio(OURS[0], BEST_RAW, key)
        name = {"cpu": "client CPU", "wall": "wall time"}[key]
        size = "none" if found is None else climb.sized(found[0])
        report.verdicts.append(
            Verdict(f"{size} {what}: {name}, to raw", found and found[1], _NOISE)
        )
