"""The ends that come to a whole process: the interpreter's exit, and a fork."""

from __future__ import annotations

import atexit
import os
import time
import uuid
from functools import cache

from actionkit._calls.left_running import tell_of_goals_left
from actionkit._calls.session import FREEING, MARGIN, TELLING, Session, await_ends, live
from actionkit._model.settings import LONGEST_GRACE
from actionkit._observers import channel as channels
from actionkit._ros import runtimes
from actionkit._threads import blocked as _blocked
from actionkit._threads import diagnostics as _diagnostics

_inherited: list[Session] = []
"""Kept for ever: to free what they hold here would break the parent's."""


def close_all() -> None:
    """End everything at the interpreter's exit, within a bound and in silence (C1.10).

    Not in silence where goals may still be running: that is what a human has to know.
    """
    sessions = list(live)
    grace = max((s.cancel_grace for s in sessions), default=0.0) + MARGIN
    if any(session.in_a_hurry for session in sessions):
        grace = 0.0
    began = time.monotonic()
    try:
        for session in sessions:
            session.begin_close()
        futures = [future for session in sessions for future in session.futures()]
        await_ends(futures, grace)
        for session in sessions:
            session.end_calls()
        for session in sessions:
            session.retire()
        _await_freed(sessions, began, grace)
        tell_of_goals_left(_left_running(sessions))
        for session in sessions:
            session.stop_watching()
        # The middleware's own exit handlers crash under a thread that still uses it.
        runtimes.join_ending(FREEING)
        channels.flush_all(time.monotonic() + TELLING)
        _diagnostics.flush(time.monotonic() + TELLING)
    except KeyboardInterrupt:  # a human who does not want to wait for it
        tell_of_goals_left(_left_running(sessions))


def _await_freed(sessions: list[Session], began: float, grace: float) -> None:
    """Wait until no goal is watched any more, as long as servers go on confirming cancellations."""
    while True:
        confirmed_at = max((session.confirmed_at for session in sessions), default=began)
        until = min(max(began, confirmed_at), began + LONGEST_GRACE) + grace
        if time.monotonic() >= until or all(s.await_freed(until) for s in sessions):
            return


def _left_running(sessions: list[Session]) -> list[tuple[str, uuid.UUID]]:
    return [(session.action_name, goal) for session in sessions for goal in session.running()]


def forget_inherited() -> None:
    """In a forked child: what the parent's sessions hold is not ours to free (R20)."""
    _inherited.extend(live)
    live.clear()
    runtimes.forget_inherited()
    _blocked.after_fork()
    channels.after_fork()
    _diagnostics.after_fork()


@cache
def arm() -> None:
    """See to both from now on."""
    atexit.register(close_all)
    os.register_at_fork(after_in_child=forget_inherited)
