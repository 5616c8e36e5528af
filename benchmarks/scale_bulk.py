"""Scale in size: of feedback and of results."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from functools import partial

from actionkit.testing import isolated_domain
from benchmarks.child import Child
from benchmarks.clients import BEST_RAW, OURS
from benchmarks.climb import Climb, Turn
from benchmarks.measure import Report, Sample, Scale, Verdict, middle

_RATE = 30.0
_PATIENCE = 20.0
_NOISE = 1.1
_WHO = (OURS[0], BEST_RAW)
_KB, _MB = 1_000, 1_000_000


def feedback(report: Report, scale: Scale) -> None:
    """Feedback thirty times a second, of growing size."""
    sizes = (100, 1000) if scale.quick else (10, 100, 1000, 2000, 4000)
    climb = Climb(report, "feedback", "kB of feedback", scale.pick(10, 40))
    messages = int(_RATE * scale.pick(1, 3))
    with ExitStack() as stack:
        turns = {who: _connect(stack, climb, who, partial(_stream, messages)) for who in _WHO}
        climb.up(sizes, turns, 1)
    climb.figures("feedback at 30 Hz: lost", "lost", BEST_RAW, unit="%")
    climb.figures("feedback at 30 Hz: client CPU per message", "cpu", BEST_RAW)
    climb.figures("feedback at 30 Hz: client memory more", "memory", BEST_RAW, unit="MB")
    climb.plot("Feedback at 30 Hz", "client CPU, ms a message", "cpu", 1e3, "kB a message")
    row = climb.row(OURS[0], 1000)
    lost = middle(climb.samples[row], "lost") if row in climb.samples else None
    report.verdicts.append(Verdict("feedback of 1 MB at 30 Hz that is lost", lost, 0.0, "%"))


def results(report: Report, scale: Scale) -> None:
    """Results of growing size."""
    sizes = (1, 10) if scale.quick else (1, 10, 25, 50, 100)
    climb = Climb(report, "results", "MB of result", scale.pick(10, 15))
    with ExitStack() as stack:
        turns = {who: _connect(stack, climb, who, _fetch) for who in _WHO}
        climb.up(sizes, turns, scale.pick(1, 2))
    climb.figures("result: wall time", "wall", BEST_RAW)
    climb.figures("result: client CPU", "cpu", BEST_RAW)
    climb.figures("result: client memory more, to its size", "shares", BEST_RAW, unit="x")
    climb.plot("Large results", "wall time, ms", "wall", 1e3, "MB")
    found = climb.last_ratio(OURS[0], BEST_RAW, "wall")
    what = "large" if found is None else f"of {found[0]} MB"
    report.verdicts.append(
        Verdict(f"results {what}: wall time, to raw", found and found[1], _NOISE)
    )


def _connect(
    stack: ExitStack, climb: Climb, who: str, turn: Callable[[Climb, Child, Child, int], Sample]
) -> Turn:
    domain = stack.enter_context(isolated_domain())
    server = stack.enter_context(Child(domain, "benchmarks.bulk_server"))
    client = stack.enter_context(Child(domain, "benchmarks.bulk", who))
    client.do("open")
    return partial(turn, climb, server, client)


def _stream(messages: int, climb: Climb, server: Child, client: Child, size: int) -> Sample:
    server.do("load", feedback=size * _KB, messages=messages, rate=_RATE)
    client.patience = min(_PATIENCE, climb.left())
    found = client.do("call", feedback=True)
    if found["messages"] and found["smallest"] != size * _KB:
        raise RuntimeError(f"a message had {found['smallest']} bytes")
    came = max(1, found["messages"])
    return {
        "lost": 100 * (1 - found["messages"] / messages),
        "cpu": found["cpu"] / came,
        "memory": found["memory"] / _MB,
    }


def _fetch(climb: Climb, server: Child, client: Child, size: int) -> Sample:
    server.do("load", result=size * _MB)
    client.patience = min(_PATIENCE, climb.left())
    found = client.do("call", feedback=False)
    if found["result"] != size * _MB:
        raise RuntimeError(f"the result had {found['result']} bytes")
    return {**found, "shares": found["memory"] / (size * _MB)}
