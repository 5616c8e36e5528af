"""9: how far it goes, and what breaks first."""

from __future__ import annotations

from benchmarks import scale_bulk, scale_many
from benchmarks.measure import Report, Scale


def run_all(scale: Scale) -> Report:
    """Measure at growing numbers and sizes, each beside the raw client.

    Each has a time of its own, so that what gets slow, or hangs, only ends its own curve.
    """
    report = Report(9, "Scale")
    for measure in (
        scale_many.actions,
        scale_many.processes,
        scale_many.one_action,
        scale_many.ten_actions,
        scale_bulk.feedback,
        scale_bulk.results,
    ):
        measure(report, scale)
    return report
