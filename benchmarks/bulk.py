"""A process that gets much at a time: `python -m benchmarks.bulk VARIANT`."""

from __future__ import annotations

import os
import sys
import time
from typing import Any

from benchmarks import child, process
from benchmarks.bulk_server import NAME
from benchmarks.variants import VARIANTS


class Bulk:
    """Carries out commands on one client."""

    def __init__(self, variant: str) -> None:
        self._client = VARIANTS[variant]()

    def open(self) -> None:
        """Connect it."""
        self._client.open(NAME)

    def call(self, feedback: bool) -> dict[str, Any]:
        """Call once; return what came, how long it took, its CPU and the memory at the most."""
        sizes: list[int] = []
        before = process.forget_peak(os.getpid())
        cpu, began = time.process_time(), time.perf_counter()
        sequence = self._client.call(
            0, (lambda message: sizes.append(len(message.sequence))) if feedback else None
        )
        return {
            "wall": time.perf_counter() - began,
            "cpu": time.process_time() - cpu,
            "memory": process.peak(os.getpid()) - before,
            "messages": len(sizes),
            "smallest": 4 * min(sizes, default=0),
            "result": 4 * len(sequence),
        }

    def close(self) -> None:
        """Close it."""
        self._client.close()


if __name__ == "__main__":
    answers = child.claim_stdout()
    bulk = Bulk(sys.argv[1])
    child.serve(answers, {"open": bulk.open, "call": bulk.call})
    bulk.close()
