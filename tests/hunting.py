"""How far property tests look for an order of events that breaks a promise.

With ACTIONKIT_HUNT=60 in the environment they try 60 times as many: for whoever changes the
state machine, and has some minutes.
"""

from __future__ import annotations

import os

from hypothesis import settings

_TIMES = int(os.environ.get("ACTIONKIT_HUNT", "1"))


def examples(usual: int) -> settings:
    """Return settings for a test of orders that usually tries so many."""
    return settings(max_examples=usual * _TIMES, deadline=None)
