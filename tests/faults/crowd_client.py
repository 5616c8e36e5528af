"""A program with many goals in flight, which gives up on all of them in one of several ways.

Started by `tests/faults/crowd.py`, with which it speaks by lines. When its end comes, after
whatever ActionKit does at the interpreter's exit, it writes what each of its calls came to.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import logging
import signal
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

WAY, COUNT, REPORT, SETTINGS = sys.argv[1], int(sys.argv[2]), sys.argv[3], json.loads(sys.argv[4])
futures: list[Any] = []
timeouts: list[float | None] = []
client: Any = None
# Where a handler closes the client the calls end with errors, and the program as it would anyway.
IGNORED = (Exception,) if WAY == "term_close" else ()


def write_report() -> None:
    """Write the outcome of each call, unless it was written before."""
    if Path(REPORT).exists():
        return
    ends = []
    for future, timeout in zip(futures, timeouts, strict=False):  # the last may be in the making
        end = {"goal": str(future.goal_id), "done": future.done(), "timeout": timeout}
        if future.done():
            outcome = future.outcome(0)
            end |= {
                "error": "" if outcome.error is None else type(outcome.error).__name__,
                "cancel": str(outcome.cancel or ""),
                "elapsed": outcome.elapsed,
            }
        ends.append(end)
    Path(REPORT).write_text(json.dumps({"at": time.monotonic(), "ends": ends}))


# Before ActionKit is imported: what is registered first is called last at the exit.
atexit.register(write_report)

from test_msgs.action import Fibonacci  # noqa: E402

from actionkit import Client, RetryPolicy, Timeouts  # noqa: E402


def tell_state(*_: object) -> None:
    """Handle SIGUSR1, from a test that waits too long: report the state of the goals."""
    states = Counter(str(future.timeline[-1].state) for future in futures)
    link = client._session.connection.link
    said = f"goals {dict(states)}, server {link.readiness.state}, tables {link.table_sizes()}"
    print(said, file=sys.stderr, flush=True)


def told() -> None:
    """Wait for the next line, which is the word to go on."""
    sys.stdin.readline()


def send() -> None:
    """Send all goals, when told to. With deadlines, all of them pass at the same time."""
    told()
    lead = SETTINGS.get("lead")
    end = None if lead is None else time.monotonic() + lead
    for _ in range(COUNT):
        timeout = None if end is None else end - time.monotonic()
        timeouts.append(timeout)
        futures.append(client.call_async({"order": 1}, timeout=timeout))


def give_up() -> None:
    """Do it in the chosen way. What ends the program may end it here."""
    if WAY == "cancel_all":
        told()
        client.cancel_all()
        wait_for_all()
        told()  # The client lives on.
    elif WAY == "close":
        told()
        client.close()
        write_report()
    elif WAY == "with":
        with client:
            told()
    elif WAY == "deadline":
        wait_for_all()
        told()
    elif WAY == "exit":
        told()
    else:
        futures[-1].result()


def wait_for_all() -> None:
    for future in futures:
        future.outcome(120)
    write_report()
    print("ended", flush=True)


def end_here(*_: object) -> None:
    """Handle SIGTERM."""
    if WAY == "term_exit":
        sys.exit(3)
    client.close()


def main() -> None:
    global client  # noqa: PLW0603  its calls are reported of whatever ends this
    if SETTINGS.get("log"):
        logging.basicConfig(level=logging.WARNING)
    signal.signal(signal.SIGUSR1, tell_state)
    if WAY.startswith("term"):
        signal.signal(signal.SIGTERM, end_here)
    client = Client(
        Fibonacci,
        SETTINGS.get("action", "fibonacci"),
        timeouts=Timeouts(server=60.0, accept=60.0, cancel=SETTINGS.get("cancel", 2.0)),
        retry=RetryPolicy.none(),
    )
    assert client.wait_for_server(60)
    print("up", flush=True)
    with contextlib.suppress(*IGNORED):
        send()
        give_up()


main()
