"""How many examples the random tests try.

Property tests look for an order of events that breaks a promise.

`ACTIONKIT_HUNT` in the environment multiplies what they try. Without it they try a fifth, at
random, so each run tries others. After a change of the state machine, or of the calls around it,
set it to 60.

Some tests with real processes do the same thing many times, because what they look for goes wrong
now and then only. `ACTIONKIT_REPEAT=4` in the environment has them do it four times as often.
"""

from __future__ import annotations

import os

from hypothesis import settings

_TIMES = float(os.environ.get("ACTIONKIT_HUNT", "0.2"))
REPEAT = int(os.environ.get("ACTIONKIT_REPEAT", "1"))
"""By this a test multiplies how often it does the same thing."""


def many(usual: int) -> int:
    """Return how many to try where it is so many at `ACTIONKIT_HUNT=1`."""
    return max(1, round(usual * _TIMES))


def examples(usual: int) -> settings:
    """Return settings for a test that tries so many orders at `ACTIONKIT_HUNT=1`."""
    return settings(max_examples=many(usual), deadline=None)


def steps(usual: int) -> int:
    """Return how many events long all orders are tried, where it is so many at `ACTIONKIT_HUNT=1`.

    Each further event makes three to four times as many situations, so one more or less is much.
    """
    return usual + (_TIMES >= 10) - (_TIMES < 1)
