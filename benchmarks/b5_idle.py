"""5: what clients cost that do nothing, and how soon they are there when it matters."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial

from actionkit.testing import isolated_domain
from benchmarks import process
from benchmarks.child import Child, run
from benchmarks.clients import BEST_RAW, OURS
from benchmarks.crowd import KINDS
from benchmarks.measure import Report, Sample, Scale, Verdict, alternate, figure, middle, ratio
from benchmarks.pairs import Pair

_MANY = 100
_MB = 1e6
_NOTICEABLE = 0.1
"""Per cent of a core: the accounting of the kernel itself is not finer."""


def run_all(scale: Scale) -> Report:
    """Measure idle clients, their memory, a first result, and the reaction to a server."""
    report = Report(5, "Idle clients, and the first result")
    _idle(report, scale)
    _first(report, scale)
    _reaction(report, scale)
    return report


def _idle(report: Report, scale: Scale) -> None:
    """CPU, wake-ups and memory of 1 and of 100 clients that are connected to a server."""
    for number in (1, _MANY):
        turns: dict[str, Callable[[], Sample]] = {
            f"{kind}, {number}": partial(_crowd, kind, number, scale.pick(3, 20)) for kind in KINDS
        }
        samples = alternate(scale.pick(2, 5), turns, f"5, {number} idle")
        for name in turns:
            entities = f"entities, {number}"
            report.figures += [
                figure("CPU while idle", samples, name, "cpu", unit="% of a core"),
                figure("wake-ups of Python's threads", samples, name, "python", unit="/min"),
                figure("wake-ups of the middleware's", samples, name, "middleware", unit="/min"),
            ]
            if number > 1:
                report.figures.append(
                    figure("memory of each", samples, name, "memory", unit="MB", baseline=entities)
                )
        ours = f"ActionKit, {number}"
        extra = middle(samples[ours], "cpu") - middle(samples[entities], "cpu")
        report.verdicts.append(
            Verdict(f"CPU of {number} idle, beyond bare entities'", extra, _NOTICEABLE, "%")
        )
    report.verdicts.append(
        Verdict(
            f"memory of {_MANY} clients, to bare entities'",
            ratio(samples, ours, entities, "memory"),
            2.0,
        )
    )


def _crowd(kind: str, number: int, seconds: float) -> Sample:
    with ExitStack() as stack:
        domain = stack.enter_context(isolated_domain())
        stack.enter_context(Child(domain, "benchmarks.server")).do("reset")
        crowd = stack.enter_context(Child(domain, "benchmarks.crowd", kind))
        crowd.do("open", number=1)  # with what all of them share
        first = process.resident(crowd.pid)
        if number > 1:
            crowd.do("open", number=number - 1)
        memory = (process.resident(crowd.pid) - first) / max(1, number - 1) / _MB
        time.sleep(5.0)  # discovery goes on for a while
        cpu, before = process.thread_cpu(crowd.pid), process.threads(crowd.pid)
        began = time.monotonic()
        time.sleep(seconds)
        took = time.monotonic() - began
        after, ran = process.threads(crowd.pid), process.thread_cpu(crowd.pid)
        woken = {"python": 0.0, "middleware": 0.0}
        for number_of_it, thread in after.items():
            since = before.get(number_of_it)
            whose = "middleware" if thread.name.startswith("dds.") else "python"
            woken[whose] += (thread.wakeups - (since.wakeups if since else 0)) * 60 / took
        used = sum(seconds - cpu.get(thread, 0.0) for thread, seconds in ran.items())
        return {"cpu": 100 * used / took, "memory": memory, **woken}


def _first(report: Report, scale: Scale) -> None:
    """From the first import to the first result, with a server that is there."""
    with ExitStack() as stack:
        domain = stack.enter_context(isolated_domain())
        stack.enter_context(Child(domain, "benchmarks.server")).do("reset")

        def once(kind: str) -> Sample:
            return {"first": float(run(domain, "benchmarks.first", kind))}

        turns = {kind: partial(once, kind) for kind in ("actionkit", "rclpy")}
        samples = alternate(scale.pick(5, 15), turns, "5, first result")
    for name in turns:
        report.figures.append(
            figure("first import to first result", samples, name, "first", baseline="rclpy")
        )


def _reaction(report: Report, scale: Scale) -> None:
    """From a server's being made to a waiting client's knowing of it."""
    with ExitStack() as stack:
        pairs = {name: stack.enter_context(Pair(name)) for name in (OURS[0], BEST_RAW)}

        def once(pair: Pair) -> Sample:
            pair.server.do("leave")
            pair.client.do("server_is_gone")
            pair.client.begin("await_server")
            time.sleep(1.1)  # in the middle of whatever period
            made = pair.server.do("reset")
            return {"reaction": pair.client.end() - made}

        turns = {name: partial(once, pair) for name, pair in pairs.items()}
        samples = alternate(scale.pick(5, 15), turns, "5, reaction")
    for name in turns:
        report.figures.append(
            figure("reaction to a server", samples, name, "reaction", baseline=BEST_RAW)
        )
    report.verdicts.append(
        Verdict(
            "reaction to a server that appears",
            1e3 * middle(samples[OURS[0]], "reaction"),
            20.0,
            "ms",
        )
    )
