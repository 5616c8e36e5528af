"""How far property tests look for an order of events that breaks a promise.

The suite tries the same examples each time, so that the same code gets the same answer. With
ACTIONKIT_HUNT=60 in the environment it tries 60 times as many of the orders of events, others
each time: for whoever changes the state machine, and has some minutes.
"""

from __future__ import annotations

import os

from hypothesis import settings

TIMES = int(os.environ.get("ACTIONKIT_HUNT", "0"))

settings.register_profile("actionkit", derandomize=not TIMES)
settings.load_profile("actionkit")


def examples(usual: int) -> settings:
    """Return settings for a test of orders that usually tries so many."""
    return settings(max_examples=usual * max(TIMES, 1), deadline=None)
