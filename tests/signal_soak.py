"""Thousands of signals whose handler uses ActionKit at random, while the main thread does so too.

Needs two reference servers in its ROS domain: `fibonacci`, and `never_finishes` on `/endless`,
which shows whether a goal is left running. Run by `tests/client/test_signal_handlers.py` in a
process of its own; `ACTIONKIT_SIGNALS=10000` in the environment makes it 10,000 signals.

    python -m tests.signal_soak SIGNALS [SEED]

Prints what was done as a line of JSON. A handler may be interrupted by another signal, too.
"""

from __future__ import annotations

import concurrent.futures
import faulthandler
import json
import random
import signal
import sys
import time
from collections import Counter, deque
from collections.abc import Callable
from types import FrameType
from typing import Any

from test_msgs.action import Fibonacci

from actionkit import (
    ActionKitError,
    Client,
    GoalFuture,
    RetryPolicy,
    Timeouts,
    cancel_on_signals,
)
from actionkit._calls import left_running

HANG = 90.0
"""Seconds without anything done after which this process is taken for hung, and says where."""
DEEPEST = 3
"""Handlers that may be interrupted by the next one."""
MOST_FUTURES = 20
MOST_ENDLESS = 6
"""Below the depth of a server's queue of cancel requests."""

AnyClient = Client[Any]
AnyFuture = GoalFuture[Any, Any]
ENDS = (ActionKitError, concurrent.futures.CancelledError)


class Soak:
    """The clients and futures that main thread and handlers share, and what was counted."""

    def __init__(self, signals: int, seed: int) -> None:
        self.random = random.Random(seed)
        self.signals = signals
        self.handled: Counter[str] = Counter()
        self.done: Counter[str] = Counter()
        self.ends: Counter[str] = Counter()
        self.wrong: list[str] = []
        self.longest = (0.0, "")
        self.depth = 0
        self.deepest = 0
        self.called_back = 0
        self.futures: deque[AnyFuture] = deque(maxlen=MOST_FUTURES)
        self.clients = deque(self.new_client("fibonacci") for _ in range(2))
        self.endless_clients = deque([self.new_client("endless")])

    def new_client(self, name: str) -> AnyClient:
        return Client(Fibonacci, name, timeouts=Timeouts(total=30.0), retry=RetryPolicy.none())

    # --- what is done, in the main thread and in handlers -----------------------------------

    def client(self) -> AnyClient:
        return self.random.choice(self.clients)

    @property
    def endless(self) -> AnyClient:
        return self.endless_clients[-1]

    def renew(self, clients: deque[AnyClient], name: str) -> None:
        """Close the oldest client, after another has taken its place.

        Each step is one operation: with a handler that does the same between them, none is lost.
        """
        clients.append(self.new_client(name))
        clients.popleft().close()

    def goal(self) -> dict[str, int]:
        return {"order": self.random.randint(1, 12)}

    def call(self) -> None:
        self.client().call(self.goal())

    def call_async(self) -> None:
        feedback = self.random.choice([None, lambda _: None])
        future = self.client().call_async(self.goal(), feedback)
        future.add_done_callback(self.on_done)
        self.futures.append(future)

    def call_endless(self) -> None:
        if self.endless.pending < MOST_ENDLESS:
            self.futures.append(self.endless.call_async({"order": 1}))

    def on_done(self, _: AnyFuture) -> None:
        self.called_back += 1

    def any_future(self) -> AnyFuture | None:
        futures = list(self.futures)
        return self.random.choice(futures) if futures else None

    def result(self) -> None:
        future = self.any_future()
        if future is not None and future.done():
            future.result()

    def wait_for_result(self) -> None:
        future = self.client().call_async(self.goal())
        self.ends["ok" if future.outcome().ok else "not ok"] += 1

    def feedback(self) -> None:
        for _ in self.client().call_async(self.goal()).feedback():
            pass

    def cancel(self) -> None:
        future = self.any_future()
        if future is not None:
            future.cancel()

    def cancel_and_wait(self) -> None:
        future = self.client().call_async({"order": 40})
        future.cancel()
        future.exception()

    def cancel_all(self) -> None:
        self.client().cancel_all()

    def cancel_endless(self) -> None:
        self.endless.cancel_all()

    def look(self) -> None:
        client = self.client()
        assert client.pending >= 0
        client.server_is_ready()
        assert client.retry_budget.tokens >= 0
        future = self.any_future()
        if future is not None:
            assert future.latest_feedback is not None or future.timeline is not None
            assert future.state is not None
            assert future.running() or future.done() or not future.cancelled()

    def wait_for_server(self) -> None:
        assert self.client().wait_for_server(30)

    def end_by_signal(self) -> None:
        signal.raise_signal(signal.SIGUSR1)

    def close_one(self) -> None:
        self.renew(self.clients, "fibonacci")

    def close_endless(self) -> None:
        self.renew(self.endless_clients, "endless")

    def make_one(self) -> None:
        with self.new_client("fibonacci") as client:
            client.call_async(self.goal())

    def wait_for_all(self) -> None:
        """As a handler must not: these functions of Python's own take locks."""
        futures = [self.client().call_async(self.goal()) for _ in range(3)]
        concurrent.futures.wait(futures)
        for future in concurrent.futures.as_completed(futures):
            assert future.done()

    def one_of(self, things: list[Callable[[], None]], counted: Counter[str]) -> str:
        thing = self.random.choice(things)
        try:
            thing()
        except ENDS as error:
            self.ends[type(error).__name__] += 1
        except Exception as error:  # noqa: BLE001  told at the end
            self.wrong.append(f"{thing.__name__}: {error!r}")
        counted[thing.__name__] += 1
        return thing.__name__

    # --- signals ---------------------------------------------------------------------------

    def arm(self) -> None:
        if self.handled.total() < self.signals:
            signal.setitimer(signal.ITIMER_REAL, self.random.uniform(0.0002, 0.004))

    def handle(self, _: int, frame: FrameType | None) -> None:
        began = time.monotonic()
        self.depth += 1
        self.deepest = max(self.deepest, self.depth)
        if self.depth < DEEPEST:
            self.arm()
        thing = self.one_of(self.in_handlers(), self.handled)
        self.depth -= 1
        self.longest = max(self.longest, (time.monotonic() - began, thing))
        self.arm()

    def in_handlers(self) -> list[Callable[[], None]]:
        quick = [self.call_async, self.call_endless, self.cancel, self.look, self.result]
        slow = [
            self.call,
            self.wait_for_result,
            self.feedback,
            self.cancel_and_wait,
            self.cancel_all,
            self.cancel_endless,
            self.wait_for_server,
            self.close_one,
            self.close_endless,
            self.make_one,
            self.end_by_signal,
        ]
        return quick * 4 + slow

    def in_main(self) -> list[Callable[[], None]]:
        return [*self.in_handlers(), self.wait_for_all]

    def run(self) -> None:
        for client in (*self.clients, *self.endless_clients):
            assert client.wait_for_server(60)
        signal.signal(signal.SIGUSR1, lambda *_: None)
        cancel_on_signals(signal.SIGUSR1)
        left_running.mute()  # a second one ends the wait for the goals of the first
        signal.signal(signal.SIGALRM, self.handle)
        self.arm()
        while self.handled.total() < self.signals:
            faulthandler.dump_traceback_later(HANG, exit=True)
            self.one_of(self.in_main(), self.done)
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, signal.SIG_IGN)
        for client in (*self.clients, *self.endless_clients):
            client.close()
        faulthandler.cancel_dump_traceback_later()


def main(signals: int, seed: int) -> None:
    began = time.monotonic()
    soak = Soak(signals, seed)
    soak.run()
    report = {
        "signals": soak.handled.total(),
        "seconds": round(time.monotonic() - began, 1),
        "longest": round(soak.longest[0], 3),
        "longest of": soak.longest[1],
        "deepest": soak.deepest,
        "unfinished": sum(not future.done() for future in soak.futures),
        "called back": soak.called_back,
        "wrong": soak.wrong,
        "in handlers": dict(soak.handled),
        "in the main thread": dict(soak.done),
        "ends": dict(soak.ends),
    }
    print(json.dumps(report))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else random.randrange(10**6))
