"""Doing the same for many things, on all processors."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import TypeVar

In = TypeVar("In")
Out = TypeVar("Out")


def each(
    work: Callable[[In], Out], things: Sequence[In], progress: Callable[[float], None]
) -> list[Out]:
    """Return what `work`, which waits for a process, gives for each."""
    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        try:
            futures = [pool.submit(work, one) for one in things]
            for count, future in enumerate(as_completed(futures), 1):
                future.result()  # the first failure ends all
                progress(count / len(things))
            return [future.result() for future in futures]
        except BaseException:  # also Ctrl-C: no process is left at work
            pool.shutdown(wait=True, cancel_futures=True)
            raise
