"""The background process of `actionkit stop`: it publishes a hold until that is released.

`_holding.Keeper` starts it in its own session, without a terminal. So neither Ctrl-C nor a closed
terminal ends it.
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
"""Written when every process in sight can be reached."""
_LOOK = 0.1
"""Seconds between two looks, at the start and at the end."""
_IDLE = 60.0
"""Seconds between two looks otherwise; changes wake it."""
_LEAST = 2.0
"""Seconds for which the release is published at least."""
_MOST = 30.0
"""Seconds for which it is published at most, if a process has not received it; after 20 s, the
middleware forgets a process that is stopped."""


def main() -> None:
    """Keep the hold from standard input, in the ROS domain of the environment."""
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
        # The same human has stopped the robot before: one hold is enough.
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
    """Release the pipes and the directory of the process that started this."""
    os.chdir("/")
    nowhere = os.open(os.devnull, os.O_RDWR)
    for descriptor in (0, 1, 2):
        os.dup2(nowhere, descriptor)
    os.close(nowhere)


if __name__ == "__main__":
    main()
