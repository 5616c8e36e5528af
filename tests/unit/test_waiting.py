"""Blocking waits hear a signal whenever it comes (C2.5)."""

from __future__ import annotations

import itertools
import math
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from actionkit._threads.waiting import slices
from tests.conftest import NEVER


def on_another_thread(function: Callable[[], Any]) -> Any:
    found: list[Any] = []
    thread = threading.Thread(target=lambda: found.append(function()))
    thread.start()
    thread.join()
    return found[0]


def test_the_main_thread_never_waits_for_ever_at_once() -> None:
    waits = [seconds for seconds in itertools.islice(slices(None), 100) if seconds is not None]
    assert len(waits) == 100
    assert 0.5 <= min(waits) <= max(waits) <= 1.0  # it wakes up twice a second at most (C7.4)
    assert list(slices(0)) == [0]
    assert list(slices(-1.0)) == [-1.0]


@pytest.mark.parametrize("timeout", [1e300, 10**400, math.inf], ids=["1e300", "1e400", "inf"])
def test_a_wait_longer_than_any_life_has_no_end(timeout: float) -> None:
    """The operating system takes 292 years at most, and a float cannot hold each whole number."""
    assert max(itertools.islice(slices(timeout), 100)) <= 1.0  # type: ignore[type-var]
    assert on_another_thread(lambda: list(slices(timeout))) == [None]


@pytest.mark.parametrize("timeout", [None, 0, 3.0])
def test_other_threads_wait_once(timeout: float | None) -> None:
    # Signals are not handled there; and a thousand that wait must cost nothing.
    assert on_another_thread(lambda: list(slices(timeout))) == [timeout]


def test_slices_make_up_the_whole() -> None:
    began = time.monotonic()
    for seconds in slices(1.2):
        assert seconds is not None
        NEVER.wait(seconds)
    assert 1.2 <= time.monotonic() - began < 5
