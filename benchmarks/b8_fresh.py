"""8: what a fresh process waits for: from the start of Python to its first result."""

from __future__ import annotations

from functools import partial

from actionkit import servers
from actionkit.testing import isolated_domain
from benchmarks.child import seconds_until
from benchmarks.measure import (
    Report,
    Sample,
    Samples,
    Scale,
    Verdict,
    alternate,
    figure,
    middle,
    ratio,
)

_FIRST = ("-m", "benchmarks.first")
_PROGRAMS = {
    "ActionKit": (*_FIRST, "actionkit"),
    "command line": (
        *("-m", "actionkit", "call", "/fibonacci"),
        *("test_msgs/action/Fibonacci", "{order: 5}"),
    ),
    "rclpy tutorial": (*_FIRST, "rclpy"),
    "--help": ("-m", "actionkit", "--help"),
}


def run_all(scale: Scale) -> Report:
    """Start each program anew, in alternation, with a server that is there."""
    report = Report(8, "The first result of a fresh process")
    with isolated_domain() as domain, servers.start("fibonacci", domain_id=domain):

        def once(text: str, program: tuple[str, ...]) -> Sample:
            return {"first": seconds_until(text, domain, *program)}

        turns = {
            # What the command line prints before is not the result.
            name: partial(once, "sequence" if name == "command line" else "", program)
            for name, program in _PROGRAMS.items()
        }
        samples = alternate(scale.pick(10, 30), turns, "8, fresh starts")
    for name in turns:
        report.figures += [
            figure("start to first result", samples, name, "first", baseline="rclpy tutorial"),
            figure("second worst start", _second_worst(samples), name, "first"),
        ]
    ours = middle(samples["ActionKit"], "first")
    to_rclpy = ratio(samples, "ActionKit", "rclpy tutorial", "first")
    worst = middle(_second_worst(samples)["ActionKit"], "first")
    line = middle(samples["command line"], "first") - ours
    report.verdicts += [
        Verdict("first result of ActionKit, to rclpy's client", to_rclpy, 1.0),
        Verdict("second worst first result of ActionKit, to the median", worst / ours, 2.0),
        Verdict("first result of the command line, beyond ActionKit", 1e3 * line, 300.0, "ms"),
        Verdict("actionkit --help", 1e3 * middle(samples["--help"], "first"), 150.0, "ms"),
    ]
    return report


def _second_worst(samples: Samples) -> Samples:
    return {
        name: [{"first": sorted(float(one["first"]) for one in starts)[-2]}]
        for name, starts in samples.items()
    }
