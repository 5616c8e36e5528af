"""4: what others do on the same action."""

from __future__ import annotations

from contextlib import ExitStack
from functools import partial

from benchmarks.clients import BEST_RAW, OURS
from benchmarks.measure import Report, Sample, Scale, Verdict, alternate, figure, ratio
from benchmarks.pairs import FORGETFUL, Pair

_ORDER = 5
_CALLS = 20
_OTHERS = 10


def run_all(scale: Scale) -> Report:
    """Measure with and without the feedback of ten other clients' goals, 100 Hz each."""
    report = Report(4, "Others' feedback, 1,000 messages a second")
    clients = (OURS[0], BEST_RAW)
    with ExitStack() as stack:
        turns = {}
        for client in clients:
            pair = stack.enter_context(Pair(client, result_timeout=FORGETFUL))
            others = stack.enter_context(pair.another(OURS[0]))
            pair.server.do("stream", on=True)
            others.do("endless", clients=_OTHERS)
            for noise in (False, True):
                turns[_name(client, noise)] = partial(_turn, pair, noise)
        samples = alternate(scale.pick(12, 40), turns, "4")
    for client in clients:
        for noise in (False, True):
            name, quiet = _name(client, noise), _name(client, False)
            report.figures += [
                figure("latency", samples, name, "latency", baseline=quiet),
                figure("client CPU", samples, name, "cpu", baseline=quiet),
            ]
    loud, quiet = _name(OURS[0], True), _name(OURS[0], False)
    report.verdicts.append(
        Verdict(
            "latency under others' feedback, to quiet", ratio(samples, loud, quiet, "latency"), 1.3
        )
    )
    return report


def _name(client: str, noise: bool) -> str:
    return f"{client}, {'with' if noise else 'no'} traffic"


def _turn(pair: Pair, noise: bool) -> Sample:
    assert pair.server.do("stream", on=noise) == _OTHERS
    sample = pair.turn(_CALLS, _ORDER)
    pair.server.do("stream", on=False)
    return sample
