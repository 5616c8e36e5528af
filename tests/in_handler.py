"""What a signal handler may do, done between any two bytecodes of what the main thread does (C2.9).

Python runs a signal handler in the main thread, between two bytecodes of whatever runs there: also
while a lock is held. Signals that are sent rarely come at the wrong one. So this script counts the
bytecodes of one use of ActionKit, does the same use again and again, and raises a signal at a given
one of them each time. Run by `tests/client/test_signal_handlers.py` in a process of its own:

    python -m tests.in_handler USE COUNT

For each handler COUNT places are tried, others in each run. Prints a line of JSON for each handler.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import contextlib
import faulthandler
import json
import random
import signal
import sys
import threading
import time
from collections.abc import Callable
from types import FrameType
from typing import Any

from test_msgs.action import Fibonacci

from actionkit import ActionKitError, Client, ClientClosedError, GoalFuture, RetryPolicy

HANG = 40.0
"""Seconds after which what stands still is taken for hung; each use takes less than one."""
LOOKED_AT = ("/actionkit/_", "/threading.py", "/concurrent/futures/")
"""Where a handler is run: in ActionKit, and in what has locks."""
TOO_MUCH = ("/actionkit/_messages/", "/actionkit/_model/")
"""Pure and long: nothing there is shared."""
LONG_GOAL = {"order": 90}
"""It runs for seconds, where the goals of the uses take milliseconds."""
ENDS = (ActionKitError, concurrent.futures.CancelledError, asyncio.CancelledError, SystemExit)


def new_client() -> Client[Any]:
    return Client(Fibonacci, "fibonacci", retry=RetryPolicy.none())


def in_start_of_thread() -> bool:
    """Whether this thread holds the lock with which Python starts and ends threads.

    Python calls nothing while it holds that, and so runs no handler of a real signal there. (0 of
    215,000 signals came there, on Python 3.10 to 3.13.)
    """
    return bool(threading._active_limbo_lock._is_owned())  # type: ignore[attr-defined]


def in_constructor(frame: FrameType | None) -> bool:
    """Whether a client is being made, of which an error there may leave the thread behind."""
    while frame is not None and frame.f_code is not Client.__init__.__code__:
        frame = frame.f_back
    return frame is not None


class Interruption:
    """Raises a signal at the chosen bytecode; counts them where none is chosen."""

    def __init__(self, at: int, *, raises: bool) -> None:
        self.seen = 0
        self.took = 0.0
        self.where = ""
        self._at = at
        self._raises = raises

    def __enter__(self) -> Interruption:
        sys.settrace(self._enter_frame)
        return self

    def __exit__(self, *_: object) -> None:
        sys.settrace(None)

    def _enter_frame(self, frame: FrameType, event: str, _: object) -> Any:
        name = frame.f_code.co_filename
        if not any(part in name for part in LOOKED_AT) or any(part in name for part in TOO_MUCH):
            return None
        frame.f_trace_opcodes = True
        frame.f_trace_lines = False
        return self._step

    def _step(self, frame: FrameType, event: str, _: object) -> Any:
        if event == "opcode":
            here = self.seen == self._at
            if here and (in_start_of_thread() or (self._raises and in_constructor(frame))):
                self._at += 1
            elif here:
                self.where = f"{frame.f_code.co_filename}:{frame.f_lineno}"
                began = time.monotonic()
                try:
                    signal.raise_signal(signal.SIGUSR1)  # a tracing function is not traced itself
                finally:
                    self.took = time.monotonic() - began
            self.seen += 1
        return self._step


# --- what the main thread does -----------------------------------------------------------------


def blocking_call(client: Client[Any]) -> None:
    client.call({"order": 1}, 20, on_feedback=lambda _: None)


def future(client: Client[Any]) -> None:
    made = client.call_async({"order": 2}, timeout=20)
    made.add_done_callback(lambda _: None)
    list(made.feedback())
    concurrent.futures.wait([made], 20)
    assert list(concurrent.futures.as_completed([made], 20)) == [made]
    made.outcome(20)
    made.result(20)


def awaiting(client: Client[Any]) -> None:
    async def on_feedback(_: Any) -> None:
        await asyncio.sleep(0)

    async def await_two() -> None:
        calls = [client.call_async({"order": 2}, on_feedback, 20) for _ in range(2)]
        await asyncio.gather(*calls)

    asyncio.run(await_two())


def making_and_closing(client: Client[Any]) -> None:
    with new_client() as another:
        another.call_async(LONG_GOAL, timeout=20)
    client.call_async(LONG_GOAL, timeout=20)
    client.cancel_all()
    client.close()


USES = (blocking_call, future, awaiting, making_and_closing)

# --- what the handler does ---------------------------------------------------------------------


def do_cancel(client: Client[Any], running: GoalFuture[Any, Any]) -> None:
    running.cancel()


def do_cancel_all(client: Client[Any], running: GoalFuture[Any, Any]) -> None:
    client.cancel_all()


def do_close(client: Client[Any], running: GoalFuture[Any, Any]) -> None:
    client.close()
    assert running.done()
    assert client.pending == 0


def do_read(client: Client[Any], running: GoalFuture[Any, Any]) -> None:
    assert running.done() or client.pending
    assert running.state is not None
    assert running.timeline is not None
    assert not running.cancelled() or running.done()
    assert running.running() or running.known_to_run in (True, False, None)
    assert running.latest_feedback is None or running.goal_id
    assert client.retry_budget.tokens > 0


def do_raise(client: Client[Any], running: GoalFuture[Any, Any]) -> None:
    sys.exit("told to")


HANDLERS = (do_cancel, do_cancel_all, do_close, do_read, do_raise)


def interrupted(use: Callable[..., None], handler: Callable[..., None], at: int) -> Interruption:
    """Do `use` once, with a client of its own and a goal that runs, and check what became of it."""
    with new_client() as client:
        client.wait_for_server(60)
        running = client.call_async(LONG_GOAL, timeout=60)

        def handle(*_: object) -> None:
            with contextlib.suppress(ClientClosedError):  # the main thread has closed it
                handler(client, running)

        signal.signal(signal.SIGUSR1, handle)
        faulthandler.dump_traceback_later(HANG, exit=True)
        interruption = Interruption(at, raises=handler is do_raise)
        with interruption, contextlib.suppress(*ENDS):
            use(client)
        if interruption.where and handler in (do_cancel, do_cancel_all, do_close):
            assert not running.outcome(20).ok, interruption.where
        if not client.closed:
            client.call({"order": 1}, 20)
    assert running.done()
    faulthandler.cancel_dump_traceback_later()
    return interruption


def main(use_name: str, count: int) -> None:
    (use,) = (use for use in USES if use.__name__ == use_name)
    keeper = new_client()  # so that the thread, and what it knows of servers, stays
    assert keeper.wait_for_server(60)
    total = min(interrupted(use, do_read, -1).seen for _ in range(2))
    for handler in HANDLERS:
        done = [
            interrupted(use, handler, int(total * (n + random.random()) / count))
            for n in range(count)
        ]
        longest = max(done, key=lambda one: one.took)
        report = {
            "handler": handler.__name__,
            "places": total,
            "interrupted": sum(bool(one.where) for one in done),
            "longest": longest.took,
            "where": longest.where,
        }
        print(json.dumps(report), flush=True)
    keeper.close()


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
