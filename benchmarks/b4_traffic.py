"""4: what others do on the same action."""

from __future__ import annotations

from contextlib import ExitStack
from functools import partial

from benchmarks.clients import BEST_RAW, OURS
from benchmarks.measure import Report, Sample, Scale, Verdict, alternate, figure, ratio
from benchmarks.pairs import FORGETFUL, Pair
from benchmarks.server import ELSEWHERE, NAME

_ORDER = 5
_CALLS = 20
_OTHERS = 10
_TRAFFIC = {"quiet": None, "traffic elsewhere": ELSEWHERE, "traffic": NAME}


def run_all(scale: Scale) -> Report:
    """Measure with and without the feedback of ten other clients' goals, 100 Hz each.

    The same traffic on another action of the same server, with as many clients, loads server
    and machine alike: what it costs is not the client's doing.
    """
    report = Report(4, "Others' feedback, 1,000 messages a second")
    clients = (OURS[0], BEST_RAW)
    with ExitStack() as stack:
        turns = {}
        for client in clients:
            pair = stack.enter_context(Pair(client, result_timeout=FORGETFUL))
            for name in (ELSEWHERE, NAME):
                others = stack.enter_context(pair.another(OURS[0]))
                # While they connect, so that each sees its goal run.
                pair.server.do("stream", name=name)
                others.begin("endless", clients=_OTHERS, name=name)
                while pair.server.do("stream", name=name) < _OTHERS:
                    pass
                others.end()
            for noise in _TRAFFIC:
                turns[f"{client}, {noise}"] = partial(_turn, pair, noise)
        samples = alternate(scale.pick(12, 40), turns, "4")
    for client in clients:
        for noise in _TRAFFIC:
            for key, what in (("latency", "latency"), ("cpu", "client CPU")):
                report.figures.append(
                    figure(what, samples, f"{client}, {noise}", key, baseline=f"{client}, quiet")
                )
    loud = f"{OURS[0]}, traffic"
    for noise in ("quiet", "traffic elsewhere"):
        report.verdicts.append(
            Verdict(
                f"latency under others' feedback, to {noise}",
                ratio(samples, loud, f"{OURS[0]}, {noise}", "latency"),
                1.3,
            )
        )
    return report


def _turn(pair: Pair, noise: str) -> Sample:
    pair.server.do("stream", name=_TRAFFIC[noise])
    sample = pair.turn(_CALLS, _ORDER)
    pair.server.do("stream", name=None)
    return sample
