"""A program whose child process, of `multiprocessing`, sends goals and ends while they run.

`python -m tests.soak.children HOW END COUNT LIFE`, as a user may write it. Nothing but ActionKit
can cancel these goals: such a child ends without the functions of `atexit`.
"""

from __future__ import annotations

import multiprocessing
import sys
import threading
import time
from concurrent.futures import ProcessPoolExecutor
from typing import Any

from test_msgs.action import Fibonacci

from actionkit import Client, RetryPolicy, Timeouts

CODES = {"returns": 0, "raises": 1, "exits": 3, "pool": 0}
"""How the child ends, or the pool that it belongs to; and the code of the program then."""
_PATIENCE = 20.0
client: Any = None


def work(end: str, count: int, life: float) -> None:
    """Send the goals, and end."""
    global client  # noqa: PLW0603  what is collected by a frame's end could be cancelled by that
    client = Client(
        Fibonacci,
        "endless",
        timeouts=Timeouts(server=_PATIENCE, accept=_PATIENCE),
        retry=RetryPolicy.none(),
    )
    running = threading.Semaphore(0)
    for _ in range(count):
        client.call_async({"order": 1}, lambda _: running.release())
    until = time.monotonic() + _PATIENCE
    for _ in range(count):
        running.acquire(timeout=max(0.0, until - time.monotonic()))
    threading.Event().wait(life)
    if end == "raises":
        raise RuntimeError("mine")
    if end == "exits":
        sys.exit(3)


def main(how: str, end: str, count: int, life: float) -> int | None:
    context: Any = multiprocessing.get_context(how)
    if end == "pool":
        with ProcessPoolExecutor(1, context) as pool:
            return pool.submit(work, end, count, life).result()
    child = context.Process(target=work, args=(end, count, life))
    child.start()
    child.join()
    code: int = child.exitcode
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2], int(sys.argv[3]), float(sys.argv[4])))
