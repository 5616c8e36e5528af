"""A signal handler that uses ActionKit, run between any two bytecodes of what the main thread does.

Python runs a signal handler in the main thread, between two bytecodes of whatever runs there: also
while a lock is held. Real signals rarely come at the wrong one. So this script counts the bytecodes
of one use of ActionKit, does the same use again and again, and runs the handler at a given one of
them each time. Run by `tests/client/test_signal_handlers.py` in a process of its own:

    python -m tests.signal_walk USE COUNT

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
import warnings
from collections.abc import Callable
from types import FrameType
from typing import Any

from test_msgs.action import Fibonacci

from actionkit import (
    ActionKitError,
    Client,
    ClientClosedError,
    GoalFuture,
    RetryPolicy,
    cancel_on_signals,
)
from actionkit._calls import signals
from actionkit._threads.pool import in_callback

HANG = 30.0
"""Seconds after which what stands still is taken for hung; each use takes milliseconds."""
LOOKED_AT = (
    "/actionkit/_",
    "/threading.py",
    "/concurrent/futures/",
    "/rclpy/context.py",
    "/rclpy/guard_condition.py",
)
"""Where a handler is run: in ActionKit, and in what has locks."""
TOO_MUCH = ("/actionkit/_messages/", "/actionkit/_model/")
"""Pure and long: nothing there is shared."""

AnyClient = Client[Any]
ENDS = (ActionKitError, concurrent.futures.CancelledError, asyncio.CancelledError)


def new_client() -> AnyClient:
    return Client(Fibonacci, "fibonacci", retry=RetryPolicy.none())


def in_start_of_thread() -> bool:
    """Whether this thread holds the lock with which Python starts and ends threads.

    Python calls nothing while it holds that, and so runs no handler of a real signal there. (0 of
    215,000 signals came there, on Python 3.10 to 3.13.) One that starts a thread there would hang.
    """
    return bool(threading._active_limbo_lock._is_owned())  # type: ignore[attr-defined]


class Interruption:
    """Runs a handler at the chosen bytecode; counts them where none is chosen."""

    client: AnyClient

    def __init__(self, at: int = -1, handler: Callable[[AnyClient], None] | None = None) -> None:
        self.seen = 0
        self.took = 0.0
        self.where = ""
        self._at = at
        self._handler = handler

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
            if self.seen == self._at and in_start_of_thread():
                self._at += 1
            elif self.seen == self._at and self._handler is not None:
                self.where = f"{frame.f_code.co_filename}:{frame.f_lineno}"
                began = time.monotonic()
                try:
                    self._handler(self.client)  # a tracing function is not traced itself
                except ClientClosedError:
                    pass  # the main thread has closed it
                except RuntimeError:
                    assert in_callback.get()  # where `call` refuses to wait
                self.took = time.monotonic() - began
            self.seen += 1
        return self._step


# --- what the main thread does -----------------------------------------------------------------


def blocking_call(client: AnyClient) -> None:
    client.call({"order": 1}, 20)


def future(client: AnyClient) -> None:
    made = client.call_async({"order": 1}, timeout=20)
    made.add_done_callback(lambda _: None)
    assert made.state is not None
    assert not made.cancelled() or made.done()
    concurrent.futures.wait([made], 20)
    assert list(concurrent.futures.as_completed([made], 20)) == [made]
    made.exception(20)
    made.outcome(20)
    made.result(20)


def cancelled(client: AnyClient) -> None:
    made = client.call_async({"order": 50}, timeout=20)
    made.cancel()
    made.outcome(20)


def feedback(client: AnyClient) -> None:
    made = client.call_async({"order": 3}, timeout=20)
    list(made.feedback())
    assert made.latest_feedback is None or made.timeline


def server(client: AnyClient) -> None:
    client.wait_for_server(20)
    client.server_is_ready()
    assert client.pending >= 0
    client.cancel_all()
    client.retry_budget.on_success()
    client.retry_budget.on_transient_failure()
    assert client.retry_budget.tokens > 0


def closing(client: AnyClient) -> None:
    client.call_async({"order": 50}, timeout=20)
    client.close()


def making(client: AnyClient) -> None:
    with new_client() as another:
        assert another.pending == 0


def awaiting(client: AnyClient) -> None:
    async def on_feedback(_: Any) -> None:
        await asyncio.sleep(0)

    async def await_two() -> None:
        calls = [client.call_async({"order": 2}, on_feedback, 20) for _ in range(2)]
        await asyncio.gather(*calls)

    asyncio.run(await_two())


USES = (
    blocking_call,
    future,
    cancelled,
    feedback,
    server,
    closing,
    making,
    awaiting,
)

# --- what the handler does ---------------------------------------------------------------------


def do_call(client: AnyClient) -> None:
    """Take longer than what was interrupted, whose goal ends meanwhile."""
    # Where the loop of asyncio was interrupted there is a warning, and a handler cannot await.
    warnings.simplefilter("ignore", RuntimeWarning)
    client.call({"order": 2}, 20)


def do_future(client: AnyClient) -> None:
    made = client.call_async({"order": 2}, timeout=20)
    made.add_done_callback(lambda _: None)
    list(made.feedback())
    made.result(20)
    assert made.outcome(0).ok
    assert made.latest_feedback is None or made.timeline


def do_cancel(client: AnyClient) -> None:
    made: GoalFuture[Any, Any] = client.call_async({"order": 50}, timeout=20)
    client.cancel_all()
    made.cancel()
    made.outcome(20)


def do_look(client: AnyClient) -> None:
    assert client.wait_for_server(20)
    assert client.server_is_ready()
    assert client.pending >= 0
    client.retry_budget.on_success()
    client.retry_budget.on_transient_failure()
    assert client.retry_budget.tokens > 0


def do_close(client: AnyClient) -> None:
    client.close()


def do_make(client: AnyClient) -> None:
    with new_client() as another:
        another.call({"order": 1}, 20)


def do_end_by_signal(client: AnyClient) -> None:
    """What `cancel_on_signals` does, in a program that goes on after it."""
    client.call_async({"order": 50}, timeout=20)
    signals._on_signal(signal.SIGUSR1, None)
    assert client.pending == 0


HANDLERS = (do_call, do_future, do_cancel, do_look, do_close, do_make, do_end_by_signal)


def interrupted(use: Callable[[AnyClient], None], interruption: Interruption) -> Interruption:
    """Do `use` once, with a client of its own."""
    with new_client() as client:
        client.wait_for_server(60)
        interruption.client = client
        faulthandler.dump_traceback_later(HANG, exit=True)
        with interruption, contextlib.suppress(*ENDS):
            use(client)
        faulthandler.cancel_dump_traceback_later()
    return interruption


def main(use_name: str, count: int) -> None:
    (use,) = (use for use in USES if use.__name__ == use_name)
    signal.signal(signal.SIGUSR1, lambda *_: None)
    cancel_on_signals(signal.SIGUSR1)
    keeper = new_client()  # so that the thread, and what it knows of servers, stays
    assert keeper.wait_for_server(60)
    total = min(interrupted(use, Interruption()).seen for _ in range(2))
    for handler in HANDLERS:
        done = [
            interrupted(use, Interruption(int(total * (n + random.random()) / count), handler))
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
