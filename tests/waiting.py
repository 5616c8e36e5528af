"""Waits for conditions without an event. If there is an event, wait for that instead."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable
from typing import TypeVar

_T = TypeVar("_T")

_BOUND = 30.0  # seconds; long, for loaded machines: nothing here waits for it to run out
_EVERY = 0.02

_NEVER = threading.Event()


def until(holds: Callable[[], _T], what: object = "", *, bound: float = _BOUND) -> _T:
    """Look again and again until something holds; return what it was.

    Raises:
        AssertionError: It did not hold in time.
    """
    end = time.monotonic() + bound
    while not (found := holds()):
        assert time.monotonic() < end, f"not seen in {bound:g} s: {what or holds}"
        _NEVER.wait(_EVERY)
    return found


async def until_in_loop(holds: Callable[[], _T], what: object = "", *, bound: float = _BOUND) -> _T:
    """Do as `until` does, beside the other tasks of an event loop.

    Raises:
        AssertionError: It did not hold in time.
    """
    end = time.monotonic() + bound
    while not (found := holds()):
        assert time.monotonic() < end, f"not seen in {bound:g} s: {what or holds}"
        await asyncio.sleep(_EVERY)
    return found
