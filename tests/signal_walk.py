"""A signal handler that uses ActionKit, run between any two bytecodes of what the main thread does.

Python runs a signal handler in the main thread, between two bytecodes of whatever runs there: also
while a lock is held. Real signals rarely come at the wrong one. So this script counts the bytecodes
of one use of ActionKit, does the same use again and again, and runs the handler at a given one of
them each time. Run by `tests/client/test_signal_handlers.py` in a process of its own:

    python -m tests.signal_walk USE HANDLER COUNT

COUNT places are tried, evenly spread; 0 tries each. Prints what was done as a line of JSON.
"""

from __future__ import annotations

import concurrent.futures
import contextlib
import faulthandler
import json
import sys
import time
from collections.abc import Callable
from types import FrameType
from typing import Any

from test_msgs.action import Fibonacci

from actionkit import ActionKitError, Client, ClientClosedError, GoalFuture, RetryPolicy

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
TOO_MUCH = ("/actionkit/_field", "/actionkit/_settings", "/actionkit/_arguments")
"""Pure and long: nothing there is shared."""

AnyClient = Client[Any, Any, Any]
ENDS = (ActionKitError, concurrent.futures.CancelledError)


def new_client() -> AnyClient:
    return Client(Fibonacci, "fibonacci", retry=RetryPolicy.none())


class Interruption:
    """Runs a handler at the chosen bytecode; counts them where none is chosen."""

    def __init__(self, at: int | None = None, handler: Callable[[], object] | None = None) -> None:
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
            if self.seen == self._at and self._handler is not None:
                self.where = f"{frame.f_code.co_filename}:{frame.f_lineno}"
                began = time.monotonic()
                self._handler()  # a tracing function is not traced itself
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


USES = (blocking_call, future, cancelled, feedback, server, closing, making)

# --- what the handler does ---------------------------------------------------------------------


def do_call(client: AnyClient) -> None:
    """Take longer than what was interrupted, whose goal ends meanwhile."""
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


HANDLERS = (do_call, do_future, do_cancel, do_look, do_close, do_make)


def main(use_name: str, handler_name: str, count: int) -> None:
    use = {use.__name__: use for use in USES}[use_name]
    handler = {handler.__name__: handler for handler in HANDLERS}[handler_name]
    keeper = new_client()  # so that the thread, and what it knows of servers, stays
    assert keeper.wait_for_server(60)

    def once(at: int | None) -> Interruption:
        with new_client() as client:
            client.wait_for_server(60)

            def interrupt() -> None:
                try:
                    handler(client)
                except ClientClosedError:
                    assert client._session.closed

            interruption = Interruption(at, interrupt)
            faulthandler.dump_traceback_later(HANG, exit=True)
            with interruption, contextlib.suppress(*ENDS):
                use(client)
            faulthandler.cancel_dump_traceback_later()
        return interruption

    once(None)
    total = min(once(None).seen for _ in range(3))
    places = range(total) if count == 0 else [total * n // count for n in range(count)]
    longest, ran = (0.0, ""), 0
    for place in places:
        done = once(place)
        longest = max(longest, (done.took, done.where))
        ran += bool(done.where)
    keeper.close()
    print(json.dumps({"places": total, "ran": ran, "longest": longest[0], "where": longest[1]}))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
