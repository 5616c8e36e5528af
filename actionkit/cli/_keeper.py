"""The process that `actionkit stop` leaves behind: it tells of a hold until that is released.

Started by `_holding.start_keeper`, without a terminal: it has a session of its own, so that neither
Ctrl-C nor a closed terminal ends it.
"""

from __future__ import annotations

import contextlib
import os
import queue
import signal
import sys
import time

from actionkit._ros.holds.state import Hold, decode, older_of_same

READY = "ready"
"""Written when everybody in sight can be told."""
_LOOK = 0.1
"""Seconds between two looks, at the start and at the end."""
_IDLE = 60.0
"""Seconds between two looks in between; changes wake it."""
_LEAST = 2.0
"""Seconds for which the release is told at least."""
_MOST = 30.0
"""Seconds for which it is told at most to somebody who has not taken it; the middleware forgets a
process that is stopped after 20 s."""


def main() -> None:
    """Keep the hold that standard input tells of, in the ROS domain of the environment."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    state, _ = decode(sys.stdin.read())
    (own,) = state.active

    from actionkit._ros.holds.view import HoldView

    changed: queue.SimpleQueue[None] = queue.SimpleQueue()
    view = HoldView(None, "keeper", speaks=True, on_change=lambda: changed.put(None))
    view.add(state)
    view.start()
    while not view.has_told:
        _wait(changed, _LOOK)
    print(READY, flush=True)
    _let_go()
    while own in view.state.active:
        # The same human has stopped the robot before: one of these is enough.
        if older := older_of_same(view.state, own):
            view.release(older)
        _wait(changed, _IDLE)
    began = time.monotonic()
    while time.monotonic() - began < _LEAST or (
        time.monotonic() - began < _MOST
        and any(_holds(said.state.active, own) for said in view.others)
    ):
        time.sleep(_LOOK)
    view.close()


def _holds(holds: tuple[Hold, ...], own: Hold) -> bool:
    return any(hold.hold_id == own.hold_id for hold in holds)


def _wait(changed: queue.SimpleQueue[None], seconds: float) -> None:
    with contextlib.suppress(queue.Empty):
        changed.get(timeout=seconds)


def _let_go() -> None:
    """Keep nothing of the process that started this: no pipe, and no directory to unmount."""
    os.chdir("/")
    nowhere = os.open(os.devnull, os.O_RDWR)
    for descriptor in (0, 1, 2):
        os.dup2(nowhere, descriptor)
    os.close(nowhere)


if __name__ == "__main__":
    main()
